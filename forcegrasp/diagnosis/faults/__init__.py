"""What a measurement set may say wrongly: objects, columns, rows, clocks and recordings."""

"""What becomes of a diagnosis where what the set gives is moved, put right or left out."""

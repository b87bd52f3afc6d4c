"""Reports as HTML files: text, tables and figures, for every verb that has something to show."""

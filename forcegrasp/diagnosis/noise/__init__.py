"""What noise is, and what only looks like it: slow parts, single readings that are off, a σ that is wrong."""

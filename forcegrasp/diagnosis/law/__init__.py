"""A law for what no effect explains."""

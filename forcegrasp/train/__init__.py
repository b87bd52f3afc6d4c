"""Trains policies: the loop, collectors, learning algorithms and logs."""

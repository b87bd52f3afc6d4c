"""The figures of this house, from one command: ``python -m tools.results``."""

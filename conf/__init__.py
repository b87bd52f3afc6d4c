"""Hydra configs. Defaults live in forcegrasp/config.py; a file here says only what differs."""

"""Hydra configs. Defaults live in forcegrasp/config; a file here says only what differs."""

"""The model file, and what a training draws from it."""

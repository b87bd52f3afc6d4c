"""The model file, what a training draws from it, and robots nobody measured."""

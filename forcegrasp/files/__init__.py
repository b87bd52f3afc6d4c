"""Reading and writing files: bounded, strict and whole or not at all."""

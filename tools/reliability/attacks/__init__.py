"""Hostile input: each module has ``attacks()``, which yields one attempt after the other."""

"""Finds out which physical effects a model lacks."""

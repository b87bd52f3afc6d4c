"""Trained policies that come with the package, each with a card; ``tools/ship_policy.py`` puts them here."""

"""The search for missing effects, step by step, and what is asked again once more are known."""

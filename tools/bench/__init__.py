"""How fast it is, layer by layer and beside other stacks: ``python -m tools.bench``."""

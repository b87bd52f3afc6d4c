"""The catalogue of effects: contract, equations, symptoms."""

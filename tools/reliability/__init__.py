"""Programs that measure what this project promises: each tries something many times and counts what went wrong.

python -m tools.reliability NAME [--trials N] [--seed S] [--json FILE]; without a name it lists what there is, and
--few tries everything a few times.
docs/reliability.md has the figures.
"""

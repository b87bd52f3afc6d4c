"""Plants realistic errors in forcegrasp, one at a time, and counts how many of them the tests notice.

python -m tools.planted_errors [--only TEXT] [--jobs N] [--timeout S]
docs/reliability.md has the score; lists/ has the errors, a file per package.
"""

"""``python -m forcegrasp``, where the command is not on the path."""

from forcegrasp.cli.main import main

if __name__ == "__main__":
    main()

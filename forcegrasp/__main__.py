"""``python -m forcegrasp``, where the command is not on the path."""

import sys

from forcegrasp.cli.main import main

if __name__ == "__main__":
    sys.exit(main())

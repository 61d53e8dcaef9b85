"""``python -m mwlib COMMAND``."""

import sys

from mwlib.cli import main

if __name__ == "__main__":
    sys.exit(main())

"""The command line: python -m mwlib COMMAND."""

from __future__ import annotations

import argparse
import sys

from . import report
from .course import commands as course_commands
from .data import commands as data_commands

# Every module here has add_parser(subparsers), which sets `run`: arguments -> exit status.
MODULES = (data_commands, report, course_commands)


def main(words: list[str] | None = None) -> int:
    """Run one command; 0 if all is well."""
    parser = argparse.ArgumentParser("mwlib", description="Frequency-domain human motion prediction: data and notebooks.")
    subparsers = parser.add_subparsers(required=True, metavar="COMMAND")
    for module in MODULES:
        module.add_parser(subparsers)
    arguments = parser.parse_args(words)
    try:
        return arguments.run(arguments)
    except (OSError, ValueError) as error:
        print(f"mwlib: {error}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())

"""The command line: ``mwlib COMMAND``, or ``python -m mwlib COMMAND``."""

from __future__ import annotations

import argparse
import sys

from mwlib.course import commands as course_commands
from mwlib.data import commands as data_commands
from mwlib.experiments import claim_commands, keyframe_commands, lafan1_commands, run_commands, sentence_commands
from mwlib.experiments import commands as experiment_commands
from mwlib.experiments import data_commands as check_commands
from mwlib.version import __version__

# Each room brings its own commands: add_parser(subparsers) registers them, and each sets `run`: arguments -> exit status.
ROOMS = (
    check_commands,
    data_commands,
    experiment_commands,
    claim_commands,
    run_commands,
    keyframe_commands,
    lafan1_commands,
    sentence_commands,
    course_commands,
)


def main(words: list[str] | None = None) -> int:
    """Run one command; 0 if all is well."""
    parser = argparse.ArgumentParser("mwlib", description="Frequency-domain human motion diffusion: data, models and notebooks.")
    parser.add_argument("--version", action="version", version=f"mwlib {__version__}")
    subparsers = parser.add_subparsers(required=True, metavar="COMMAND")
    for room in ROOMS:
        room.add_parser(subparsers)
    arguments = parser.parse_args(words)
    try:
        return arguments.run(arguments)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] == "mwlib":
            raise
        print(f'mwlib: {error}; this command needs pip install "motion-wavelet-notebooks[notebooks]"', file=sys.stderr)
    except (ImportError, OSError, ValueError) as error:
        print(f"mwlib: {error}", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())

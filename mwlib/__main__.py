"""The command line: ``mwlib COMMAND``, or ``python -m mwlib COMMAND``."""

from __future__ import annotations

import argparse
import importlib
import sys

from mwlib.version import __version__

# Each room brings its own commands: add_parser(subparsers) registers them, and each sets `run`: arguments -> exit status.
# A command waits for the imports of its own room alone.
ROOMS = {
    "mwlib.experiments.data_commands": ("check-data",),
    "mwlib.data.commands": ("write-synthetic", "fetch"),
    "mwlib.experiments.commands": ("train", "grid-table", "ship", "storyboards"),
    "mwlib.experiments.claim_commands": ("reproduction",),
    "mwlib.experiments.run_commands": ("predict", "export-bvh", "loop"),
    "mwlib.experiments.keyframe_commands": ("inbetween",),
    "mwlib.experiments.lafan1_commands": ("lafan1-benchmark",),
    "mwlib.experiments.sentence_commands": ("generate",),
    "mwlib.course.commands": (
        "course", "run-notebook", "execute-notebooks", "learner-copies", "index-page", "site-sources", "run-experiment",
    ),
}  # fmt: skip


def main(words: list[str] | None = None) -> int:
    """Run one command; 0 if all is well."""
    words = sys.argv[1:] if words is None else words
    parser = argparse.ArgumentParser("mwlib", description="Frequency-domain human motion diffusion: data, models and notebooks.")
    parser.add_argument("--version", action="version", version=f"mwlib {__version__}")
    subparsers = parser.add_subparsers(required=True, metavar="COMMAND")
    asked = [room for room, commands in ROOMS.items() if {*words[:1]} & {*commands}]
    for room in asked or ROOMS:
        importlib.import_module(room).add_parser(subparsers)
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

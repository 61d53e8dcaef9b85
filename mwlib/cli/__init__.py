"""The command line: ``mwlib COMMAND``, or ``python -m mwlib COMMAND``.

A command is a function of `mwlib.cli.data`, `.sample`, `.measure` or `.course`. Its arguments without a star are the words of the
command, those behind it the options, with their types and defaults; its docstring is the help. All this is read from the source
(`mwlib.cli.source`): the function is imported when its command runs, so that help and mistyped words wait for no torch.
"""

import argparse
import difflib
import importlib
import os
import sys
from collections.abc import Iterable, Sequence
from typing import Any

from mwlib.cli.source import Command, arguments, commands, settings_text
from mwlib.version import __version__

ACCEPT = "take runs and results made by an older code of the library, and say so beside everything made with them"


def parse(words: Sequence[str]) -> tuple[Command, dict[str, Any]]:
    """The command that words name, and what they say of its function's arguments; what is not given is left out.

    Raises:
        SystemExit: help was asked for (0), or a word is not understood (2); the message has a near one, if there is one.
    """
    known = commands()
    if not words or words[0] not in known:
        _overview(words, known)
    command = known[words[0]]
    parser = argparse.ArgumentParser(
        f"mwlib {words[0]}", description=" ".join(command.about.split()), argument_default=argparse.SUPPRESS
    )
    for name, settings in arguments(command.module, command.definition):
        parser.add_argument(name, **settings)
    if words[0].startswith("run-") or command.module.endswith((".measure", ".benchmark", ".sample")):
        parser.add_argument("--accept-older-code", action="store_true", help=ACCEPT)
    if "--help" in words or "-h" in words:
        _help(parser, words[1:])
    given, unknown = parser.parse_known_args(words[1:])
    if unknown:
        near = _near(unknown[0].partition("=")[0], [name for action in parser._actions for name in action.option_strings])
        parser.error(f"{unknown[0]!r} is not understood{near}")
    return command, vars(given)


def _overview(words: Sequence[str], known: dict[str, Command]) -> None:
    """List the commands, or say which one was meant."""
    parser = argparse.ArgumentParser("mwlib", description="Frequency-domain human motion diffusion: data, models and notebooks.")
    parser.add_argument("--version", action="version", version=f"mwlib {__version__}")
    subparsers = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, command in known.items():
        subparsers.add_parser(name, help=command.summary)
    if words and not words[0].startswith("-"):
        parser.error(f"there is no command {words[0]!r}{_near(words[0], known)}; expected one of {', '.join(known)}")
    parser.parse_args(words)


def _help(parser: argparse.ArgumentParser, words: Sequence[str]) -> None:
    """Show a command's options and, where one of them names a system, that system's settings."""
    more = ""
    if any(action.dest == "system" for action in parser._actions):
        named = argparse.ArgumentParser(add_help=False)
        named.add_argument("--system", default="prediction")
        try:
            more = settings_text(named.parse_known_args(words)[0].system)
        except ValueError as error:
            parser.error(str(error))
    print(parser.format_help() + more, end="")
    parser.exit()


def _near(word: str, known: Iterable[str]) -> str:
    near = difflib.get_close_matches(word, [*known], n=1, cutoff=0.5)
    return f", did you mean {near[0]}?" if near else ""


def main(words: Sequence[str] | None = None) -> int:
    """Run one command; 0 if all is well."""
    command, given = parse(sys.argv[1:] if words is None else words)
    if given.pop("accept_older_code", False):
        os.environ["MWLIB_ACCEPT_OLDER_CODE"] = "1"  # kernels that a command starts inherit it
    try:
        return getattr(importlib.import_module(command.module), command.definition.name)(**given) or 0
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] == "mwlib":
            raise
        print(f'mwlib: {error}; this command needs pip install "motion-wavelet-notebooks[notebooks]"', file=sys.stderr)
    except (ImportError, OSError, ValueError) as error:
        print(f"mwlib: {error}", file=sys.stderr)
    return 1

"""The command line: ``mwlib COMMAND``, or ``python -m mwlib COMMAND``.

A command is a function of `mwlib.cli.data`, `.sample`, `.measure` or `.course`. Its arguments without a star are the words of the
command, those behind it the options, with their types and defaults; its docstring is the help. All this is read from the source
(`mwlib.cli.source`): the function is imported when its command runs, so that help and mistyped words wait for no torch.
"""

import argparse
import importlib
import os
import re
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from functools import partial
from typing import Any, NoReturn

from mwlib.cli.source import GROUPS, MAINTAIN, Command, arguments, commands, names_of, settings_text
from mwlib.settings import near
from mwlib.version import __version__

ACCEPT = "take runs and results made by an older code of the library, and say so beside everything made with them"
QUIET = "show no bars"
INTERRUPTED = 130  # as shells have it


class Parser(argparse.ArgumentParser):
    """The words of one command; a mistyped choice gets a near one in place of all there are."""

    def add(self, name: str, **settings: Any) -> None:
        """As `add_argument`, which says of a choice that it is none."""
        if choices := settings.get("choices"):
            settings |= {"type": partial(_one_of, choices), "metavar": name.lstrip("-").upper()}
        self.add_argument(name, **settings)


def _one_of(choices: Sequence[str], word: str) -> str:
    """The word itself, if it is one of the choices."""
    if word not in choices:
        raise argparse.ArgumentTypeError(f"there is no {word!r}{near(word, choices) or '; expected ' + ', '.join(choices)}")
    return word


def parse(words: Sequence[str]) -> tuple[Command, dict[str, Any]]:
    """The command that words name, and what they say of its function's arguments; what is not given is left out.

    Raises:
        SystemExit: help was asked for (0), or a word is not understood (2); the message has a near one, if there is one.
    """
    known = commands()
    if not words or words[0] not in known:
        _overview(words, known)
    command = known[words[0]]
    parser = Parser(f"mwlib {words[0]}", description=" ".join(command.about.split()), argument_default=argparse.SUPPRESS)
    _fill(parser, words[0], command)
    if "--help" in words or "-h" in words:
        _help(parser, words[1:])
    given, unknown = parser.parse_known_args(words[1:])
    if unknown:
        options = [name for action in parser._actions for name in action.option_strings]
        parser.error(f"{unknown[0]!r} is not understood{near(unknown[0].partition('=')[0], options)}")
    return command, vars(given)


def _fill(parser: Parser, name: str, command: Command) -> None:
    """Words and options of a command."""
    for argument, settings in arguments(command.module, command.definition):
        parser.add(argument, **settings)
    if name.startswith("run-") or command.module.endswith((".measure", ".sample")):
        parser.add("--accept-older-code", action="store_true", help=ACCEPT)
    parser.add("--quiet", action="store_true", help=QUIET)


def _overview(words: Sequence[str], known: dict[str, Command]) -> NoReturn:
    """List the commands in groups, or say which one was meant."""
    about = "Frequency-domain human motion diffusion: data, models and notebooks."
    usage = "mwlib COMMAND ...   (mwlib COMMAND --help says what it takes)"
    parser = Parser("mwlib", usage=usage, description=about)
    parser.add("--version", action="version", version=f"mwlib {__version__}")
    for title in dict.fromkeys([*GROUPS.values(), MAINTAIN]):
        group = parser.add_argument_group(title)
        for name, command in known.items():
            if command.group == title:
                group.add_argument(f"_{name}", metavar=name, nargs="?", help=command.summary)
    if words and not words[0].startswith("-"):
        parser.exit(2, f"mwlib: there is no command {words[0]!r}{near(words[0], known)}; mwlib --help lists all\n")
    _, unknown = parser.parse_known_args(words)
    if unknown:
        meant = near(unknown[0], ["--help", "--version"])
        expected = f" is not understood{meant}" if meant else f" comes before the command; expected mwlib COMMAND {unknown[0]}"
        parser.exit(2, f"mwlib: {unknown[0]!r}{expected}\n")
    parser.print_help()
    parser.exit()


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


def _complete() -> None:
    """Answer a shell that asks which words fit, and leave; how a shell is told to ask stands in docs/howto/commands.md."""
    parser = Parser("mwlib")
    parts = parser.add_subparsers()
    for name, command in commands().items():
        _fill(part := parts.add_parser(name, help=command.summary), name, command)
        for action in part._actions:
            if fitting := FITTING.get((name, action.dest)):
                action.completer = fitting  # pyright: ignore[reportAttributeAccessIssue]  (argcomplete reads it)
    importlib.import_module("argcomplete").autocomplete(parser)


def _settings(prefix: str, parsed_args: argparse.Namespace, **_: Any) -> list[str]:
    return [f"{name}=" for name in re.findall(r"^  (\w+) = ", settings_text(parsed_args.system or "prediction"), re.M)]


def _presets(prefix: str, parsed_args: argparse.Namespace, **_: Any) -> list[str]:
    return re.findall(r"[\w-]+", re.findall(r"^Presets of \w+: (.*)", settings_text(parsed_args.system or "prediction"), re.M)[0])


FITTING = {  # what argcomplete calls for the words of an argument that takes any
    ("train", "set"): _settings,
    ("train", "preset"): _presets,
    ("train", "system"): lambda **_: names_of("mwlib.experiments.grids", "MODULES"),
}


@contextmanager
def _silent() -> Iterator[None]:
    """No bar is shown, whatever asks for one."""
    from tqdm import tqdm

    begun = tqdm.__init__
    hidden: Any = lambda bar, *given, **named: begun(bar, *given, **{**named, "disable": True})  # noqa: E731
    tqdm.__init__ = hidden
    try:
        yield
    finally:
        tqdm.__init__ = begun


@contextmanager
def _plain_warnings() -> Iterator[None]:
    """Warnings without the line of the library that gives them."""
    usual = warnings.formatwarning
    warnings.formatwarning = lambda message, *_, **__: f"mwlib: {message}\n"
    try:
        yield
    finally:
        warnings.formatwarning = usual


def main(words: Sequence[str] | None = None) -> int:
    """Run one command; 0 if all is well, 1 if not, 2 if its words are not understood, 130 if it was interrupted."""
    if "_ARGCOMPLETE" in os.environ:
        _complete()
    try:
        command, given = parse(sys.argv[1:] if words is None else words)
    except OSError as error:  # of help that nobody reads, or that finds no room
        return _lost(error)
    if given.pop("accept_older_code", False):
        os.environ["MWLIB_ACCEPT_OLDER_CODE"] = "1"  # kernels that a command starts inherit it
    quiet = given.pop("quiet", False)
    try:
        with _plain_warnings(), _silent() if quiet else nullcontext():
            return getattr(importlib.import_module(command.module), command.definition.name)(**given) or 0
    except KeyboardInterrupt:
        print("mwlib: interrupted", file=sys.stderr)
        return INTERRUPTED
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] == "mwlib":
            raise
        from mwlib.course.notebooks import to_install

        print(f"mwlib: {error}; {to_install('notebooks') or f'pip install {error.name}'} brings it", file=sys.stderr)
    except BrokenPipeError as error:
        return _lost(error)
    except (ImportError, OSError, ValueError) as error:
        print(f"mwlib: {error}", file=sys.stderr)
    return 1


def _lost(error: OSError) -> int:
    """Leave when what is printed goes nowhere; of a reader who has left nothing is said."""
    sys.stdout = open(os.devnull, "w", encoding="utf-8")  # else Python flushes the rest at its end, and fails again
    if not isinstance(error, BrokenPipeError):
        print(f"mwlib: {error}", file=sys.stderr)
    return 1

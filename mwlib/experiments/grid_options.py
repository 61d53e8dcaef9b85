"""What commands about grids and settings share on the command line. It imports no torch, for commands that only start others."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

from mwlib.experiments.grids import Grid, grids_file, read_grids
from mwlib.experiments.systems import system
from mwlib.settings import Settings, parse_changes


def add_set(parser: ArgumentParser) -> None:
    """The option that changes settings."""
    text = "change one setting, e.g. data=my/folder or lr=1e-3; may be repeated"
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help=text)


def grid_options(parser: ArgumentParser) -> None:
    """The options of every command about one grid."""
    parser.add_argument("--preset", default="tiny", help="default: tiny")
    parser.add_argument("--data", default="", help="a source that load_motions reads; default: the preset's own")
    add_set(parser)
    parser.add_argument("--grids", type=Path, default=grids_file(), help="default: figures/grids.yaml")
    parser.add_argument("--out", type=Path, required=True, help="folder for the results")


def chosen_grid(args: Namespace) -> Grid:
    """The grid that a command names.

    Raises:
        ValueError: there is none of that name; the message lists those there are.
    """
    known = read_grids(args.grids)
    if args.grid not in known:
        raise ValueError(f"grid is {args.grid!r}; {args.grids} has {', '.join(known)}")
    return known[args.grid]


def given_changes(args: Namespace) -> dict[str, Any]:
    """What a command's options change in the preset."""
    return ({"data": args.data} if args.data else {}) | parse_changes(args.set)


def configuration(grid: Grid, args: Namespace) -> Settings:
    """The configuration that the rows of a grid change."""
    return system(grid.system).Config.preset(args.preset, **given_changes(args))

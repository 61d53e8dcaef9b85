"""The commands write-synthetic and fetch."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from pathlib import Path

from mwlib.data.collections import COLLECTIONS
from mwlib.data.collections.record import Collection
from mwlib.data.fetching import brought, fetch, overview
from mwlib.data.formats.h36m import write_h36m
from mwlib.data.load import data_folder
from mwlib.synthetic.motions import synthetic_motions


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add this module's subcommands."""
    write = subparsers.add_parser(
        "write-synthetic",
        help="write the synthetic motions in the Human3.6M layout",
        description="Write the synthetic motions as an .npz file laid out like VideoPose3D's data_3d_h36m.npz (32 joints, "
        "metres, z up, 50 Hz), for programs that read only that.",
    )
    write.add_argument("path", metavar="PATH", help="the .npz file to write")
    write.add_argument("--seed", type=int, default=0, help="seed of the generator (default 0)")
    write.set_defaults(run=_write)
    get = subparsers.add_parser(
        "fetch",
        help="download published motions, such as the CMU clips behind the committed tables",
        description="Download a published collection of motions from its publisher, or say how people get it. What has been "
        "brought is checked, stays, and is not asked for again: after a failure the same command goes on. Without a name: list "
        "the collections with size and licence, and what is there.",
    )
    get.add_argument("name", nargs="?", choices=COLLECTIONS, metavar="NAME", help=f"one of {', '.join(COLLECTIONS)}")
    get.add_argument("--to", type=Path, metavar="FOLDER", help="the folder of data (default: MWLIB_DATA, else a folder of yours)")
    get.add_argument("--accept-licence", action="store_true", help="you have read and accept the licence; else you are asked")
    get.set_defaults(run=_fetch)


def _write(arguments: argparse.Namespace) -> int:
    motions = synthetic_motions(seed=arguments.seed)
    write_h36m(arguments.path, motions)
    print(f"{arguments.path}: {len(motions)} clips by {len({m.subject for m in motions})} subjects")
    return 0


def _fetch(arguments: argparse.Namespace) -> int:
    to = (arguments.to.expanduser() if arguments.to else data_folder()).absolute()
    if arguments.name is None:
        _print_overview(to)
        return 0
    collection = COLLECTIONS[arguments.name]
    download = collection.download
    if download is None:
        _print_steps(collection, to)
        return 0
    if download.terms:
        print(download.terms)
        if not (arguments.accept_licence or _accepts()):
            print(
                "mwlib: nothing was downloaded; whoever accepts the licence says so, or gives --accept-licence", file=sys.stderr
            )
            return 1
    folder = fetch(arguments.name, to, accepted=True)
    print(f"{folder}: {brought(collection, folder)[0]} files, checked")
    print(f"next: {_before(to)}mwlib check-data {collection.place}")
    if collection.preset:
        print(f"      {_before(to)}mwlib train --preset {collection.preset}")
    print(download.asked)
    return 0


def _accepts() -> bool:
    return sys.stdin.isatty() and input("Do you accept this licence? [yes/no] ").strip().lower() in ("y", "yes")


def _before(to: Path) -> str:
    """What a command must be told to find data in a folder."""
    return "" if to == data_folder().absolute() else f"MWLIB_DATA={shlex.quote(str(to))} "


def _print_overview(to: Path) -> None:
    rows = overview(to)
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    for row in rows:
        print("  ".join(word.ljust(width) for word, width in zip(row, widths, strict=True)).rstrip())
    said = "" if os.environ.get("MWLIB_DATA") else " (MWLIB_DATA is not set)"
    print(f"\nThe folder of data is {to}{said}. mwlib fetch NAME brings a collection there; --to FOLDER another one.")


def _print_steps(collection: Collection, to: Path) -> None:
    print(f"{collection.title}\nlicence: {collection.licence}\nNo program can download it. By hand:")
    steps = (*collection.steps, f"put it at {to / collection.place}")
    print("\n".join(f"  {number}. {step}" for number, step in enumerate(steps, 1)))
    print(f"then: {_before(to)}mwlib check-data {collection.preset or collection.place}")

"""Commands about data: check-data, write-synthetic."""

from __future__ import annotations

import argparse

from mwlib.data.check import check_data
from mwlib.data.formats.h36m import write_h36m
from mwlib.data.synthetic.script import synthetic_motions


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add this module's subcommands."""
    check = subparsers.add_parser(
        "check-data",
        help="say what is in motion data, beside what is known about it",
        description="Read a file or folder of motions and print clips, subjects, actions, body height, windows at the papers' "
        "protocol, bone lengths and glitches, beside published counts. Exit status 1 if a file cannot be read.",
    )
    check.add_argument("path", metavar="PATH", help="file or folder (in the working folder or under MWLIB_DATA), or 'synthetic'")
    check.set_defaults(run=_check)
    write = subparsers.add_parser(
        "write-synthetic",
        help="write the synthetic motions in the Human3.6M layout",
        description="Write the synthetic motions as an .npz file laid out like VideoPose3D's data_3d_h36m.npz (32 joints, "
        "metres, z up, 50 Hz), for programs that read only that.",
    )
    write.add_argument("path", metavar="PATH", help="the .npz file to write")
    write.add_argument("--seed", type=int, default=0, help="seed of the generator (default 0)")
    write.set_defaults(run=_write)


def _check(arguments: argparse.Namespace) -> int:
    report, is_whole = check_data(arguments.path)
    print(report)
    return 0 if is_whole else 1


def _write(arguments: argparse.Namespace) -> int:
    motions = synthetic_motions(seed=arguments.seed)
    write_h36m(arguments.path, motions)
    print(f"{arguments.path}: {len(motions)} clips by {len({m.subject for m in motions})} subjects")
    return 0

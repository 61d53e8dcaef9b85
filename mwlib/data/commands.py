"""The command write-synthetic."""

from __future__ import annotations

import argparse

from mwlib.data.formats.h36m import write_h36m
from mwlib.data.synthetic.script import synthetic_motions


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add this module's subcommand."""
    write = subparsers.add_parser(
        "write-synthetic",
        help="write the synthetic motions in the Human3.6M layout",
        description="Write the synthetic motions as an .npz file laid out like VideoPose3D's data_3d_h36m.npz (32 joints, "
        "metres, z up, 50 Hz), for programs that read only that.",
    )
    write.add_argument("path", metavar="PATH", help="the .npz file to write")
    write.add_argument("--seed", type=int, default=0, help="seed of the generator (default 0)")
    write.set_defaults(run=_write)


def _write(arguments: argparse.Namespace) -> int:
    motions = synthetic_motions(seed=arguments.seed)
    write_h36m(arguments.path, motions)
    print(f"{arguments.path}: {len(motions)} clips by {len({m.subject for m in motions})} subjects")
    return 0

"""The command inbetween: motions between frames of a file, as BVH files."""

from __future__ import annotations

import sys
from argparse import Namespace, _SubParsersAction
from pathlib import Path

from mwlib.body.motion import Motion
from mwlib.data import load_motions
from mwlib.data.formats.bvh_writing import write_bvh
from mwlib.experiments.data_commands import add_statements, statements
from mwlib.experiments.runs import load_run
from mwlib.experiments.sampling import INBETWEENING_MODEL, inbetween

_TEXT = (
    "Read one motion file, or two. Between two or more frames of the one (--keyframes), or the last frame of the first and the "
    "first frame of the second (--between), sample motions that meet these poses, and write each as a BVH file that Blender "
    "opens. Frames are counted at the model's rate. A model that was given a past also looks at those before the first pose. "
    "A model of rotations keeps the file's skeleton; the model that comes with the package has places of 17 joints, to which "
    "known skeletons are carried over."
)


def add_parser(subparsers: _SubParsersAction) -> None:
    """Register this module's command."""
    parser = subparsers.add_parser("inbetween", help="sample motions between given poses, as BVH files", description=_TEXT)
    parser.add_argument("start", metavar="FILE", help="motion whose frames are the keyframes, or that ends in the first")
    parser.add_argument("end", metavar="FILE", nargs="?", help="motion that begins with the last keyframe")
    parser.add_argument("--keyframes", type=int, nargs="+", metavar="FRAME", help="of the one file, rising, from 0")
    parser.add_argument("--between", type=int, metavar="N", help="frames between two files' poses (default: the model's own)")
    parser.add_argument(
        "--run", dest="run_name", default=INBETWEENING_MODEL, help="folder of a finished run (default: the shipped model)"
    )
    add_statements(parser)
    parser.add_argument("--samples", type=int, default=3, help="motions (default 3)")
    parser.add_argument("--seed", type=int, default=0, help="of their noise (default 0)")
    parser.add_argument("--out", type=Path, default=Path("build/bvh"), help="folder; default: build/bvh")
    parser.set_defaults(run=_run)


def _one(path: str, args: Namespace) -> Motion:
    motions = load_motions(path, **statements(args))
    if len(motions) != 1:
        raise ValueError(f"{path} holds {len(motions)} motions; expected a file with one")
    return motions[0]


def _run(args: Namespace) -> int:
    if (args.end is None) != (args.keyframes is not None):
        raise ValueError("expected either one file and --keyframes, or two files")
    start = _one(args.start, args)
    end = args.keyframes if args.end is None else _one(args.end, args)
    bridge = load_run(args.run_name)
    found = inbetween(start, end, args.between, args.samples, args.seed, bridge, progress=sys.stderr.isatty())
    name = Path(args.start).name.split(".")[0]
    for number, motion in enumerate(found, 1):
        file = args.out / f"{name}_between_{number}.bvh"
        away = write_bvh(motion, file)
        print(f"{file}: {len(motion)} frames at {motion.fps:g} Hz; joints {1000 * away.mean:.1f} mm from the sampled ones")
    return 0

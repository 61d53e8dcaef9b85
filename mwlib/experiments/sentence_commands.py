"""The command generate: motions from sentences, as BVH files."""

from __future__ import annotations

import re
import sys
from argparse import Namespace, _SubParsersAction
from pathlib import Path

from mwlib.data.formats.bvh_writing import write_bvh
from mwlib.experiments.sampling import SENTENCE_MODEL, generate

_TEXT = (
    "Sample motions that do what a sentence says, and write each as a BVH file that Blender opens. The model that comes with the "
    "package has learnt from synthetic people: they walk, run, turn, jump, wave, kick, sit and reach."
)


def add_parser(subparsers: _SubParsersAction) -> None:
    """Register this module's command."""
    parser = subparsers.add_parser("generate", help="motions from sentences, as BVH files", description=_TEXT)
    parser.add_argument("texts", metavar="SENTENCE", nargs="+", help="in quotes")
    parser.add_argument("--seconds", type=float, default=4.0, help="length of each motion (default 4)")
    parser.add_argument("--samples", type=int, default=1, help="motions of each sentence (default 1)")
    parser.add_argument("--seed", type=int, default=0, help="of their noise (default 0)")
    parser.add_argument(
        "--run", dest="run_name", default=SENTENCE_MODEL, help="folder of a finished run (default: the shipped model)"
    )
    parser.add_argument(
        "--plain",
        action="store_true",
        help="read the joints' places alone, as the field does; the default reads their steps, too",
    )
    parser.add_argument("--out", type=Path, default=Path("build/bvh"), help="folder; default: build/bvh")
    parser.set_defaults(run=_run)


def _run(args: Namespace) -> int:
    found = generate(
        args.texts, args.seconds, args.samples, args.seed, args.run_name, progress=sys.stderr.isatty(), fused=not args.plain
    )
    for number, motion in enumerate(found, 1):
        file = args.out / f"{number:02d}_{_stem(motion.name)}.bvh"
        away = write_bvh(motion, file)
        print(f"{file}: {len(motion)} frames at {motion.fps:g} Hz; joints {1000 * away.mean:.1f} mm from the sampled ones")
    return 0


def _stem(sentence: str) -> str:
    """A file name from a sentence."""
    return "_".join(re.findall(r"[a-z0-9]+", sentence.lower()))[:60] or "motion"

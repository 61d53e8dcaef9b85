"""The command check-data, and the options that say what the numbers of motion files mean."""

from __future__ import annotations

import io
from argparse import ArgumentParser, Namespace, _SubParsersAction
from pathlib import Path
from typing import Any

from mwlib import plots
from mwlib.data.check import check_data
from mwlib.data.collections import SKELETONS
from mwlib.data.meaning import UNITS
from mwlib.files import write_atomic


def add_parser(subparsers: _SubParsersAction) -> None:
    """Register this module's command."""
    parser = subparsers.add_parser(
        "check-data",
        help="say what is in motion data, what will be left out of training and what looks wrong",
        description="Read a file or folder of motions. Print a table of its kinds of files with rate, skeleton, up-axis and "
        "unit, and who said so; windows, bones and published counts of each kind; what training will leave out; what looks "
        "wrong. Exit status 1 if a file cannot be read.",
    )
    parser.add_argument("path", metavar="PATH", help="file or folder (in the working folder or under MWLIB_DATA), or 'synthetic'")
    add_statements(parser)
    windows = "of the windows that training will cut; default: as in the papers, "
    parser.add_argument("--fps", type=float, help=f"frames per second {windows}50, for HumanEva-I 60")
    parser.add_argument("--history", type=int, help=f"observed frames {windows}25, 15")
    parser.add_argument("--future", type=int, help=f"predicted frames {windows}100, 60")
    parser.add_argument("--picture", type=Path, metavar="FILE.png", help="also draw one clip, with axes in metres")
    parser.add_argument("--clip", default="", metavar="NAME", help="which clip to draw (default: the first)")
    parser.set_defaults(run=_check)


def add_statements(parser: ArgumentParser) -> None:
    """Options that state what files do not say, or say wrongly; see `statements`."""
    parser.add_argument("--unit", help=f"metres per unit of the files, or one of {', '.join(UNITS)} (default: as they say)")
    parser.add_argument("--up", choices=("y", "z"), help="the axis that points up in the files (default: as they say)")
    parser.add_argument("--file-fps", type=float, help="frames per second of the files (default: as they say)")
    parser.add_argument("--skeleton", help=f"of arrays that state none: one of {', '.join(SKELETONS)}")


def statements(args: Namespace) -> dict[str, Any]:
    """What the options of `add_statements` say, as arguments of `load_motions`."""
    return {name: getattr(args, name) for name in ("unit", "up", "file_fps", "skeleton")}


def _check(args: Namespace) -> int:
    for name in ("fps", "history", "future"):
        value = getattr(args, name)
        if value is not None and not 0 < value < float("inf"):
            raise ValueError(f"{name} is {value}; expected a positive number")
    if args.picture and args.picture.suffix.lower() != ".png":
        raise ValueError(f"picture is {args.picture}; expected a name that ends in .png")
    check = check_data(args.path, fps=args.fps, history=args.history, future=args.future, **statements(args))
    print(check.report)
    if args.picture and check.clips:
        named = [clip for clip in check.clips if args.clip in (clip.name, clip.reading.motion.name, "")]
        if not named:
            raise ValueError(f"clip is {args.clip!r}; expected one of {', '.join(clip.name for clip in check.clips[:20])} ...")
        fig, _ = plots.filmstrip(named[0].reading.motion)
        picture = io.BytesIO()
        with plots.style():
            fig.savefig(picture, format="png")
        write_atomic(args.picture, picture.getvalue())
        print(f"{args.picture}: {named[0].name}")
    return 0 if check.is_whole else 1

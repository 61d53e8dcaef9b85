"""Commands on data: check-data, write-synthetic, fetch."""

import io
import os
import shlex
import sys
from json import dumps
from pathlib import Path
from typing import Any

from mwlib import plots
from mwlib.cli.options import expect_ending
from mwlib.data import check as checking
from mwlib.data import fetching
from mwlib.data.collections import COLLECTIONS
from mwlib.data.formats.h36m import write_h36m
from mwlib.data.load import data_folder
from mwlib.experiments.outlook import outlook
from mwlib.files import write_atomic
from mwlib.settings import whole
from mwlib.synthetic.motions import synthetic_motions


def check_data(
    path: str,
    *,
    fps: float | None = None,
    history: int | None = None,
    future: int | None = None,
    picture: Path | None = None,
    clip: str = "",
    json: bool = False,
    **meaning: Any,
) -> int:
    """Say what is in motion data, what will be left out of training and what looks wrong.

    Read a file or folder of motions. Print a table of its kinds of files with rate, skeleton, up-axis and unit, and who said so;
    windows, bones and published counts of each kind; what training will leave out; what looks wrong; and what each system would
    make of the bodies. Of a folder laid out as HumanML3D or KIT-ML: splits, captions, parts of speech, lengths and statistics in
    place of windows, unless fps, history or future is given. Exit status 1 if something needs a repair or a word of yours: a
    file that cannot be read, a row of clips.csv without a file, faults of lists, captions and statistics, an up-axis or a rate
    that was likely assumed wrongly.

    Args:
        path: file or folder (in the working folder or under MWLIB_DATA), or 'synthetic'.
        fps: frames per second of the windows that training will cut (default: as in the papers, 50, for HumanEva-I 60).
        history: observed frames of the windows that training will cut (default: as in the papers, 25, 15).
        future: predicted frames of the windows that training will cut (default: as in the papers, 100, 60).
        picture: also draw one clip into this .png file, with axes in metres.
        clip: which clip to draw (default: the first).
        json: print JSON: the report, whether all is well, and each clip with what it was taken for and who says so.
    """
    for name, value in (("fps", fps), ("history", history), ("future", future)):
        if value is not None and not 0 < value < float("inf"):
            raise ValueError(f"{name} is {value}; expected a positive number")
    if picture:
        expect_ending("picture", picture, ".png")
    check = checking.check_data(path, fps=fps, history=history, future=future, **meaning)
    ahead = outlook(path, [each.reading.motion for each in check.clips], fps) if check.clips or not check.is_whole else []
    if json:
        clips = [_about(each) for each in check.clips]
        print(dumps({"ok": check.is_whole, "clips": clips, "training": ahead, "report": check.report}, indent=1))
    else:
        print(check.report)
        if ahead:
            print("\n  ".join(["\ntraining, at default settings:", *ahead]))
    if picture and check.clips:
        named = [each for each in check.clips if clip in (each.name, each.reading.motion.name, "")]
        if not named:
            raise ValueError(f"clip is {clip!r}; expected one of {', '.join(each.name for each in check.clips[:20])} ...")
        drawn = io.BytesIO()
        with plots.style():
            plots.filmstrip(named[0].reading.motion)[0].savefig(drawn, format="png")
        write_atomic(picture, drawn.getvalue())
        print(f"{picture}: {named[0].name}", file=sys.stderr if json else sys.stdout)
    return 0 if check.is_whole else 1


def _about(clip: checking.Clip) -> dict[str, Any]:
    """A clip as a JSON value."""
    read, motion = clip.reading, clip.reading.motion
    stated = {"metres_per_unit": read.unit, "up": read.up, "fps": read.fps, "first_frame": read.first}
    return {
        "name": clip.name, "file": clip.file and str(clip.file), "subject": motion.subject, "action": motion.action,
        "skeleton": motion.skeleton.name, "joints": len(motion.skeleton.joints), "frames": len(motion),
        **{name: {"value": each.value, "source": each.source} for name, each in stated.items()},
    }  # fmt: skip


def write_synthetic(path: Path, *, seed: int = 0) -> None:
    """Write the synthetic motions in the Human3.6M layout.

    The file is laid out like VideoPose3D's data_3d_h36m.npz (32 joints, metres, z up, 50 Hz), for programs that read only that.

    Args:
        path: the .npz file to write.
        seed: seed of the generator.
    """
    expect_ending("path", path, ".npz")
    motions = synthetic_motions(seed=whole("seed", seed))
    write_h36m(path, motions)
    print(f"{path}: {len(motions)} clips by {len({m.subject for m in motions})} subjects")


def fetch(name: str | None = None, *, to: Path | None = None, accept_licence: bool = False) -> int:
    """Download published motions, such as the CMU clips behind the committed tables.

    Download a published collection of motions from its publisher, or say how people get it. What has been brought is checked,
    stays, and is not asked for again: after a failure the same command goes on. Without a name: list the collections with
    size and licence, and what is there.

    Args:
        name: one of `mwlib.data.collections.Collection`.
        to: the folder of data (default: MWLIB_DATA, else a folder of yours).
        accept_licence: you have read and accept the licence; else you are asked.
    """
    to = (to.expanduser() if to else data_folder()).absolute()
    before = "" if to == data_folder().absolute() else f"MWLIB_DATA={shlex.quote(str(to))} "  # what other commands must be told
    if name is None:
        _print_overview(to)
        return 0
    collection, download = COLLECTIONS[name], COLLECTIONS[name].download
    if download is None:
        print(f"{collection.title}\nlicence: {collection.licence}\nNo program can download it. By hand:")
        for number, step in enumerate([*collection.steps, f"put it at {to / collection.place}"], 1):
            print(f"  {number}. {step}")
        print(f"then: {before}mwlib check-data {collection.preset or collection.place}")
        return 0
    if download.terms:
        print(download.terms)
        if not (accept_licence or _accepts()):
            print(
                "mwlib: nothing was downloaded; whoever accepts the licence says so, or gives --accept-licence", file=sys.stderr
            )
            return 1
    folder = fetching.fetch(name, to, accepted=True)
    print(f"{folder}: {fetching.brought(collection, folder)[0]} files, checked")
    print(f"next: {before}mwlib check-data {collection.place}")
    if collection.preset:
        print(f"      {before}mwlib train --preset {collection.preset}")
    print(download.asked)
    return 0


def _accepts() -> bool:
    return sys.stdin.isatty() and input("Do you accept this licence? [yes/no] ").strip().lower() in ("y", "yes")


def _print_overview(to: Path) -> None:
    print(*checking.in_columns(fetching.overview(to)), sep="\n")
    said = "" if os.environ.get("MWLIB_DATA") else " (MWLIB_DATA is not set)"
    print(f"\nThe folder of data is {to}{said}. mwlib fetch NAME brings a collection there; --to FOLDER another one.")

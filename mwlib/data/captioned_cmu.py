"""CMU's motion capture with captions, as features of HumanML3D: real people and real sentences, few of them."""

import csv
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from mwlib.body.motion import Motion
from mwlib.body.skeleton import HUMANML22
from mwlib.data.formats.humanml import HUMANML3D, CaptionedClip
from mwlib.data.formats.humanml_encoding import Heading, features_of, with_bones
from mwlib.data.load import data_folder, motion_files, read_motion_file
from mwlib.data.meaning import clips_row
from mwlib.data.untrusted import SMALL_TEXT, MotionFormatError, read_text

FOLDER, CAPTIONS = "cmu/asfamc", "captions_cmu.csv"
TEST, VAL = ("2", "7", "29"), ("1",)  # subjects; all others are for training
LONGEST = 196  # rows of features of one clip, as HumanML3D has it
FASTEST = 12.0  # metres a second from frame to frame at 20 Hz, of any joint; dancers reach 10.7, faster ones are glitches


def captioned_cmu(
    folder: Path | None = None, subjects: Collection[str] | None = None, heading: Heading = "correct"
) -> list[CaptionedClip]:
    """CMU's clips on HumanML3D's one body, at 20 Hz, as features; split by person.

    Captions are KIT-ML's, where captions_cmu.csv has some for the trial, then CMU's own words for it: keywords rather than
    sentences. A trial of more than 196 rows is cut into as few pieces as will do, of one length to a row, each with the
    captions of the whole; `attributes` say "part" (from 1) of how many "parts". Shorter than 40 rows, without any words or with
    a joint that jumps: left out. Subjects 2, 7 and 29 are for testing, 1 for validation. Own choice, all of it.

    Args:
        folder: with cmu/asfamc and, if there, captions_cmu.csv; None: the folder of data.
        subjects: only these people, such as "7"; None: all.
        heading: as in `features_of`.

    Raises:
        MotionFormatError: a file cannot be read.
    """
    folder = data_folder() if folder is None else folder
    spoken = _kit_captions(folder / CAPTIONS)
    clips: list[CaptionedClip] = []
    for file in motion_files(folder / FOLDER):
        row, _ = clips_row(file)
        if subjects is not None and row.get("subject") not in subjects:
            continue
        own = row.get("description") or row.get("action")
        captions = (*spoken.get(file.relative_to(folder).as_posix().removesuffix(".xz"), ()), *([own] if own else []))
        if captions:
            clips += _pieces(read_motion_file(file)[0], captions, heading)
    return clips


def _kit_captions(file: Path) -> dict[str, list[str]]:
    """Captions by the trial's path, packing left out; none if there is no such file."""
    if not file.is_file():
        return {}
    found: dict[str, list[str]] = {}
    for n, row in enumerate(csv.DictReader(read_text(file, SMALL_TEXT).splitlines()), 2):
        path, caption = row.get("clip_file"), row.get("caption")
        if not path or not caption:
            raise MotionFormatError(file, f"line {n}", str(row)[:80], "columns clip_file and caption, both filled")
        found.setdefault(path.removesuffix(".xz"), []).append(caption.strip())
    return found


def _pieces(motion: Motion, captions: tuple[str, ...], heading: Heading) -> Iterator[CaptionedClip]:
    at_20 = replace(motion, rig=None).with_up("y").retarget(HUMANML22).resample(HUMANML3D.fps)
    positions = with_bones(at_20.positions)
    rows = len(positions) - 1
    speed = np.linalg.norm(np.diff(positions, axis=0), axis=-1) * HUMANML3D.fps
    if rows < HUMANML3D.shortest or speed.max() > FASTEST:
        return
    count = -(-rows // LONGEST)
    ends = np.linspace(0, rows, count + 1).round().astype(int)
    split = "test" if motion.subject in TEST else "val" if motion.subject in VAL else "train"
    for part, (start, stop) in enumerate(zip(ends, ends[1:], strict=False), 1):
        name = motion.name if count == 1 else f"{motion.name} part {part}"
        attributes = {"subject": motion.subject, "kind": motion.action, "part": float(part), "parts": float(count)}
        features = features_of(positions[start : stop + 1], HUMANML3D, heading)
        yield CaptionedClip(features, captions, name, split, attributes)

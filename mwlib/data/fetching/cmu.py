"""The CMU clips behind our tables, from their publisher."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path

from tqdm import tqdm

from mwlib.data.fetching.download import Patience, download
from mwlib.data.fetching.errors import FetchError, NotOfferedError
from mwlib.data.fetching.lists import Listed, at, listed, motion_fault, table_text
from mwlib.data.fetching.workplace import in_turn, progress, workplace
from mwlib.data.formats.asf_amc import read_asf
from mwlib.data.meaning import clips_row
from mwlib.data.untrusted import MotionFormatError
from mwlib.files import write_atomic

URL = "http://mocap.cs.cmu.edu/subjects"
FOLDER = "cmu/asfamc"
MOST = 40_000_000  # bytes of one file; the longest listed has 2 million
MOST_FAULTS = 5  # clips that the publisher does not have as listed, before nothing more is asked of it


def fetch_cmu(to: Path, url: str = URL, patience: Patience = Patience(), clips: Sequence[Listed] | None = None) -> Path:  # noqa: B008
    """Bring the listed clips, their skeletons and a clips.csv with subjects, actions and rates into to/cmu/asfamc.

    One file after another. A clip gets its name only after what is read from it was found to be the listed motion; those that
    are there, plain or packed, are checked in the same way and stay.

    Args:
        to: where data lie; MWLIB_DATA, if the preset `cmu` is to find them.
        url: where folders of subjects lie: 05/05.asf, 05/05_01.amc.
        clips: other clips than those listed; for tests.

    Returns:
        The folder, which `load_motions` reads.

    Raises:
        FetchError: no connection, or clips that the publisher does not have as listed; the others have been brought.
        PermissionError: nothing can be written there.
    """
    clips, folder = listed("cmu") if clips is None else clips, to / FOLDER
    if _missing(folder, clips) or not _labelled(folder, clips):
        with workplace(to, "cmu") as staging:
            _label(folder, clips)
            missing = _missing(folder, clips)  # another process may have been here
            with progress("CMU clips", len(clips)) as bar:
                bar.update(len(clips) - len(missing))
                faults = list(_bring(missing, folder, staging, url, patience, bar))
            if faults:
                raise FetchError("\n  ".join([f"{len(faults)} of {len(clips)} clips could not be had as listed:", *faults]))
    return folder


def _missing(folder: Path, clips: Sequence[Listed]) -> list[Listed]:
    """Clips that are not there, or not as listed."""
    return [
        clip for clip in in_turn(clips, "checking clips") if (file := at(folder, clip.file)) is None or motion_fault(file, clip)
    ]


def _labelled(folder: Path, clips: Sequence[Listed]) -> bool:
    """Whether a clips.csv, of this folder or above, says of each clip what the list says."""
    rows = [clips_row(folder / clip.file)[0] for clip in clips]
    said = [(row.get("subject"), row.get("action"), row.get("fps")) for row in rows]
    return said == [(clip.subject, clip.action, f"{clip.fps:g}") for clip in clips]


def _label(folder: Path, clips: Sequence[Listed]) -> None:
    table = folder / "clips.csv"
    if _labelled(folder, clips):
        return
    if table.exists():
        raise FetchError(f"{table} says other things of the clips than the list that came with mwlib; move it away")
    rows = [(clip.file, f"{clip.fps:g}", clip.subject, clip.action) for clip in clips]
    write_atomic(table, table_text(("file", "fps", "subject", "action"), rows))


def _bring(clips: Sequence[Listed], folder: Path, staging: Path, url: str, patience: Patience, bar: tqdm) -> Iterator[str]:
    """Download clips, subject by subject; why some cannot be had."""
    faults = 0
    for subject, group in groupby(clips, lambda clip: clip.file.split("/")[0]):
        asf = f"{subject}/{subject}.asf"
        _get(f"{url}/{asf}", staging / asf, _skeleton_fault, patience)
        for clip in group:
            part = staging / clip.file
            try:
                _get(f"{url}/{clip.file}", part, lambda file, clip=clip: motion_fault(file, clip), patience)
            except NotOfferedError as error:
                yield str(error)
                if (faults := faults + 1) == MOST_FAULTS:
                    return
                continue
            content = {folder / asf: (staging / asf).read_bytes(), folder / clip.file: part.read_bytes()}
            for file, new in content.items():
                if not file.exists() or file.read_bytes() != new:
                    write_atomic(file, new)
            part.unlink()
            bar.update()


def _get(url: str, part: Path, check, patience: Patience) -> None:
    part.parent.mkdir(exist_ok=True)
    download(url, part, check, most=MOST, patience=patience)
    time.sleep(patience.between)


def _skeleton_fault(file: Path) -> str:
    try:
        read_asf(file)
    except MotionFormatError as error:
        return f"it cannot be read: {error}"
    return ""

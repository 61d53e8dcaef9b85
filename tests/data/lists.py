"""Lists of the clips that `mwlib fetch` brings, made from a folder of the very files."""

from __future__ import annotations

import csv
import io
import sys
from pathlib import Path

from mwlib.data.collections import Listed, list_file
from mwlib.data.fetching import motion_digest
from mwlib.data.load import motion_files, read_motion_file
from mwlib.data.untrusted import bare_name, read_bytes
from mwlib.files import write_atomic
from mwlib.hashing import sha256


def clips_of(folder: Path) -> list[Listed]:
    """The clips of a folder as they would be listed."""
    clips = []
    for file in motion_files(folder):
        (motion,) = read_motion_file(file)
        place = file.relative_to(folder).with_name(bare_name(file)).as_posix()
        about = (place, motion.subject, motion.action, motion.fps, len(motion), motion_digest(motion))
        clips.append(Listed(*about, sha256([read_bytes(file)])))
    return clips


def write_list(name: str, folder: Path) -> None:
    """Make a collection's list again; CONTRIBUTING.md says when."""
    text = io.StringIO()
    rows = [(*clip[:3], f"{clip.fps:g}", *clip[4:]) for clip in clips_of(folder)]
    csv.writer(text, lineterminator="\n").writerows([Listed._fields, *rows])
    write_atomic(list_file(name), text.getvalue())


if __name__ == "__main__":
    write_list(sys.argv[1], Path(sys.argv[2]))

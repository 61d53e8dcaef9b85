"""Real clips, read once by all that look at them."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from mwlib import Motion
from mwlib.data.load import motion_files, read_motion_file

FOLDERS = ("cmu/asfamc", "cmu/bvh", "cmu_benchmark", "lafan1", "bandai_namco")


@cache
def real_clips(data_folder: Path) -> dict[str, Motion]:
    """File (relative to the data folder) -> motion."""
    files = [file for folder in FOLDERS for file in motion_files(data_folder / folder)]
    return {str(file.relative_to(data_folder)): read_motion_file(file)[0] for file in files}

"""Every notebook runs with other parameters than its own, and leaves the exhibits that the manifest promises."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from mwlib.course.files import course
from mwlib.course.manifest import read_manifest
from mwlib.course.parameters import read_parameters
from mwlib.course.worker import run_notebook


@pytest.mark.parametrize("path", course(), ids=lambda path: path.stem)
def test_notebook_runs_with_other_parameters(path, tmp_path):
    given = {"data": "synthetic"}  # by name, not by the preset
    offered = read_parameters(json.loads(path.read_text(encoding="utf-8")))
    assert all(offered[name].default != value for name, value in given.items())
    folder = run_notebook(path, tmp_path, given)
    for row in read_manifest():
        if row.notebook == path.stem and row.status == "made":
            seeded = bool({"seed", "seeds"} & set(offered))
            check_exhibit({kind: folder / f"{row.stem}.{kind}" for kind in row.files}, seeded)


def check_exhibit(files: dict[str, Path], seeded: bool) -> None:
    """All files are there, the picture is described, and the provenance names what the exhibit depends on."""
    assert all(file.stat().st_size > 0 for file in files.values())
    about = set(json.loads(files["json"].read_text()))
    assert {"data", "preset"} <= about and (not seeded or {"seed", "seeds"} & about), files["json"]
    if "txt" in files:
        assert len(files["txt"].read_text()) > 20, files["txt"]

"""A clone, data and an output folder of any name: make and the workflow take names for names, and run nothing of them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import matplotlib
import yaml

from tests.sample_notebooks import NASTY, bare, save

ROOT = Path(__file__).parents[2]
NAME = f"02_{NASTY.replace('{level}', '')}"  # of a notebook: anything but braces
EXHIBIT = {
    "id": "t", "kind": "table", "caption": "c", "notebook": NAME, "stem": "t", "files": ["csv", "json"], "data": "d",
    "status": "made",
}  # fmt: skip
TABLE = "import pathlib\nfor end, text in (('csv', data), ('json', '{}')):\n    pathlib.Path(out, f't.{end}').write_text(text)"


def clone(folder: Path) -> Path:
    """A course of one notebook, with a .venv that stands for the one that the tests run in."""
    shutil.copytree(ROOT / "mwlib", folder / "mwlib", ignore=shutil.ignore_patterns("__pycache__", "_material"))
    for name in ("Makefile", "Snakefile", "pyproject.toml", "constraints.txt"):
        shutil.copy(ROOT / name, folder)
    (folder / "figures").mkdir()
    (folder / "figures" / "grids.yaml").write_text("grids: {}")
    (folder / "figures" / "manifest.yaml").write_text(yaml.safe_dump({"exhibits": [EXHIBIT]}))
    save(bare(TABLE), folder / "notebooks", EXHIBIT["notebook"])
    save(bare(), folder / "notebooks", "experiment")
    python = folder / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    python.chmod(0o755)
    (folder / ".venv" / ".ready").touch()
    return folder


def test_make_takes_any_name(tmp_path):
    folder = clone(tmp_path / NASTY)
    (folder / f"{NASTY}.yaml").write_text("grids: {}")
    environment = {name: value for name, value in os.environ.items() if name not in ("MWLIB_RUNS", "MWLIB_DATA")}
    environment |= {"XDG_CACHE_HOME": str(tmp_path / "cache"), "MPLCONFIGDIR": matplotlib.get_cachedir(), "PYTHON": "false"}
    words = [f"DATA=data {NASTY}.npz", f"OUT=out {NASTY}", f"GRIDS={NASTY}.yaml", "SET=test_windows=3"]
    for target in ("figures", "grids"):
        done = subprocess.run(["make", target, *words], cwd=folder, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    out = folder / f"out {NASTY}"
    page = (out / "index.html").read_text()
    assert "not finished" not in page and "Not in this build" not in page
    link = "02_a%20%20%27b%27%20%22c%22%20%23d%3Be%3F%24%28touch%20X%29"
    assert f'href="{link}/notebook.html"' in page and f'href="{link}/t.csv"' in page
    assert (out / NAME / "t.csv").read_text() == f"data {NASTY}.npz"
    assert not [*tmp_path.rglob("X")]


def test_what_make_is_told_is_not_expanded(tmp_path):
    """Not by make, which would run $(shell ...), and not by the shell."""
    (tmp_path / ".venv").mkdir()
    for name in ("pyproject.toml", "constraints.txt", ".venv/.ready"):
        (tmp_path / name).touch()
    shutil.copy(ROOT / "Makefile", tmp_path)
    alone = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MAKELEVEL", "MFLAGS")}
    evil = "$(shell touch X)$(touch X)`touch X`'; touch X; '"
    for name in ("DATA", "OUT", "PRESET", "JOBS", "GRIDS", "SET", "NB"):
        for target in ("figures", "grids", "notebooks"):
            done = subprocess.run(
                ["make", "-n", target, f"{name}={evil}"], cwd=tmp_path, env=alone, capture_output=True, text=True
            )
            assert done.returncode == 0, done.stderr
            subprocess.run(
                ["sh", "-c", done.stdout.replace(".venv/bin/python", ":")], cwd=tmp_path, check=True, capture_output=True
            )
    assert not (tmp_path / "X").exists()

"""Chapters played cell by cell without a kernel, in a third of the time: pictures are drawn, but not written."""

from __future__ import annotations

import time
import traceback
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import nbformat

from mwlib.course.notebooks import read_notebook, read_parameters, resolve, source_hash, tags
from mwlib.experiments import page
from mwlib.experiments.grids import Budget, Grid
from mwlib.experiments.page import Refused
from mwlib.experiments.results import RESULT, parameters_hash, result_of, write_result
from mwlib.files import write_json
from mwlib.hashing import package_hash
from mwlib.settings import Settings


def play(notebook: Path, given: Mapping[str, Any]) -> None:
    """Run a chapter's cells in this process, in whose folder its relative paths are looked up.

    Raises:
        Refused: the data lack what it needs.
        Exception: whatever a cell raises.
    """
    known: dict[str, Any] = {"__name__": "a chapter"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # those of a chapter are its own matter
        for place, cell in enumerate(nbformat.read(notebook, as_version=4).cells):
            if cell.cell_type == "code":
                exec(compile(cell.source, f"cell {place}", "exec"), known)
                known |= given if "parameters" in tags(cell) else {}
                plt.close("all")


def leave_result(notebook: Path, given: Mapping[str, Any], folder: Path, few: Mapping[str, int]) -> None:
    """Play a chapter, in a process of its own, and leave the result that `run_notebook` would leave, and the minutes it took.

    Args:
        notebook, given, folder: as for `run_notebook`.
        few: settings that a grid's budget may not exceed: windows, samples, steps.
    """
    page.save = lambda *_, **__: []
    whole = Grid.budget

    def budget(self: Grid, cfg: Settings) -> Budget:
        found = whole(self, cfg)
        least = {name: min(found.changes.get(name, most), most) for name, most in few.items() if name in cfg.owners()}
        return replace(found, changes=found.changes | least)

    Grid.budget = budget if few else whole
    tree, began = read_notebook(notebook), time.monotonic()
    depends = {"notebook": source_hash(tree), "mwlib": package_hash()}
    told: dict[str, Any] = {}
    try:
        play(notebook, {**given, "out": str(folder)})
    except Refused as error:
        told = {"status": "refused", "reason": f"{notebook.stem}: {error}"}
    except Exception as error:
        traceback.print_exc()
        cell = [step.filename for step in traceback.extract_tb(error.__traceback__) if step.filename.startswith("cell ")][-1]
        told = {"status": "failed", "reason": f"{notebook.stem}: {cell} raised {type(error).__name__}: {error}"}
    if told:
        key = parameters_hash(resolve(read_parameters(tree), given))
        write_result(folder, {}, key, depends, told.pop("status"), told)
    whole = result_of(folder)
    if not told:
        modules = whole["depends"]["modules"]
        whole |= {"status": "ok", "depends": whole["depends"] | depends | {"mwlib": package_hash(modules=modules)}}
    write_json(folder / RESULT, whole | {"minutes": (time.monotonic() - began) / 60})

"""Run one notebook with other parameters, and say truthfully whether it got to its end.

Own choice: papermill's exit code and metadata cannot tell (a kernel that dies leaves a notebook that looks finished,
``sys.exit(0)`` in a cell counts as success), so a run is done if and only if its last cell wrote `metrics.json`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import nbformat
import papermill
from nbconvert import HTMLExporter
from papermill.exceptions import PapermillExecutionError

from mwlib.course.execute import QUIET
from mwlib.course.files import EXPERIMENT
from mwlib.course.parameters import ParameterError, read_parameters, resolve
from mwlib.experiments import store
from mwlib.experiments.grids import Grid, changes, row_config
from mwlib.experiments.systems import system
from mwlib.material import home

EXECUTED = "notebook.ipynb"
PAGE = "notebook.html"


class NotDone(RuntimeError):
    """A notebook run did not get to its end."""


def run_notebook(notebook: Path, out: Path | None, given: Mapping[str, Any]) -> Path:
    """Run a notebook with some parameters changed; everything it leaves lies in one folder.

    Args:
        notebook: the notebook file; it is read, never written.
        out: folder for `metrics.json`, `notebook.ipynb`, `notebook.html` and what the notebook saves;
            None = build/runs/<notebook>-<hash of the parameters>.
        given: parameter name -> value; the others keep the notebook's defaults.

    Returns:
        The folder.

    Raises:
        ParameterError: a name is unknown or a value is of the wrong type.
        NotDone: the notebook did not get to its end; the folder then holds no `metrics.json`.
    """
    values = resolve(read_parameters(nbformat.read(notebook, as_version=4)), given)
    if "out" not in values:
        raise ParameterError(f"{notebook}: the parameters cell has no 'out'; expected 'out: str = \"\"  # where results go'")
    digest = store.parameters_hash(values)
    folder = (out or home() / "build" / "runs" / f"{notebook.stem}-{digest}").resolve()
    folder.mkdir(parents=True, exist_ok=True)
    for name in (store.RESULT, EXECUTED, PAGE):
        (folder / name).unlink(missing_ok=True)
    try:
        papermill.execute_notebook(
            str(notebook), folder / EXECUTED, {**values, "out": str(folder)},
            kernel_name="python3", language="python", progress_bar=False, start_timeout=120, extra_arguments=QUIET,
        )  # fmt: skip
        if store.read_result(folder, digest) is None:
            raise NotDone(f"{store.RESULT} is missing, half-written or of other parameters than {values}")
    except Exception as error:
        (folder / store.RESULT).unlink(missing_ok=True)
        raise NotDone(f"{notebook.stem}: {_reason(error)}\n(see {folder / EXECUTED})") from error
    finally:
        if (folder / EXECUTED).is_file():
            write_page(folder / EXECUTED, folder / PAGE)
    return folder


def run_experiment(grid: Grid, row: int, seed: int, preset: str, given: Mapping[str, Any], out: Path) -> Path:
    """Run one row of a grid at one seed, as a run of the notebook `experiment.ipynb`.

    Args:
        grid: the grid.
        row: number of the row, from 0.
        seed: of the sampling, and of the training where the grid's rows train.
        preset: what the row changes.
        given: settings that somebody changed in the preset on purpose.
        out: folder, as for `run_notebook`.

    Returns:
        The folder.

    Raises:
        LookupError: there is no such row.
        ValueError: rows of the grid differ in a given setting.
        NotDone: as for `run_notebook`.
    """
    if not 0 <= row < len(grid.rows):
        raise LookupError(f"row is {row}; {grid.id} has 0 to {len(grid.rows) - 1}")
    base = system(grid.system).Config.preset(preset, **given)
    changed = row_config(grid, grid.rows[row], base, seed, given)
    names = {**given, **changes(grid, grid.rows[row], base, given), "sampling_seed": seed, "seed": seed}
    words = [f"{name}={json.dumps(changed.get(name))}" for name in names if name != "data"]
    data = changed.get("data") if "data" in names else ""
    return run_notebook(EXPERIMENT, out, {"system": grid.system, "preset": preset, "data": data, "changes": words})


def write_page(notebook: Path, page: Path) -> None:
    """Write an executed notebook as HTML; the classic template, for it is the one that prints alternative texts."""
    html, _ = HTMLExporter(template_name="classic").from_filename(str(notebook))
    page.write_text(html, encoding="utf-8")


def _reason(error: Exception) -> str:
    """An error in few words: the cell's own traceback stands in the executed notebook."""
    if isinstance(error, PapermillExecutionError):
        return f"cell {error.exec_count} raised {error.ename}: {error.evalue}"
    return str(error) or type(error).__name__

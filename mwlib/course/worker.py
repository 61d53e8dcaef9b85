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

from mwlib import runs
from mwlib.config import Config
from mwlib.course.execute import QUIET
from mwlib.course.files import EXPERIMENT, ROOT
from mwlib.course.parameters import ParameterError, read_parameters, resolve
from mwlib.grids import Grid, changes, seeded

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
    digest = runs.parameters_hash(values)
    folder = (out or ROOT / "build" / "runs" / f"{notebook.stem}-{digest}").resolve()
    folder.mkdir(parents=True, exist_ok=True)
    for name in (runs.RESULT, EXECUTED, PAGE):
        (folder / name).unlink(missing_ok=True)
    try:
        papermill.execute_notebook(
            str(notebook), folder / EXECUTED, {**values, "out": str(folder)},
            kernel_name="python3", language="python", progress_bar=False, start_timeout=120, extra_arguments=QUIET,
        )  # fmt: skip
        if runs.read_result(folder, digest) is None:
            raise NotDone(f"{runs.RESULT} is missing, half-written or of other parameters than {values}")
    except Exception as error:
        (folder / runs.RESULT).unlink(missing_ok=True)
        raise NotDone(f"{notebook.stem}: {_reason(error)}\n(see {folder / EXECUTED})") from error
    finally:
        if (folder / EXECUTED).is_file():
            write_page(folder / EXECUTED, folder / PAGE)
    return folder


def run_experiment(grid: Grid, row: int, seed: int, preset: str, data: str, out: Path) -> Path:
    """Run one row of a grid at one seed, as a run of the notebook `experiment.ipynb`.

    Args:
        grid: the grid.
        row: number of the row, from 0.
        seed: of the sampling, and of the training where the grid's rows train.
        preset, data: what the row changes; empty data: the preset's own.
        out: folder, as for `run_notebook`.

    Returns:
        The folder.

    Raises:
        LookupError: there is no such row.
        NotDone: as for `run_notebook`.
    """
    if not 0 <= row < len(grid.rows):
        raise LookupError(f"row is {row}; {grid.id} has 0 to {len(grid.rows) - 1}")
    base = Config.preset(preset, **({"data": data} if data else {}))
    wanted = changes(grid, grid.rows[row], base)
    changed = seeded(grid, base.override(**wanted), seed)
    names = [*wanted, "sampling_seed", "seed"]
    words = [f"{name}={json.dumps(changed.get(name))}" for name in names]
    return run_notebook(EXPERIMENT, out, {"preset": preset, "data": data, "changes": words})


def write_page(notebook: Path, page: Path) -> None:
    """Write an executed notebook as HTML; the classic template, for it is the one that prints alternative texts."""
    html, _ = HTMLExporter(template_name="classic").from_filename(str(notebook))
    page.write_text(html, encoding="utf-8")


def _reason(error: Exception) -> str:
    """An error in few words: the cell's own traceback stands in the executed notebook."""
    if hasattr(error, "ename"):
        return f"cell {error.exec_count} raised {error.ename}: {error.evalue}"
    return str(error) or type(error).__name__

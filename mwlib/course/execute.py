"""Execution of notebooks: in place with filtered outputs, or with other parameters into a folder of their own.

Own choice: papermill's exit code and metadata do not prove success (a kernel that dies leaves a notebook that looks finished,
``sys.exit(0)`` in a cell counts as success). A run is done if and only if its page wrote a result, and the executed notebook
shows every cell run, in order, without an error; then the result gets the status "ok", together with the HTML page.
"""

import json
import os
import platform
import sys
from collections.abc import Callable, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import nbformat
import papermill
from nbclient import NotebookClient
from nbclient.exceptions import CellTimeoutError
from nbformat import NotebookNode
from papermill.exceptions import PapermillExecutionError

from mwlib.course.notebooks import (  # isort: skip
    FILES, FOLDED, TIMEOUT, WRONG, ParameterError, read_notebook, read_parameters, resolve, source_hash, tags,
)  # fmt: skip
from mwlib.experiments import results
from mwlib.files import write_atomic, write_together
from mwlib.hashing import digest, file_hash, package_hash
from mwlib.paths import course_folder, home
from mwlib.plots.printing import COLUMN, FONT

PICTURES = ("image/png", "image/gif")
KEPT_TYPES = (*PICTURES, "text/plain", "text/latex", "text/markdown")
WIDGET = "application/vnd.jupyter.widget-view+json"
QUIET = ["--log-level=CRITICAL"]  # else a kernel warns of its transport as it starts, and of an interrupt as it ends
ALWAYS = "always"  # metadata of a cell whose asserts about measured numbers are true of any data: why they are
KEPT_CELL_METADATA = ("tags", "jupyter", WRONG, ALWAYS)
KEPT_METADATA = (*PICTURES, "mwlib")  # alternative texts, and the stem of an exhibit


def execute_notebook(path: Path) -> None:
    """Run a notebook from top to bottom in a new kernel, in its own folder, and write it back, filtered.

    Args:
        path: the notebook; replaced only if every cell ran, each within ten minutes.

    Raises:
        CellExecutionError: a cell raised, or took longer; the file is left as it was.
        DeadKernelError: the kernel died; the file is left as it was.
    """
    notebook = nbformat.read(path, as_version=4)
    # With its state kept, a widget swallows what it draws; without, that would land in the page beside the static figure.
    client = NotebookClient(
        notebook, timeout=600, startup_timeout=120, kernel_name="python3", store_widget_state=True,
        record_timing=False, extra_arguments=QUIET,
        resources={"metadata": {"path": str(path.resolve().parent)}},
    )  # fmt: skip
    client.execute()
    filter_notebook(notebook)
    nbformat.validate(notebook)
    write_atomic(path, nbformat.writes(notebook))


def filter_notebook(notebook: NotebookNode) -> None:
    """Keep prints and pictures; drop stderr, widgets, HTML and what changes from run to run; fold solutions and guards. In place.

    The notebook's metadata then holds the hash of the sources that these outputs belong to.
    """
    for cell in notebook.cells:
        cell.metadata = NotebookNode({key: cell.metadata[key] for key in KEPT_CELL_METADATA if key in cell.metadata})
        if cell.cell_type == "code":
            if {*FOLDED} & {*tags(cell)}:
                cell.metadata["jupyter"] = {"source_hidden": True}  # JupyterLab folds it
            cell.outputs = _joined([kept for output in cell.outputs if (kept := _filtered(output)) is not None])
    notebook.metadata = NotebookNode(
        kernelspec={"display_name": "Python 3", "language": "python", "name": "python3"},
        language_info={"name": "python"},
        mwlib={"source": source_hash(notebook)},
    )


def is_table(kind: str, value: str) -> bool:
    """Whether an output is a plain HTML table: the one HTML that reads well everywhere and is the same in each run."""
    return kind == "text/html" and value.startswith("<table>") and "<script" not in value


def _joined(outputs: list[NotebookNode]) -> list[NotebookNode]:
    """Neighbouring prints as one, as where a kernel cuts them is chance; a print between two tables stays between them."""
    out: list[NotebookNode] = []
    for output in outputs:
        if out and output.output_type == out[-1].output_type == "stream" and output.name == out[-1].name:
            out[-1].text += output.text
        else:
            out.append(output)
    return out


def _filtered(output: NotebookNode) -> NotebookNode | None:
    if output.output_type in ("stream", "error"):  # an error is of a cell that is allowed to fail; the structure rules report it
        return output if output.get("name") != "stderr" else None
    if WIDGET in output.data:
        return None
    data = {kind: value for kind, value in output.data.items() if kind in KEPT_TYPES or is_table(kind, value)}
    if set(data) == {"text/plain"} and data["text/plain"].startswith("<"):
        return None  # an animation or raw HTML: its text form is an object's name
    output.data = NotebookNode(data)
    output.metadata = NotebookNode({key: output.metadata[key] for key in KEPT_METADATA if key in output.metadata})
    return output if data else None


WITH_VERSIONS = ("torch", "numpy", "scipy", "matplotlib", "pillow", "PyWavelets", "ipykernel")
EXECUTED = "notebook.ipynb"
PAGE = "notebook.html"
WHOLE_WORDS = (  # prints, claims among them, break between words; on a phone they have the whole width
    "div.output_area pre { white-space: pre-wrap; word-break: normal; overflow-wrap: anywhere }"
    "@media (max-width: 600px) { div.output_area .prompt { display: none } div.output_subarea { max-width: 100% } }"
)


class NotDone(RuntimeError):
    """A notebook run did not get to its end.

    Attributes:
        refused: whether the notebook refused its data at its head (`Page.needs`), in place of failing.
    """

    def __init__(self, reason: str, refused: bool = False) -> None:
        super().__init__(reason)
        self.refused = refused


def run_notebook(
    notebook: Path,
    out: Path | None,
    given: Mapping[str, Any],
    timeout: float = TIMEOUT,
    *,
    page: bool = True,
    go_on: bool = False,
) -> Path:
    """Run a notebook with some parameters changed; everything it leaves lies in one folder.

    MWLIB_EXECUTED names a folder in which executions are kept. One of the same notebook, parameters, data and code is copied from
    there in place of another; a new one is copied there.

    Args:
        notebook: the notebook file; it is read, never written.
        out: folder for `metrics.json`, `notebook.ipynb`, `notebook.html` and what the notebook saves;
            None = build/runs/<notebook>-<hash of the parameters>. What an earlier run of the notebook left there is removed.
        given: parameter name -> value; the others keep the notebook's defaults.
        timeout: seconds for one cell; then the kernel is killed.
        page: whether `notebook.html` is written.
        go_on: whether a notebook that does not get to its end leaves a result that says why, with the status "refused" or
            "failed": what is made of many notebooks goes on with the others.

    Returns:
        The folder.

    Raises:
        FileNotFoundError, ValueError: there is no such file, or it is no notebook.
        ParameterError: a name is unknown or a value is of the wrong type.
        NotDone: the notebook did not get to its end; the folder then holds no `metrics.json`, or one that says so.
    """
    if not timeout > 0:
        raise ValueError(f"timeout is {timeout}; expected more than 0 seconds")
    tree = read_notebook(notebook)
    values = resolve(read_parameters(tree), given)
    if "out" not in values:
        raise ParameterError(f"{notebook}: the parameters cell has no 'out'; expected 'out: str = \"\"  # where results go'")
    if given.get("out"):
        raise ParameterError(f"out is given as a parameter, {given['out']!r}; say --out, the folder for all that a run leaves")
    digest = results.parameters_hash(values)
    folder = (out or home() / "build" / "runs" / f"{notebook.stem}-{digest}").resolve()
    folder.mkdir(parents=True, exist_ok=True)
    kept = os.environ.get("MWLIB_EXECUTED")
    before = Path(kept, f"{notebook.stem}-{digest}") if kept else None
    with results.locked(folder.with_suffix(".lock")):
        _forget(folder, notebook.stem)
        if before and results.result_of(before).get("depends", {}).get("surroundings") == surroundings():
            if not outdated(before, tree, digest):
                return _copied(before, folder, before, page)
        try:
            _execute(notebook, tree, values, folder, timeout, page)
        except NotDone as error:
            if go_on:
                status = "refused" if error.refused else "failed"
                about = {"notebook": source_hash(tree), "mwlib": package_hash()}
                results.write_result(folder, {}, digest, about, status, {"reason": str(error)})
            raise
        if before:
            _copied(folder, before, before)
    return folder


def _execute(
    notebook: Path, tree: Mapping[str, Any], values: Mapping[str, Any], folder: Path, timeout: float, page: bool
) -> None:
    """Run a notebook in a new kernel; only a run that got to its end leaves a result."""
    depends = {"notebook": source_hash(tree), "surroundings": surroundings()}
    package_hash()  # the code counts as it is before the run, whatever becomes of it meanwhile
    try:
        papermill.execute_notebook(
            _literally(notebook), _literally(folder / EXECUTED), {**values, "out": str(folder)}, kernel_name="python3",
            language="python", progress_bar=sys.stderr.isatty(), start_timeout=120, execution_timeout=timeout,
            extra_arguments=QUIET,
        )  # fmt: skip
        _check(folder / EXECUTED)
        if results.read_result(folder, results.parameters_hash(values), "finished") is None:
            raise NotDone(f"{results.RESULT} is missing, half-written or of other parameters than {values}")
        result = results.result_of(folder)
        depends["mwlib"] = package_hash(modules=result["depends"].get("modules"))
        whole = result | {"status": "ok", "depends": result["depends"] | depends}
        pages = {folder / PAGE: _page(folder / EXECUTED)} if page else {}
        write_together({**pages, folder / results.RESULT: json.dumps(whole, indent=1)})
    except Exception as error:
        (folder / results.RESULT).unlink(missing_ok=True)
        if page and (folder / EXECUTED).is_file():
            write_atomic(folder / PAGE, _page(folder / EXECUTED))
        reason, refused = f"{_reason(error, folder)}\n(see {folder / EXECUTED})", False
        if isinstance(error, PapermillExecutionError) and error.ename == results.REFUSED:
            reason, refused = error.evalue, True
        raise NotDone(f"{notebook.stem}: {reason}", refused) from error


def _copied(source: Path, target: Path, kept: Path, page: bool = False) -> Path:
    """Copy what a run left, its result last; with its page, made if it has none. One of them is kept for other runs."""
    with results.locked(kept.with_suffix(".lock")):
        (target / results.RESULT).unlink(missing_ok=True)
        files = [file for file in source.rglob("*") if file.is_file()]
        for file in sorted(files, key=lambda file: file.name == results.RESULT):
            write_atomic(target / file.relative_to(source), file.read_bytes())
    if page and not (target / PAGE).exists():
        write_atomic(target / PAGE, _page(target / EXECUTED))
    return target


def outdated(
    folder: Path,
    tree: Mapping[str, Any],
    wanted: str | None = None,
    fingerprint: Callable[[str], str] | None = None,
) -> str:
    """Why a notebook's result does not count, in a few words; empty if it is what a run would give today.

    Args:
        folder: of the run.
        tree: the notebook as it is today.
        wanted: hash of the parameters that the result should be of; None = any.
        fingerprint: data source -> hash of its files of today; None = `data_fingerprint`.
    """
    result = results.result_of(folder)
    if result.get("status") != "ok":
        return " ".join(f"{result.get('status')}: {result['reason']}".split()) if "reason" in result else "not finished"
    if fingerprint is None:
        from mwlib.data.sources import data_fingerprint as fingerprint  # imports torch, which a new run does without

    depends = result["depends"]
    data = depends.get("data", {})
    stale = {
        "notebook": depends.get("notebook") != source_hash(tree),
        "library": depends.get("mwlib") != package_hash(modules=depends.get("modules")),
        "data": data.get("files") != fingerprint(str(data.get("source"))),
        "parameters": wanted is not None and result.get("hash") != wanted,
    }
    changed = [name for name, is_stale in stale.items() if is_stale]
    return f"out of date: another {', '.join(changed)} now" if changed else ""


def surroundings() -> str:
    """Hash of what a run depends on besides its notebook, parameters, data and library: versions, committed results, grids."""
    versions = {name: version(name) for name in WITH_VERSIONS} | {"python": platform.python_version()}
    figures = course_folder() / "figures"
    files = [figures / "grids.yaml", *sorted(file for file in figures.glob("*/*") if file.is_file())]
    hashes = {file.relative_to(figures).as_posix(): file_hash(file) for file in files if file.is_file()}
    return digest({"versions": versions, "figures": hashes, "static": os.environ.get("MW_STATIC"), **print_settings()})


def print_settings() -> dict[str, str]:
    """What was said about pictures for print, in this process and in the kernels that it starts."""
    return {name: said for name in (COLUMN, FONT) if (said := os.environ.get(name))}


def _forget(folder: Path, notebook: str) -> None:
    """Remove what an earlier run of a notebook left: its result, its pages, and the pictures and tables that bear its name."""
    for name in (results.RESULT, EXECUTED, PAGE):
        (folder / name).unlink(missing_ok=True)
    for sidecar in folder.glob("*.json"):
        about = results.read_tree(sidecar)
        if about.get("notebook") == notebook and sidecar.stem in map(about.get, FILES):
            for ending in reversed(FILES["figure"]):  # the sidecar, which proves that the others are there, first
                sidecar.with_suffix(f".{ending}").unlink(missing_ok=True)


def _literally(path: Path) -> str:
    """A path as papermill takes it: braces are doubled, for single ones hold parameters to be filled in."""
    return str(path).replace("{", "{{").replace("}", "}}")


def _check(executed: Path) -> None:
    """Refuse a notebook in which a cell was skipped, left by an exit, or run out of order.

    Raises:
        NotDone: it names the cell.
    """
    for number, (name, cell) in enumerate(_cells(executed), 1):
        for output in cell.outputs:
            if output.output_type == "error":
                raise NotDone(f"{name} was left by {output.ename}")
        if cell.execution_count != number:
            count = "not run" if cell.execution_count is None else f"run as number {cell.execution_count}"
            raise NotDone(f"{name} was {count}; expected every cell to run once, in order")


def _cells(executed: Path) -> list[tuple[str, NotebookNode]]:
    """The cells that hold code, with what messages call them."""
    cells = [cell for cell in nbformat.read(executed, as_version=4).cells if cell.cell_type == "code" and cell.source.strip()]
    return [(f"cell {n}, {cell.source.strip().splitlines()[0][:60]!r},", cell) for n, cell in enumerate(cells, 1)]


def _page(executed: Path) -> str:
    """An executed notebook as HTML; the classic template, for it is the one that prints alternative texts."""
    from nbconvert import HTMLExporter  # takes seconds to import

    page = HTMLExporter(template_name="classic").from_filename(str(executed))[0]
    return page.replace("</head>", f"<style>{WHOLE_WORDS}</style></head>", 1)


def _reason(error: Exception, folder: Path) -> str:
    """An error in few words: the cell's own traceback stands in the executed notebook."""
    if isinstance(error, PapermillExecutionError):
        return f"cell {error.exec_count} raised {error.ename}: {error.evalue}"
    if isinstance(error, CellTimeoutError):
        name = [name for name, cell in _cells(folder / EXECUTED) if cell.metadata.papermill.get("start_time")][-1]
        return f"{name} took longer than the timeout; the kernel was killed"
    return str(error) or type(error).__name__

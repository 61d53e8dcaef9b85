"""Execute the committed notebooks in place and keep of their outputs what a reader and the tests need."""

from __future__ import annotations

from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbformat import NotebookNode

from mwlib.course.files import source_hash
from mwlib.course.parameters import tags
from mwlib.files import write_atomic

PICTURES = ("image/png", "image/gif")
KEPT_TYPES = (*PICTURES, "text/plain", "text/latex", "text/markdown")
WIDGET = "application/vnd.jupyter.widget-view+json"
QUIET = ["--log-level=ERROR"]  # else every kernel start warns about its transport on stderr
KEPT_CELL_METADATA = ("tags", "jupyter")


def execute_notebook(path: Path, timeout: float = 600.0) -> None:
    """Run a notebook from top to bottom in a new kernel, in its own folder, and write it back, filtered.

    Args:
        path: the notebook; replaced only if every cell ran.
        timeout: seconds for one cell.

    Raises:
        CellExecutionError: a cell raised; the file is left as it was.
        DeadKernelError: the kernel died; the file is left as it was.
    """
    notebook = nbformat.read(path, as_version=4)
    # With its state kept, a widget swallows what it draws; without, that would land in the page beside the static figure.
    client = NotebookClient(
        notebook, timeout=timeout, startup_timeout=120, kernel_name="python3", store_widget_state=True,
        record_timing=False, extra_arguments=QUIET,
        resources={"metadata": {"path": str(path.resolve().parent)}},
    )  # fmt: skip
    client.execute()
    filter_notebook(notebook)
    nbformat.validate(notebook)
    write_atomic(path, nbformat.writes(notebook))


def filter_notebook(notebook: NotebookNode) -> None:
    """Keep prints and pictures; drop stderr, widgets, HTML and whatever changes from run to run; fold solutions. In place.

    The notebook's metadata then holds the hash of the sources that these outputs belong to.
    """
    for cell in notebook.cells:
        cell.metadata = NotebookNode({key: cell.metadata[key] for key in KEPT_CELL_METADATA if key in cell.metadata})
        if cell.cell_type == "code":
            if "solution" in tags(cell):
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
    if output.output_type == "stream":
        return output if output.name == "stdout" else None
    if output.output_type == "error":
        return output  # only a cell that is allowed to fail leaves one; the structure rules report it
    if WIDGET in output.data:
        return None
    data = {kind: value for kind, value in output.data.items() if kind in KEPT_TYPES or is_table(kind, value)}
    if set(data) == {"text/plain"} and data["text/plain"].startswith("<"):
        return None  # an animation or raw HTML: its text form is an object's name
    output.data = NotebookNode(data)
    output.metadata = NotebookNode({kind: output.metadata[kind] for kind in PICTURES if kind in output.metadata})
    return output if data else None

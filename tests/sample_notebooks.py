"""A small notebook that keeps every structure rule, for tests to run and to break."""

from __future__ import annotations

from pathlib import Path

import nbformat
from nbformat import NotebookNode
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

# A name that the shell, Snakemake, papermill, make or a browser would take for something else, were it not quoted.
NASTY = "a {level} 'b' \"c\" #d;e?$(touch X)"

PARAMETERS = """preset: str = "tiny"  # name of a preset
data: str = ""  # empty = the preset's own
level: int = 2  # decomposition level; from 0 to 99
lr: float = 0.5  # step size; from 0.0001 to 1
names: list[str] = ["haar", "db2"]  # wavelets
out: str = ""  # folder for the results; empty writes nothing"""

IMPORTS = "import mwlib as mw\nfrom mwlib.experiments.page import Page"
PAGE = """cfg = mw.Config.preset(preset)
page = Page("01_sample", out, cfg, preset=preset, data=data, level=level, lr=lr, names=names)"""
PICTURE = """fig, ax = plt.subplots(figsize=(2, 1))
page.show(fig, "fig_01_axes", "An empty pair of axes, nothing drawn", {"n": [0, 1]})"""
FINISH = 'page.finish({"answer": level + lr})'

FOLDED = "<details><summary>Derivation</summary>\n\nBecause.\n\n</details>"

SYMBOLS = """## Energy
$$E = \\sum_n x_n^2$$

| symbol | code | shape | unit |
|---|---|---|---|
| $x$ | `x` | `(T,)` | m |
"""


def code(source: str, *tags: str) -> NotebookNode:
    """A code cell."""
    return new_code_cell(source, metadata={"tags": list(tags)} if tags else {})


def runnable(*cells: str, last: str = FINISH) -> NotebookNode:
    """Parameters, the page, some cells, and the cell that writes the result. Draws nothing: quick to run."""
    return new_notebook(cells=[code(PARAMETERS, "parameters"), *map(code, (f"{IMPORTS}\n{PAGE}", *cells, last))])


WRITES_ITSELF = """import hashlib, json, pathlib
given = dict(preset=preset, data=data, level=level, lr=lr, names=names)
text = json.dumps(given, sort_keys=True)
digest = hashlib.sha256(text.encode()).hexdigest()[:8]
tree = {"status": "finished", "hash": digest, "depends": {}, "metrics": {}}
pathlib.Path(out, "metrics.json").write_text(json.dumps(tree))"""


def bare(*cells: str, last: str = WRITES_ITSELF) -> NotebookNode:
    """A notebook that gets to its end without mwlib, in a fraction of the time."""
    return new_notebook(cells=[code(PARAMETERS, "parameters"), *map(code, (*cells, last))])


def save(notebook: NotebookNode, folder: Path, stem: str = "01_sample") -> Path:
    """Write a notebook as it stands."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{stem}.ipynb"
    nbformat.write(notebook, path)
    return path


def model_notebook() -> NotebookNode:
    """Every structural element that the rules ask for; not executed yet."""
    return new_notebook(
        cells=[
            new_markdown_cell("# A sample\n\nIt shows what a notebook looks like."),
            code(f"import warnings\n\nimport matplotlib.pyplot as plt\n\n{IMPORTS}"),
            code(PARAMETERS, "parameters"),
            code(PAGE),
            new_markdown_cell(SYMBOLS),
            code('print("energy", sum(n * n for n in range(4)))', "nbval-check-output"),
            code('warnings.warn("noise", stacklevel=1)'),
            code(PICTURE),
            new_markdown_cell("**What you should see.** Axes from 0 to 1."),
            code("half = 4 / 2  # your turn: half of four\nthird = 6 / 3  # your turn: a third of six"),
            code('assert half == 2, f"half is {half}; expected half of four"'),
            new_markdown_cell("### Ex 1.1 Double it\nGive `twice` the double of `level`."),
            code("twice = 2 * level", "solution"),
            new_markdown_cell(FOLDED, metadata={"tags": ["solution"]}),
            code("assert twice == level + level"),
            code('page.table([{"n": 1, "square": 1.0}], "table_01_squares")'),
            code(FINISH),
        ]
    )

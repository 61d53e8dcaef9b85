"""Chapters that open elsewhere by one click: badges, and copies that install what they need."""

import os
import tomllib
from pathlib import Path
from urllib.parse import quote

import nbformat
from nbformat import NotebookNode

from mwlib.course.working_copy import PACKAGE

COPIES = "colab"  # folder of the site's sources, and branch of the repository, that hold the copies
WIDGETS = "anywidget>=0.9.13,<1"  # what a chapter needs beside the library in a Jupyter that is there already
INSTALL = """# Installs the course where it is missing: this copy of the chapter runs anywhere.
import importlib.util
import subprocess
import sys

if importlib.util.find_spec("mwlib") is None:
    subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", {source!r}, {widgets!r}], check=True)"""


def repository(root: Path) -> str:
    """The repository's address, ``https://github.com/OWNER/NAME``; empty while it has none. `pyproject.toml` is its one place.

    Args:
        root: a checkout.

    Raises:
        ValueError: it is no address on GitHub, which is what Colab, Binder and the workflows know.
    """
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    address = project.get("urls", {}).get("Repository", "").rstrip("/")
    if address and not (address.startswith("https://github.com/") and address.count("/") == 4):
        raise ValueError(f"pyproject.toml: Repository is {address!r}; expected https://github.com/OWNER/NAME")
    return address


def badges(address: str, notebook: str) -> str:
    """Links that open a chapter in Colab and in Binder, as Markdown; empty without an address.

    Args:
        address: as `repository` gives it.
        notebook: file name of the chapter.

    >>> print(badges("https://github.com/someone/course", "02_a.ipynb"))
    [Colab](https://colab.research.google.com/github/someone/course/blob/colab/02_a.ipynb) or
    [Binder](https://mybinder.org/v2/gh/someone/course/main?urlpath=lab%2Ftree%2Fnotebooks%2F02_a.ipynb)
    """
    if not address:
        return ""
    place, path = address.removeprefix("https://github.com/"), quote(f"lab/tree/notebooks/{notebook}", safe="")
    return (
        f"[Colab](https://colab.research.google.com/github/{place}/blob/{COPIES}/{notebook}) or\n"
        f"[Binder](https://mybinder.org/v2/gh/{place}/main?urlpath={path})"
    )


def launched_copy(notebook: NotebookNode, source: str) -> NotebookNode:
    """A chapter whose first code cell installs the course where it is missing.

    Args:
        notebook: as committed.
        source: what pip installs, such as `source_of` gives, or the path of a wheel.
    """
    copy = NotebookNode(notebook.copy())
    cell = nbformat.v4.new_code_cell(INSTALL.format(source=source, widgets=WIDGETS), id="install", metadata={"tags": ["install"]})
    copy.cells = [notebook.cells[0], cell, *notebook.cells[1:]]
    return copy


def source_of(address: str) -> str:
    """What pip installs of a repository: the commit that a workflow runs on, else its main branch."""
    return f"{PACKAGE} @ git+{address}@{os.environ.get('GITHUB_SHA', 'main')}"

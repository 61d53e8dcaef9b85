"""Which stored output of an executed notebook is which exhibit, told from its source and its outputs: nothing is executed."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mwlib.course.stems import kept_calls, parsed

KINDS = {"show": "image/png", "table": "text/html"}  # what each call of the page leaves in the cell's outputs


@dataclass(frozen=True)
class Kept:
    """One stored output.

    Args:
        cell: place of its cell in the notebook.
        content: PNG in base64, or an HTML table.
        alt: the alternative text; empty for a table.
    """

    cell: int
    content: str
    alt: str


def kept_outputs(notebook: Mapping[str, Any]) -> dict[str, Kept]:
    """The stored outputs by the stems that the source gives them.

    A cell whose outputs do not match its calls one to one is left out: what they show cannot be told without a run.

    Args:
        notebook: tree of an executed notebook.

    Raises:
        ValueError: a stem cannot be read from the source.
    """
    trees = [parsed({"cells": [cell]}).body for cell in notebook["cells"]]
    helpers = {node.name for tree in trees for node in tree if isinstance(node, ast.FunctionDef)}
    quiet = [[node for node in tree if isinstance(node, ast.FunctionDef) or not _speaks(node, helpers)] for tree in trees]
    found: dict[str, Kept] = {}
    for place, cell in enumerate(notebook["cells"]):
        shown = [output for output in cell.get("outputs", []) if output["output_type"] == "display_data"]
        body = [node for tree in [*quiet[:place], trees[place], *quiet[place + 1 :]] for node in tree]
        calls = kept_calls(ast.Module(body, [])) if shown else []
        for method, kind in KINDS.items():
            stems = [stem for name, stem in calls if name == method]
            outputs = [output for output in shown if kind in output["data"]]
            if len(stems) == len(outputs):
                pairs = zip(stems, outputs, strict=True)
                found |= {stem: _kept(place, output, kind) for stem, output in pairs if stem is not None}
    return found


def alternative_texts(notebook: Mapping[str, Any]) -> dict[str, str]:
    """Alternative text of each stored picture, by the picture as base64."""
    outputs = [output for cell in notebook["cells"] for output in cell.get("outputs", []) if "data" in output]
    pictures = [output for output in outputs if "image/png" in output["data"]]
    return {_content(output, "image/png"): _kept(0, output, "image/png").alt for output in pictures}


def _kept(cell: int, output: Mapping[str, Any], kind: str) -> Kept:
    return Kept(cell, _content(output, kind), str(output.get("metadata", {}).get(kind, {}).get("alt", "")))


def _content(output: Mapping[str, Any], kind: str) -> str:
    return "".join(output["data"][kind]).strip()


def _speaks(statement: ast.stmt, helpers: set[str]) -> bool:
    """Whether a statement may show something: it names the page or a function of the notebook."""
    return any(node.id == "page" or node.id in helpers for node in ast.walk(statement) if isinstance(node, ast.Name))

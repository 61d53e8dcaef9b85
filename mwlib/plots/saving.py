"""Put a picture into a notebook or into files, always with its alternative text."""

from __future__ import annotations

import base64
import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from PIL import Image
from torch import Tensor

from mwlib.files import write_together
from mwlib.plots.look import array, style
from mwlib.plots.printing import column, printed

# Without dates and version strings the same picture gives the same bytes.
METADATA = {"png": {"Software": None}, "pdf": {"CreationDate": None, "Creator": None, "Producer": None}}
SAVE_DPI = 150


@style()
def save(
    fig: Figure,
    folder: str | Path,
    stem: str,
    *,
    data: Mapping[str, np.ndarray | Tensor] | Sequence[Mapping[str, object]],
    alt: str,
    provenance: Mapping[str, object],
) -> list[Path]:
    """Write `stem`.png, .pdf, .csv (what is plotted), .txt (alternative text) and .json (provenance).

    The files appear together or not at all; the .json comes last. The same input gives the same bytes. The PDF is as wide as
    the figure, or as the column that MWLIB_COLUMN asks for.

    Args:
        data: columns by name, or rows as mappings. A column with more axes becomes one per trailing entry (`name_0`,
            `name_1_2`); shorter columns end in empty cells. In a row, a pair (value, spread) takes two columns.
        alt: one or two sentences that say what the picture shows to someone who cannot see it.
        provenance: which data, preset, seed and version made it; JSON values.

    Returns:
        The five paths.

    Raises:
        ValueError: the alternative text or the data are empty, or the stem is not a plain file name.
        TypeError: the provenance holds something that JSON cannot.
    """
    wide, about = column(), origin("figure", stem, provenance).encode()
    words = {"txt": (described(alt) + "\n").encode(), "csv": as_csv(data).encode()}
    pdf = printed(fig, wide, METADATA["pdf"]) if wide else b""
    png = _render(fig, "png", SAVE_DPI)
    pictures = {"png": png, "pdf": pdf or _render(fig, "pdf", SAVE_DPI)}
    return _write_all(folder, stem, {**words, **pictures, "json": about})


def save_table(
    rows: Sequence[Mapping[str, object]], folder: str | Path, stem: str, *, provenance: Mapping[str, object]
) -> list[Path]:
    """Write a table as `stem`.csv and its provenance as `stem`.json, in the manner of `save`.

    Args:
        rows: column -> value, as in `save`; a missing one leaves an empty cell.
        provenance: as in `save`.

    Returns:
        The two paths.

    Raises:
        ValueError: there are no rows, or the stem is not a plain file name.
        TypeError: the provenance holds something that JSON cannot.
    """
    contents = {"csv": as_csv(rows).encode(), "json": origin("table", stem, provenance).encode()}
    return _write_all(folder, stem, contents)


@style()
def show(fig: Figure, alt: str, stem: str | None = None) -> None:
    """Display the figure in a notebook with its alternative text, and let it go.

    The text is also the output's plain form: where no picture can be shown there stands a sentence, not an object's name.

    Args:
        fig, alt: as for `save`.
        stem: name of the figure's files; the output's metadata keeps it, see `marked`.

    Raises:
        ValueError: the alternative text is empty.
    """
    from IPython.display import display  # at hand in every notebook; the library itself does without

    alt = described(alt)
    png = base64.b64encode(_with_palette(_render(fig, "png", mpl.rcParams["figure.dpi"]))).decode()
    display({"image/png": png, "text/plain": alt}, metadata={"image/png": {"alt": alt}, **marked(stem)}, raw=True)
    plt.close(fig)  # a figure made by pyplot would otherwise appear a second time


def marked(stem: str | None) -> dict[str, dict[str, str]]:
    """The metadata by which an output that a notebook stores is known as the exhibit of this stem."""
    return {"mwlib": {"stem": stem}} if stem else {}


def as_csv(data: Mapping[str, np.ndarray | Tensor] | Sequence[Mapping[str, object]]) -> str:
    """Columns or rows, as `save` and `save_table` take them, as the text of a CSV file.

    Raises:
        ValueError: the data are empty.

    >>> print(as_csv({"t": [0, 1], "x": np.array([[0.5, 0.25], [1, 2]])}), end="")
    t,x_0,x_1
    0,0.5,0.25
    1,1,2
    """
    if not data:
        raise ValueError("data are empty; expected what the picture or table shows, as columns or rows")
    if isinstance(data, Mapping):
        columns: dict[str, np.ndarray] = {}
        for name, values in data.items():
            several = np.atleast_1d(array(values))
            columns |= {"_".join([name, *map(str, place)]): several[:, *place] for place in np.ndindex(several.shape[1:])}
        lines = [columns, *zip_longest(*columns.values(), fillvalue="")]
    else:
        rows = [_unpaired(row) for row in data]
        header = dict.fromkeys(key for row in rows for key in row)
        lines = [header, *([row.get(key, "") for key in header] for row in rows)]
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(map(_cell, line) for line in lines)
    return text.getvalue()


def origin(kind: str, stem: str, provenance: Mapping[str, object]) -> str:
    """The text of a provenance file: under `kind`, "figure" or "table", the stem; then the provenance, NaN as null.

    Raises:
        ValueError: the stem is not a plain file name.
        TypeError: the provenance holds something that JSON cannot.
    """
    if not stem or Path(stem).name != stem:
        raise ValueError(f"stem is {stem!r}; expected a plain file name without a folder")
    return json.dumps({kind: stem, **existing(provenance)}, indent=2, sort_keys=True, allow_nan=False) + "\n"


def existing(tree: Any) -> Any:
    """A JSON tree with None for numbers that do not exist, NaN and infinity, like a standard error over one clip."""
    if isinstance(tree, Mapping):
        return {key: existing(value) for key, value in tree.items()}
    if isinstance(tree, list | tuple):
        return [existing(value) for value in tree]
    return None if isinstance(tree, float) and not math.isfinite(tree) else tree


def described(alt: str) -> str:
    """An alternative text on one line.

    Raises:
        ValueError: it is empty.
    """
    if not alt.strip():
        raise ValueError("the alternative text is empty; expected a sentence that says what the picture shows")
    return " ".join(alt.split())


def _render(fig: Figure, kind: str, dpi: float) -> bytes:
    """The content of a file. The layout is solved once for all of a figure's files, which takes as long as drawing it."""
    if layout := fig.get_layout_engine():
        layout.execute(fig)
        fig.set_layout_engine(None)  # also matplotlib's default, as the style has it: no further engine
    buffer = io.BytesIO()
    fig.savefig(buffer, format=kind, dpi=dpi, metadata=METADATA[kind])
    return buffer.getvalue()


def _with_palette(png: bytes) -> bytes:
    """The same picture in 256 colours: less than half the size, so that a notebook full of bodies stays light."""
    buffer = io.BytesIO()
    whole = Image.open(io.BytesIO(png)).convert("RGB")  # the median cut would take rare colours from a colour bar
    whole.quantize(256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(buffer, "png", optimize=True)
    return buffer.getvalue()


def _write_all(folder: str | Path, stem: str, contents: Mapping[str, bytes]) -> list[Path]:
    """Files of one stem, together; the last one tells that the others are there."""
    files = {Path(folder) / f"{stem}.{ending}": content for ending, content in contents.items()}
    write_together(files)
    return list(files)


def _unpaired(row: Mapping[str, object]) -> dict[str, object]:
    """A pair (value, spread) as two cells."""
    cells: dict[str, object] = {}
    for name, value in row.items():
        cells |= {name: value[0], f"{name}, deviation": value[1]} if isinstance(value, tuple) else {name: value}
    return cells


def _cell(value: object) -> object:
    """Nine digits: every float32 comes back exactly."""
    return f"{value:.9g}" if isinstance(value, float | np.floating) else value

"""The page of a notebook: its pictures, its tables, and the result that proves that it got to its end."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from mwlib.data.collections import acknowledgement
from mwlib.data.sources import data_fingerprint
from mwlib.experiments.results import RESULT, models_used, of_older_code, parameters_hash, write_result
from mwlib.plots.saving import as_csv, marked, origin, save, save_table, show
from mwlib.plots.tables import results_table
from mwlib.version import __version__

Row = Mapping[str, object]


class Page:
    """Shows a notebook's pictures and tables; writes them and the result into `out`, with their provenance.

    With an empty `out` nothing is written, and cells may be run again in any order. All the same, what would be written is
    checked: data that make no CSV and metrics that make no JSON are refused in either case. With a folder in `out` the page is a
    record: each stem once, and nothing after `finish`.

    Args:
        notebook: name of the notebook, without ending.
        out: folder for the files; empty writes nothing. A result that an earlier run left there is deleted.
        cfg: the configuration; its setting `data` is the source that the files name.
        parameters: the notebook's parameters, all but `out`.

    Attributes:
        provenance: what each file says about its origin: notebook, parameters, data, version. Add what the parameters do not
            tell, e.g. ``page.provenance["windows"] = len(x)``.

    Raises:
        TypeError: a parameter is not a JSON value.

    >>> import mwlib as mw
    >>> page = Page("00_start_here", "", mw.Config.preset("tiny"), preset="tiny", data="", samples=20)
    >>> page.provenance["data"], page.provenance["samples"]
    ('synthetic', 20)
    >>> page.table([{"prediction": "standing still", "ADE (m)": 0.4567}])
    | prediction     | ADE (m) |
    | -------------- | ------: |
    | standing still |   0.457 |
    >>> page.finish({"windows": 3})
    """

    def __init__(self, notebook: str, out: str, cfg: Any, **parameters: Any) -> None:
        source = cfg.get("data")
        self.provenance: dict[str, object] = {"notebook": notebook, "version": __version__, **parameters, "data": source}
        self.provenance |= acknowledgement(source)
        self._folder = Path(out) if out else None
        self._hash = parameters_hash(parameters)
        self._depends = self._told_now(cfg, source) if out else {}
        self._stems: set[str] = set()
        self._finished = False
        self._forget()

    def show(
        self,
        fig: Figure,
        stem: str | None,
        alt: str,
        data: Mapping[str, Any] | Sequence[Row] | None = None,
        *,
        provenance: Mapping[str, object] | None = None,
    ) -> None:
        """Display a figure with its alternative text; save it as `stem`.png, .pdf, .csv, .txt and .json.

        Args:
            stem: name of the files, without ending; a row of `figures/manifest.yaml` has it. None: show only.
            alt: one or two sentences that say what the picture shows to someone who cannot see it.
            data: what is plotted, for the CSV: columns by name (tensors, arrays, lists, numbers), or rows as mappings.
            provenance: entries that differ from the page's or add to it, e.g. ``{"data": "cmu/asfamc", "seeds": [0, 1]}``.

        Raises:
            ValueError: the alternative text or the data are empty, or the stem is not a plain file name or is used twice.
            TypeError: the provenance holds something that JSON cannot.
            RuntimeError: the page is finished.
        """
        self._open(f"the picture {stem or alt!r}")
        if stem is not None:
            about = self._admit("figure", stem, data, provenance)
            if self._folder and data is not None:
                save(fig, self._folder, stem, data=data, alt=alt, provenance=about)
        show(fig, alt, stem)

    def table(
        self,
        rows: Sequence[Row],
        stem: str | None = None,
        columns: Sequence[str] | None = None,
        *,
        better: Mapping[str, str] | None = None,
        data: Sequence[Row] | None = None,
        provenance: Mapping[str, object] | None = None,
    ) -> None:
        """Display rows as a table of results; save them as `stem`.csv and .json.

        Args:
            rows: column -> value, as `mwlib.plots.results_table` takes them.
            stem: as for `show`.
            columns: the columns to show, in order; None shows all. The CSV has all in any case.
            better: column -> "lower" or "higher", for the columns whose best value is set in bold.
            data: rows for the CSV where they are others than those shown.
            provenance: as for `show`.

        Raises:
            ValueError: there are no rows, or the stem is not a plain file name or is used twice.
            TypeError: the provenance holds something that JSON cannot.
            RuntimeError: the page is finished.
        """
        from IPython.display import display  # at hand in every notebook; the library itself does without

        self._open(f"the table {stem or ''!r}")
        shown = results_table(rows, columns, better=better)
        if stem is not None:
            kept = rows if data is None else data
            about = self._admit("table", stem, kept, provenance)
            if self._folder:
                save_table(kept, self._folder, stem, provenance=about)
        display(shown, metadata=marked(stem))

    def finish(self, metrics: Mapping[str, Any]) -> None:
        """Write the result, `metrics.json`, with hashes of what it depends on: the notebook's last call.

        Its status is "finished". `run-notebook`, which sees whether every cell ran, makes "ok" of it.

        Args:
            metrics: the numbers to keep; JSON values.

        Raises:
            TypeError: the metrics hold something that JSON cannot.
            RuntimeError: the page is finished already.
        """
        self._open("a second result")
        json.dumps(dict(metrics))
        if self._folder:
            used = {"models": dict(models_used), "modules": sorted(name for name in sys.modules if name.split(".")[0] == "mwlib")}
            write_result(self._folder, metrics, self._hash, self._depends | used | of_older_code(), "finished")
            self._finished = True

    def _open(self, what: str) -> None:
        """Refuse what comes after the end; then the end was none, and the result goes."""
        if self._finished:
            self._forget()
            raise RuntimeError(f"{what} comes after page.finish; expected page.finish as the notebook's last call")

    def _admit(self, kind: str, stem: str, data: Any, provenance: Mapping[str, object] | None) -> dict[str, object]:
        """Check a stem with what is to be saved under it, and return its provenance."""
        about = {**self.provenance, **of_older_code(), **(provenance or {})}
        origin(kind, stem, about)
        as_csv(data)
        if self._folder and stem in self._stems:
            raise ValueError(f"stem is {stem!r}, which this page has saved already; expected a name of its own")
        self._stems.add(stem)
        return about

    def _told_now(self, cfg: Any, source: str) -> dict[str, Any]:
        """What the result depends on, as it is before anything is read: files that change meanwhile make it out of date."""
        data = {"source": source, "files": data_fingerprint(source)}
        return {"parameters": self._hash, "settings": cfg.hash(), "data": data}

    def _forget(self) -> None:
        if self._folder:
            (self._folder / RESULT).unlink(missing_ok=True)

"""The page of a notebook: its pictures, tables and claims, and the result that proves that it got to its end."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from matplotlib.figure import Figure

from mwlib.data.collections import acknowledgement
from mwlib.data.sources import data_fingerprint
from mwlib.experiments.results import RESULT, models_used, of_older_code, parameters_hash, read_tree, write_result
from mwlib.paths import course_folder
from mwlib.plots.saving import as_csv, existing, marked, origin, save, save_table, show
from mwlib.plots.tables import results_table, significant
from mwlib.version import __version__

Row = Mapping[str, object]
T = TypeVar("T")
SIGNS = {True: "✓", False: "✗", None: "–"}
HOLDING = {True: "holds", False: "does not hold", None: "cannot be said"}
ELSEWHERE = (
    "These are not the chapter's default parameters. Its text and its pictures' descriptions speak of the embedded people; "
    "each ✓ or ✗ below says whether a claim holds here."
)


class Claim(NamedTuple):
    """A sentence about measured numbers.

    Args:
        sentence: the claim, as a clause: "the samples stride less than the truth".
        holds: whether it does; None where a number that it needs does not exist.
        numbers: what it rests on, by name; None for a number that does not exist.
    """

    sentence: str
    holds: bool | None
    numbers: dict[str, float | None]

    def shown(self) -> str:
        """Its numbers: ``samples 0.220, truth 0.410``; "–" for one that does not exist."""
        return ", ".join(f"{name.replace('_', ' ')} {'–' if n is None else significant(n)}" for name, n in self.numbers.items())

    def told(self) -> str:
        """Whether it holds, with its numbers: ``holds (samples 0.220, truth 0.410)``."""
        return HOLDING[self.holds] + (f" ({self.shown()})" if self.numbers else "")

    def like(self, other: Claim | None) -> Claim:
        """The same with its numbers in another's order: a stored notebook sorts them by name."""
        order = () if other is None else other.numbers
        return self._replace(numbers={name: self.numbers[name] for name in (*order, *self.numbers) if name in self.numbers})


class Refused(ValueError):
    """The data lack what the whole chapter needs; Jupyter shows the sentence in place of a traceback."""

    def _render_traceback_(self) -> list[str]:
        return [f"{type(self).__name__}: {self}"]


class Page:
    """Shows a notebook's pictures, tables and claims; writes them and the result into `out`, with their provenance.

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
    >>> page = Page("a_sample", "", mw.Config.preset("tiny"), preset="tiny", data="", samples=20)
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
        self._depends: dict[str, Any] = {}
        if out:  # as it is before anything is read: files that change meanwhile make the result out of date
            data = {"source": source, "files": data_fingerprint(source)}
            self._depends = {"parameters": self._hash, "settings": cfg.hash(), "data": data}
        self._stems: set[str] = set()
        self._claims: dict[str, Claim] = {}
        self._left_out: list[str] = []
        self._finished = False
        self._forget()
        self._default_hash = parameters_hash({**parameters, "data": source})
        self._default = _stored(notebook).get("parameters", self._default_hash) == self._default_hash
        self._embedded = stored_claims(notebook)
        if not self._default:
            print(ELSEWHERE)

    def needs(self, holds: object, sentence: str) -> None:
        """Refuse data that lack what the whole chapter needs: a chapter does so at its head, or gets to its end.

        Args:
            holds: whether they have it.
            sentence: what is needed and what was found: "this chapter needs two test windows; these motions have one".

        Raises:
            Refused: they do not have it.
        """
        if not holds:
            raise Refused(sentence)

    def load(self, load: Callable[[Any], T], settings: Any) -> T:
        """The data that `load` makes of settings: those that it refuses, a chapter refuses with its sentence.

        Args:
            load: reads the data, as `mwlib.prediction.system.load_data` does.
            settings: what it takes.

        Raises:
            Refused: `load` raised a ValueError or an OSError.
        """
        try:
            return load(settings)
        except (ValueError, OSError) as error:
            raise Refused(str(error)) from error

    def can(self, holds: object, sentence: str) -> bool:
        """Whether a part of the chapter can be shown; where it cannot, a sentence says so, and the result keeps it.

        Args:
            holds: whether the data have what the part needs.
            sentence: what is left out and why: "no strides are compared: this skeleton has no feet".
        """
        if not holds and sentence not in self._left_out:
            self._left_out.append(sentence)
            print(f"Left out: {sentence}.")
        return bool(holds)

    def claim(self, sentence: str, holds: object, **numbers: Any) -> None:
        """State what the measured numbers show, and whether they do.

        With the chapter's default parameters, those of its stored outputs, a claim that does not hold stops the notebook.
        With any others it stops nothing: it is shown where it stands, in the table at the end, and kept in the result.

        Args:
            sentence: the claim, as a clause without a full stop; each once in a notebook.
            holds: a truth value, also of NumPy or torch; None where it cannot be said. It cannot where a number does not exist.
            numbers: what it rests on, by name: `samples=0.22` is shown as "samples 0.22". NaN, infinity and None do not exist.

        Raises:
            AssertionError: it does not hold, or cannot be said, with the default parameters.
            TypeError, ValueError: a number is none; or the claim has been made already, on a page that is written.

        >>> import mwlib as mw
        >>> page = Page("a_sample", "", mw.Config.preset("tiny"))
        >>> page.claim("the samples stride less than the truth", 0.22 < 0.41, samples=0.22, truth=0.41)
        ✓ the samples stride less than the truth (samples 0.220, truth 0.410)
        """
        self._open(f"the claim {sentence!r}")
        if self._folder and sentence in self._claims:
            raise ValueError(f"the claim {sentence!r} is made twice; expected each once")
        kept = {name: None if value is None else existing(float(value)) for name, value in numbers.items()}
        known = holds is not None and None not in kept.values()
        claim = Claim(sentence, bool(holds) if known else None, kept)
        self._claims[sentence] = claim
        if self._default and not claim.holds:
            raise AssertionError(f"{sentence}: {claim.told()}")
        if self._default:
            print(f"{SIGNS[claim.holds]} {sentence}{claim.told().removeprefix(HOLDING[True])}")
        else:
            there = f"; embedded people: {self._embedded[sentence].like(claim).told()}" if sentence in self._embedded else ""
            print(f"{SIGNS[claim.holds]} {sentence}: {claim.told()} here{there}")

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
        data: Sequence[Row] | None = None,
        provenance: Mapping[str, object] | None = None,
    ) -> None:
        """Display rows as a table of results; save them as `stem`.csv and .json.

        Args:
            rows: column -> value, as `mwlib.plots.results_table` takes them.
            stem: as for `show`.
            columns: the columns to show, in order; None shows all. The CSV has all in any case.
            data: rows for the CSV where they are others than those shown.
            provenance: as for `show`.

        Raises:
            ValueError: there are no rows, or the stem is not a plain file name or is used twice.
            TypeError: the provenance holds something that JSON cannot.
            RuntimeError: the page is finished.
        """
        from IPython.display import display  # at hand in every notebook; the library itself does without

        self._open(f"the table {stem or ''!r}")
        shown = results_table(rows, columns)
        if stem is not None:
            kept = rows if data is None else data
            about = self._admit("table", stem, kept, provenance)
            if self._folder:
                save_table(kept, self._folder, stem, provenance=about)
        display(shown, metadata=marked(stem))

    def finish(self, metrics: Mapping[str, Any]) -> None:
        """Show the chapter's claims in a table, and write the result, `metrics.json`: the notebook's last call.

        The result has hashes of what it depends on, the claims, and what was left out. Its status is "finished". `run-notebook`,
        which sees whether every cell ran, makes "ok" of it.

        Args:
            metrics: the numbers to keep; JSON values. NaN and infinity become null.

        Raises:
            TypeError: the metrics hold something that JSON cannot.
            RuntimeError: the page is finished already.
        """
        self._open("a second result")
        json.dumps(metrics := existing(dict(metrics)))
        if self._claims:
            self._sum_up()
        if self._folder:
            used = {"models": dict(models_used), "modules": sorted(name for name in sys.modules if name.split(".")[0] == "mwlib")}
            told = {"claims": [claim._asdict() for claim in self._claims.values()], "left_out": self._left_out}
            write_result(self._folder, metrics, self._hash, self._depends | used | of_older_code(), "finished", told)
            self._finished = True

    def _sum_up(self) -> None:
        """The chapter's claims as a table. Stored in the committed notebook, it says what holds on the embedded people."""
        from IPython.display import display

        claims = self._claims.values()
        if self._default:  # numbers as they are shown, so that a notebook executed twice is the same file
            shown = [{name: n if n is None else float(significant(n)) for name, n in claim.numbers.items()} for claim in claims]
            kept = [claim._replace(numbers=numbers)._asdict() for claim, numbers in zip(claims, shown, strict=True)]
            rows = [{"claim": claim.sentence, "embedded people": claim.told()} for claim in claims]
            display(results_table(rows), metadata={"mwlib": {"claims": kept, "parameters": self._default_hash}})
            return
        held = [claim.holds for claim in claims]
        print(
            f"Of {len(held)} claims {held.count(True)} hold here, {held.count(False)} do not, {held.count(None)} cannot be said."
        )
        there = {sentence: claim.like(self._claims.get(sentence)).told() for sentence, claim in self._embedded.items()}
        display(results_table([
            {"claim": name, "here": f"{SIGNS[claim.holds]} {claim.told()}", "embedded people": there.get(name)}
            for name, claim in self._claims.items()
        ]))  # fmt: skip

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

    def _forget(self) -> None:
        if self._folder:
            (self._folder / RESULT).unlink(missing_ok=True)


def stored_claims(notebook: str) -> dict[str, Claim]:
    """What the course's own notebook claims of the embedded people, by sentence, as its stored outputs have it."""
    return {claim["sentence"]: Claim(**claim) for claim in _stored(notebook).get("claims", [])}


def _stored(notebook: str) -> dict[str, Any]:
    """What the course's own notebook stores of its claims on its default parameters; empty if it stores none."""
    cells = read_tree(course_folder() / "notebooks" / f"{notebook}.ipynb", cells=list).get("cells", [])
    marks = [output.get("metadata", {}).get("mwlib", {}) for cell in cells for output in cell.get("outputs", [])]
    return next((mark for mark in marks if "claims" in mark), {})

"""The report on a paper's claims: each with what was done, what was found, a verdict, and where to look."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from mwlib.experiments.checks import MADE_WITH, REFERENCE, Tables
from mwlib.experiments.claims import KINDS, PENDING, Case, Claim, Shown, claims_file, decide, kind_of, read_claims
from mwlib.paths import course_folder

ACKNOWLEDGEMENT = (
    "The data used in this project was obtained from mocap.cs.cmu.edu. "
    "The database was created with funding from NSF EIA-0196217."
)  # fmt: skip
INTRODUCTION = f"""# What holds of the paper, claim by claim

The paper is *MotionWavelet: Human Motion Prediction via Wavelet Manifold Learning* (arXiv 2411.16964). This page lists what it
says that can be checked, and what we found. The command `mwlib reproduction` writes it from
[figures/claims.yaml](figures/claims.yaml), from the measured tables in [figures/cmu](figures/cmu) and from the notebooks.
Numbers measured on CMU are read from the tables. Each verdict that rests on a table has a condition over its cells. If a table
changes and no condition holds any more, the command refuses to write this page, and a test fails. Quotes and sections of
notebooks are looked up as well.

**Data.** The tables are measured on motion capture of the CMU Graphics Lab: clips in ASF/AMC, 50 Hz, 16 joints without the
root, 25 frames observed, 100 predicted. The models never saw the people who are tested. The paper's data are not here: the
licence of Human3.6M does not allow us to pass them on. Notebooks show things on synthetic people unless they say otherwise.

**Models.** The preset `cmu_paper` has the paper's method at a smaller size: 4 blocks of width 128 instead of 12 of width 768, and
4,000 training steps instead of about 390,000. Rows that differ in more than the sampling have trainings of their own, of as
many steps. The preset predicts clean coefficients, scaled one by one, of displacements from the last observed pose. The paper
predicts the noise of coefficients as they are; the table `as_published` has that. The
preset `cmu` has changes of our own, and a claim says so where it uses one of its tables. The machine of each table stands
in the JSON file beside it; where none is named, it was a CPU of a shared x86-64 machine.

**What is comparable.** Directions are: whether a change makes a number larger or smaller. Sizes are not, for data, network and
training differ. "Does not hold here" means that we did not find it with these data and this training. It does not mean that the
paper's numbers are wrong.

**How sure.** All rows of a table see the same windows. Differences are taken window by window, with their standard errors over
clips; a direction counts if it is more than twice that error. Where a row has several trainings, a window's number is their mean.
APD of several trainings, and jitter, are also compared with the deviation over seeds. Numbers after ± are deviations over seeds
unless the sentence says that they are standard errors. APD, ADE, FDE, MMADE and MMFDE are in metres.

Other results, with more detail, stand in [RESULTS.md](RESULTS.md). {ACKNOWLEDGEMENT}

```sh
mwlib reproduction                                                                  # writes this page again
mwlib fetch cmu                                                                     # downloads the clips
mwlib grid-table table_6 --preset cmu_paper --out figures/cmu                       # measures one of its tables again
```
"""


def report(file: Path | None = None, tables: Tables | None = None, notebooks: Path | None = None) -> str:
    """The whole report as Markdown; links start from the folder of the course.

    Args:
        file: of the claims; None = `figures/claims.yaml`.
        tables: measured; None = the course's.
        notebooks: their folder; None = the course's.

    Raises:
        FileNotFoundError, ValueError: a file is missing, a verdict does not follow from its check, or a notebook lacks a heading
            or an output; the message names the file and the claim.
    """
    file = claims_file() if file is None else file
    claims = read_claims(file)
    tables = Tables() if tables is None else tables
    notebooks = course_folder() / "notebooks" if notebooks is None else notebooks
    found = []
    for claim in claims:
        for place in claim.shown:
            look(notebooks, place, claim.id)
        found.append((claim, *decide(str(file), claim, tables)))
    counts = Counter(kind_of(case.verdict) for _, case, _ in found)
    parts = [INTRODUCTION, "## Summary\n", _summary(counts), "## Contents\n"]
    themes = list(dict.fromkeys(claim.theme for claim in claims))
    parts += [_contents(theme, [(claim, case) for claim, case, _ in found if claim.theme == theme]) for theme in themes]
    for theme in themes:
        parts.append(f"## {theme}\n")
        parts += [_block(claim, case, text, tables) for claim, case, text in found if claim.theme == theme]
    return "\n".join(parts)


def look(notebooks: Path, place: Shown, claim: str) -> None:
    """Make sure that a notebook has the section that a claim points to, and prints what the claim says it prints.

    Raises:
        FileNotFoundError: there is no such notebook.
        ValueError: it lacks the heading or the output.
    """
    path = notebooks / f"{place.notebook}.ipynb"
    if not path.is_file():
        raise FileNotFoundError(f"{path} is not there; the claim {claim} points to it")
    cells = _read(path.read_text(encoding="utf-8"))
    lines = [line for cell in cells if cell["cell_type"] == "markdown" for line in "".join(cell["source"]).splitlines()]
    headings = [line.lstrip("#").strip() for line in lines if line.startswith("#")]
    if place.section not in headings:
        raise ValueError(
            f"{path}: the claim {claim} points to the section {place.section!r}; the notebook has {', '.join(headings)}"
        )
    if place.prints and not any(place.prints in text for cell in cells for text in _printed(cell)):
        raise ValueError(f"{path}: no output says {place.prints!r}; the claim {claim} quotes it: read the output again")


@lru_cache(maxsize=16)
def _read(text: str) -> list[dict[str, Any]]:
    return json.loads(text)["cells"]


def _printed(cell: Mapping[str, Any]) -> list[str]:
    outputs = cell.get("outputs", ())
    texts = [output.get("text", output.get("data", {}).get("text/plain", "")) for output in outputs]
    return ["".join(text) for text in texts]


def _summary(counts: Mapping[str, int]) -> str:
    rows = [f"| {kind} | {counts[kind]} |" for kind in (*KINDS, PENDING) if kind != PENDING or counts[kind]]
    return "\n".join(["| verdict | claims |", "|---|--:|", *rows, f"| all | {sum(counts.values())} |", ""])


def _contents(theme: str, found: Sequence[tuple[Claim, Case]]) -> str:
    rows = [f"| [{claim.title}](#{claim.id}) | {claim.paper} | {kind_of(case.verdict)} |" for claim, case in found]
    return "\n".join([f"**{theme}**\n", "| claim | in the paper | verdict |", "|---|---|---|", *rows, ""])


def _block(claim: Claim, case: Case, text: str, tables: Tables) -> str:
    lines = [
        f'### <a id="{claim.id}"></a>{claim.title}\n',
        f"* **The paper** ({claim.paper}): {claim.claim}",
        f"* **Here:** {claim.done}",
        f"* **Verdict: {case.verdict}.** {case.because}",
    ]
    names = dict.fromkeys(name for name, _, _ in REFERENCE.findall(text))
    evidence = [*(_table(name, tables) for name in names), *map(_place, claim.shown)]
    return "\n".join([*lines, *([f"* **Evidence:** {'; '.join(evidence)}."] if evidence else []), ""])


def _place(place: Shown) -> str:
    quote = f", which prints “{place.prints}”" if place.prints else ""
    return f"notebook [{place.notebook}](notebooks/{place.notebook}.ipynb), section “{place.section}”{quote}"


def _table(name: str, tables: Tables) -> str:
    """A link to a table with its windows and seeds; a table made with a grid's has those of the grid's."""
    about, rows = tables.about(name), tables.rows(MADE_WITH.sub("", name)).values()
    windows = {row["windows"] for row in rows if row.get("windows")} or {str(about.get("windows", "?"))}
    seeds = [int(row["seeds"]) for row in rows if row.get("seeds")]
    many = max(seeds, default=1)
    number = f"{many} seed{'s' if many > 1 else ''} of {about.get('seeds_of') or 'sampling'}"
    share = about.get("budget_share") or 1.0
    trained = f", {share:g} of the preset's training steps" if share != 1 else ""
    parts = [f"{' or '.join(sorted(windows))} windows", number, f"preset `{about.get('preset') or 'cmu_paper'}`{trained}"]
    return f"[{name}.csv](figures/cmu/{name}.csv) ({', '.join(parts)}, mwlib {about['mwlib']})"

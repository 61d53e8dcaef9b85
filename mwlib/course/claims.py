"""Outcomes of a build's chapters: done, refused or failed, and the claims that hold on its motions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

from mwlib.experiments.page import SIGNS, Claim, stored_claims
from mwlib.experiments.results import rendered, result_of
from mwlib.plots.tables import results_table

EMBEDDED = "embedded people"


class Chapter(NamedTuple):
    """One chapter of a build.

    Args:
        status: "ok", "refused" (its data), "failed", or "not run".
        reason: why it was refused or failed; a line.
        claims: what it claims, by sentence.
        left_out: the parts that its data did not allow, a sentence each.
    """

    status: str
    reason: str
    claims: dict[str, Claim]
    left_out: tuple[str, ...]


def read_chapter(folder: Path) -> Chapter:
    """What a run of a chapter left in its folder."""
    found = result_of(folder)
    status = said if (said := found.get("status")) in ("ok", "refused", "failed") else "not run"
    claims = {claim["sentence"]: Claim(**claim) for claim in found.get("claims", [])}
    reason = str(found.get("reason", "")).partition("\n")[0].removeprefix(f"{folder.name}: ")
    return Chapter(status, reason, claims, tuple(found.get("left_out", ())))


def read_build(build: Path, names: Sequence[str]) -> dict[str, Chapter]:
    """Each named chapter of a build.

    Raises:
        FileNotFoundError: there is no such folder.
    """
    if not build.is_dir():
        raise FileNotFoundError(f"{build} is no folder; expected a build, as `make figures OUT=...` leaves one")
    return {name: read_chapter(build / name) for name in names}


def summed_up(chapters: dict[str, Chapter]) -> str:
    """How many claims hold, in a sentence; empty where there are none."""
    held = Counter(claim.holds for chapter in chapters.values() for claim in chapter.claims.values())
    if not held:
        return ""
    return f"Of {held.total()} claims {held[True]} hold on these motions, {held[False]} do not, {held[None]} cannot be said."


def named(builds: Sequence[Path]) -> dict[str, Path]:
    """Builds by the ends of their paths, as long as it takes to tell them apart.

    Raises:
        ValueError: one is given twice.
    """
    whole = [build.resolve() for build in builds]
    if twice := [str(build) for build, times in Counter(whole).items() if times > 1]:
        raise ValueError(f"builds are given twice: {', '.join(twice)}; expected each once")
    for length in count(1):
        found = {"/".join(build.parts[-length:]): build for build in whole}
        if len(found) == len(whole):
            break
    return found


def fates(builds: dict[str, dict[str, Chapter]]) -> list[dict[str, str]]:
    """What became of each chapter in each build, a row a chapter: "ok", "ok, in part" if something was left out, "refused" ..."""
    names, *_ = builds.values()
    return [
        {"chapter": name} | {build: of[name].status + ", in part" * bool(of[name].left_out) for build, of in builds.items()}
        for name in names
    ]


def report(builds: dict[str, dict[str, Chapter]], whole: bool = False) -> str:
    """Builds side by side, as Markdown: what became of the chapters, and the claims with the embedded people's.

    Args:
        builds: name -> chapters, the same in each.
        whole: all claims; else those that do not hold in one of the builds.
    """
    (chapters, *_), rows = builds.values(), []
    for chapter in chapters:
        of = {EMBEDDED: stored_claims(chapter)} | {name: read[chapter].claims for name, read in builds.items()}
        for sentence in dict.fromkeys(sentence for claims in of.values() for sentence in claims):
            made = {name: claims.get(sentence) for name, claims in of.items()}
            if whole or any(claim is not None and not claim.holds for claim in made.values()):
                rows.append(_row(chapter, sentence, made))
    told = {"fates": len(builds) > 1 and results_table(fates(builds)), "rows": rows and results_table(rows)}
    return rendered("course/claims.md.jinja", builds=builds, whole=whole, summed_up=summed_up, **told)


def tree(builds: dict[str, dict[str, Chapter]]) -> dict[str, Any]:
    """Builds as a JSON value: each chapter's status, reason, claims and what was left out."""
    return {
        name: {key: c._asdict() | {"claims": [claim._asdict() for claim in c.claims.values()]} for key, c in chapters.items()}
        for name, chapters in builds.items()
    }


def _row(chapter: str, sentence: str, made: dict[str, Claim | None]) -> dict[str, Any]:
    *_, last = filter(None, made.values())  # the embedded people's, stored by name, come first
    signed = {name: claim and f"{SIGNS[claim.holds]} {claim.like(last).shown()}".strip() for name, claim in made.items()}
    return {"chapter": chapter.partition("_")[0], "claim": sentence, **signed}

"""Claims of a paper, each with a verdict that follows from measured tables: read from a file, and decided."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from mwlib.experiments.checks import REFERENCE, NotMeasured, Tables, filled, holds
from mwlib.experiments.grids import expect_fields
from mwlib.paths import course_folder

KINDS = ("holds", "does not hold here", "depends on the reading", "cannot be tested here")
WITH_A_REASON = KINDS[2:]
PENDING = "not measured yet"
OTHERWISE = "otherwise"  # in the place of a check: if none of the cases before holds


@dataclass(frozen=True)
class Case:
    """A verdict, and when it is the right one.

    Args:
        verdict: one of KINDS, with a reason after a colon where it needs one.
        because: what was found; `{table|row|column}` stands for a measured number.
        check: a condition over such numbers, or OTHERWISE; empty = always.
    """

    verdict: str
    because: str
    check: str = ""


@dataclass(frozen=True)
class Shown:
    """A place in a notebook.

    Args:
        notebook: its stem.
        section: a heading in it, without the signs in front.
        prints: what an output of it says; may be empty.
    """

    notebook: str
    section: str
    prints: str = ""


@dataclass(frozen=True)
class Claim:
    """Something that a paper says and that can be looked at.

    Args:
        id: lower-case words with hyphens.
        theme: heading under which it stands.
        title: in a few words.
        paper: section, table, figure or equation.
        claim: what the paper says, in our words, with its number.
        done: what we did.
        cases: the first whose check holds gives the verdict.
        shown: where in the notebooks.
        awaits: tables that may not be there yet although no grid is called so.
    """

    id: str
    theme: str
    title: str
    paper: str
    claim: str
    done: str
    cases: tuple[Case, ...]
    shown: tuple[Shown, ...] = ()
    awaits: tuple[str, ...] = ()


def claims_file() -> Path:
    """`figures/claims.yaml` of the course."""
    return course_folder() / "figures" / "claims.yaml"


def read_claims(path: Path | None = None) -> list[Claim]:
    """The claims of a file, in its order; None = the course's.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: something lacks a field or has an unknown one, a verdict is none, or a claim has no evidence; the message
            names file and claim, what was found and what was expected.
    """
    path = claims_file() if path is None else Path(path)
    try:
        tree = yaml.safe_load(path.read_text(encoding="utf-8"))
    except yaml.YAMLError as error:
        raise ValueError(f"{path} is not YAML: {' '.join(str(error).split())}") from None
    if not isinstance(tree, dict) or not isinstance(tree.get("claims"), list):
        raise ValueError(f"{path} holds {str(tree)[:40]!r}; expected a mapping with a list under 'claims'")
    found = []
    for number, body in enumerate(tree["claims"], 1):
        name = body.get("id", f"number {number}") if isinstance(body, dict) else f"number {number}"
        found.append(_claim(f"{path}: claim {name}", body))
    twice = {claim.id for claim in found if [other.id for other in found].count(claim.id) > 1}
    if twice:
        raise ValueError(f"{path}: two claims have the id {min(twice)!r}; expected different ones")
    return found


def _claim(where: str, body: Any) -> Claim:
    own, inner = {"id", "theme", "title", "paper", "claim", "done"}, {"verdict", "because", "check"}
    _fields(where, body, own, inner | {"cases", "shown", "awaits"})
    one = {name: body[name] for name in inner if name in body}
    several = body.get("cases", [])
    if bool(one) == bool(several) or not isinstance(several, list):
        raise ValueError(
            f"{where} has {sorted(one)} and {len(several)} cases; expected a verdict or a list of cases, and not both"
        )
    cases = []
    for number, case in enumerate(several or [one], 1):
        place = f"{where}, case {number}" if several else where
        _fields(place, case, {"verdict", "because"}, {"check"})
        cases.append(Case(**case))
        _verdict(place, cases[-1].verdict)
        if REFERENCE.search(cases[-1].because) and not cases[-1].check:
            raise ValueError(
                f"{place} gives measured numbers and no check; expected the condition from which its verdict follows"
            )
    shown = []
    for place in body.get("shown", []):
        _fields(f"{where}, shown", place, {"notebook", "section"}, {"prints"})
        shown.append(Shown(**place))
    untested = all(case.verdict.startswith(KINDS[3]) for case in cases)
    if not shown and not untested and not all(case.check for case in cases):
        raise ValueError(f"{where} has no evidence; expected a check or a place in a notebook under 'shown'")
    if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", body["id"]):
        raise ValueError(f"{where}: the id is {body['id']!r}; expected lower-case words with hyphens")
    return Claim(
        **{name: " ".join(body[name].split()) for name in own},
        cases=tuple(cases),
        shown=tuple(shown),
        awaits=tuple(body.get("awaits", ())),
    )


def _fields(where: str, found: Any, needed: set[str], allowed: set[str]) -> None:
    expect_fields(where, found, needed, allowed)
    for name in {*found} - {"cases", "shown", "awaits"}:
        if not isinstance(found[name], str) or not found[name].strip():
            raise ValueError(f"{where}: {name} is {found[name]!r}; expected a text")


def kind_of(verdict: str) -> str:
    """A verdict without its reason."""
    return verdict.partition(":")[0].strip()


def _verdict(where: str, verdict: str) -> None:
    if kind_of(verdict) not in KINDS:
        raise ValueError(f"{where}: the verdict is {verdict!r}; expected one of {', '.join(KINDS)}, and a reason after a colon")
    if kind_of(verdict) in WITH_A_REASON and not verdict.partition(":")[2].strip():
        raise ValueError(f"{where}: the verdict is {verdict!r}; expected a reason after a colon")


def decide(where: str, claim: Claim, tables: Tables) -> tuple[Case, str]:
    """The case of a claim that holds, its sentences filled in, and the references behind them.

    Args:
        where: for messages, e.g. the file.

    Returns:
        The case; its verdict is PENDING if no table of any of its cases is there. And the text from which it followed.

    Raises:
        ValueError: no check holds, or one cannot be read; the message names the claim.
    """
    false, missing = [], []
    tables.coming |= {*claim.awaits}
    for case in claim.cases:
        try:
            if case.check in ("", OTHERWISE) or holds(case.check, tables.value):
                return Case(filled(case.verdict, tables), filled(case.because, tables), case.check), case.check + case.because
            numbers = REFERENCE.sub(lambda found: str(tables.value(*found.groups())), case.check)
            false.append(f"{case.verdict!r} needs {case.check}, which is {numbers}, and false")
        except NotMeasured as error:
            missing.append(str(error))
        except ValueError as error:
            raise ValueError(f"{where}: claim {claim.id}: {error}") from None
    if not false:
        return Case(PENDING, f"The table {missing[0]}."), ""
    raise ValueError(f"{where}: claim {claim.id}: no verdict follows any more: {'; '.join(false)}. Expected a check that holds: "
                     "read the table again and write the verdict that follows from it")  # fmt: skip

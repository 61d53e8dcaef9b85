"""python -m tests.foreign: every chapter on eight small sets and the real ones at hand, and with other parameters.

The small sets, ends of ranges and other presets get few steps of training, as they ask whether a chapter gets to its end; what a
chapter printed stands in its log. Exit status 1 if one fails. What was done stays done: a run that was stopped, or given again
after a change, runs only what is missing or out of date.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections import defaultdict
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Lock
from typing import Any

from tqdm import tqdm

from mwlib.course.claims import Chapter, fates, read_chapter
from mwlib.course.execute import outdated
from mwlib.course.notebooks import NOTEBOOKS, chapter_number, course, find_notebook, read_notebook, read_parameters, source_hash
from mwlib.experiments.grids import system
from mwlib.experiments.results import RESULT, result_of
from mwlib.files import write_atomic
from mwlib.hashing import package_hash
from mwlib.plots.tables import results_table
from tests.foreign.playing import leave_result
from tests.foreign.sets import SETS, make_sets
from tests.forked import started

REAL = ("cmu/asfamc", "bandai_namco", "lafan1")  # under MWLIB_DATA
TRAINS = "06"  # the chapter whose model others use
ENDS = ("lowest", "highest")  # every parameter at an end of its range
CHOICES = {
    "predict": (False, True),
    "action": ("", "no such action"),
    "basis": ("haar", "dmey"),
    "sentence": ("run", "zxqv " * 20),
}
SEEDS = {"seed_1": 1, "seed_2": 2}
PRESETS = ("laptop", "laptop_paper")
# Of small sets, ends of ranges and other presets: settings, and what no table may exceed.
FEW = {"samples": 4, "test_windows": 10}
QUICK = {"train_steps": 40, "warmup": 10, "phase_steps": 100, **FEW}
LIGHT = {"short_steps": 50, "short_width": 16, "processes": 500, "pairs": 3, "samples": 4}  # parameters of chapters on small sets
WAYS = (*ENDS, *SEEDS, *PRESETS)
LOG = "log.txt"
WRITING = Lock()  # of presets, as several chapters share one
OTHER = {"11": "inbetweening", "12": "text_to_motion", "13": "text_to_motion"}  # chapters that are not of prediction


def real_sets() -> dict[str, Path]:
    """The real motions that are at hand, by the names under which they are looked up."""
    if not (folder := os.environ.get("MWLIB_DATA")):
        return {}
    return {name.replace("/", "-"): Path(name) for name in REAL if (Path(folder) / name).is_dir()}


def is_current(folder: Path, notebook: Path) -> bool:
    """Whether a chapter's outcome is what a run would give today; what failed is tried again."""
    result = result_of(folder)
    if result.get("status") == "refused":
        return result["depends"] == {"notebook": source_hash(notebook), "mwlib": package_hash()}
    return not outdated(folder, json.loads(notebook.read_text(encoding="utf-8")))


def changes(notebook: Path, way: str, sets: dict[str, Path], out: Path) -> dict[str, Any] | None:
    """The parameters of a chapter's run in one column of the table; None where it has none to change."""
    offered = read_parameters(read_notebook(notebook)).values()
    if way in sets:
        light = {one.name: LIGHT[one.name] for one in offered if one.name in LIGHT} | {"preset": quick(notebook, "tiny", out)}
        return {"data": str(sets[way])} | (light if way in SETS else {})
    if way in ENDS:
        ends = {one.name: one.range or CHOICES.get(one.name) for one in offered if one.name != "seed"}
        kinds = {one.name: type(one.default) for one in offered}
        given = {name: kinds[name](end[ENDS.index(way)]) for name, end in ends.items() if end}
        return given and given | {"preset": quick(notebook, "tiny", out)} or None
    if way in SEEDS:
        return {"seed": SEEDS[way]} if any(one.name == "seed" for one in offered) else None
    return {"preset": quick(notebook, way, out)}


def quick(notebook: Path, preset: str, out: Path) -> str:
    """A preset with few steps of training and few samples, as a file of settings."""
    named = OTHER.get(chapter_number(notebook), "prediction")
    file, kind = out / "presets" / f"{named}_{preset}.yaml", system(named).Config
    few = {name: value for name, value in QUICK.items() if name in kind.owners()}
    with WRITING:
        write_atomic(file, kind.preset(preset, **few).to_yaml())
    return str(file)


def run(notebook: Path, given: dict[str, Any] | None, folder: Path) -> Chapter:
    """What becomes of a chapter with some parameters; its status is "–" if there is nothing to run."""
    if given is None:
        return Chapter("–", "", {}, ())
    if not is_current(folder, notebook):
        folder.mkdir(parents=True, exist_ok=True)
        for name in (RESULT, LOG):
            (folder / name).unlink(missing_ok=True)
        few = FEW if given.get("preset") else {}
        started(leave_result, notebook, given, folder, few, log=folder / LOG, cwd=NOTEBOOKS).join()
        if (chapter := read_chapter(folder)).status != "ok":
            tqdm.write(f"{folder.parent.name}: {notebook.stem}: {chapter.status}: {chapter.reason}", file=sys.stderr)
    return read_chapter(folder)


def minutes(folder: Path, names: Iterable[str]) -> float:
    """How long the runs of some chapters took that lie in a folder."""
    return sum(result_of(folder / name).get("minutes", 0.0) for name in names)


def table(columns: dict[str, dict[str, Chapter]], out: Path, sources: dict[str, Path]) -> str:
    """What became of each chapter in each column, then why, each sentence once, as Markdown."""
    times = {"chapter": "minutes"} | {name: f"{minutes(out / name, of):.1f}" for name, of in columns.items()}
    why = defaultdict[str, list[str]](list)
    for column, chapters in columns.items():
        for name, chapter in chapters.items():
            reasons = [f"{chapter.status}: {chapter.reason}"] if chapter.reason else []
            for sentence in [*reasons, *(f"left out: {sentence}" for sentence in chapter.left_out)]:
                sentence = sentence.replace(str(sources.get(column, column)), "the folder")
                why[f"{name.partition('_')[0]} {sentence}"].append(column)
    lines = [f"* {sentence} ({', '.join(of)})" for sentence, of in sorted(why.items())]
    return "\n".join([repr(results_table([*fates(columns), times])), "", *lines])


def main(words: Sequence[str] | None = None) -> int:
    """Run what is missing and print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.foreign", description=__doc__)
    parser.add_argument("--sets", nargs="+", metavar="SET", help=f"some of {', '.join([*SETS, *WAYS])} and the real ones")
    parser.add_argument("--chapters", nargs="+", metavar="NUMBER", help="e.g. 04 05b (default: all)")
    parser.add_argument("--jobs", type=int, default=2, help="how many at a time (default 2)")
    parser.add_argument("--out", type=Path, default=Path("build/test-data"), help="folder of the runs (default build/test-data)")
    given = parser.parse_args(words)
    os.environ |= {"MW_STATIC": "1", "OMP_NUM_THREADS": "1"}
    out = given.out.resolve()
    sets = make_sets(out / "sets") | real_sets()
    known = [*sets, *WAYS]
    if unknown := {*(given.sets or ())} - {*known}:
        parser.error(f"no sets {sorted(unknown)}; expected some of {', '.join(known)}")
    chosen = [name for name in known if given.sets is None or name in given.sets]
    notebooks = [find_notebook(number) for number in given.chapters] if given.chapters else course()
    notebooks.sort(key=lambda path: not path.stem.startswith(TRAINS))  # the others find its model made
    jobs = [(path, name) for path in notebooks for name in chosen]
    with ThreadPoolExecutor(given.jobs) as pool:
        runs = pool.map(lambda job: run(job[0], changes(*job, sets, out), out / job[1] / job[0].stem), jobs)
        became = dict(zip(jobs, tqdm(runs, "chapters", len(jobs), unit="chapter"), strict=True))
    columns = {name: {path.stem: became[path, name] for path in sorted(notebooks)} for name in chosen}
    print(table(columns, out, sets))
    print(f"\nmwlib claims {given.out}/SET says which claims hold")
    return int(any(chapter.status not in ("ok", "refused", "–") for chapter in became.values()))


if __name__ == "__main__":
    sys.exit(main())

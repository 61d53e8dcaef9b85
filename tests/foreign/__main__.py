"""python -m tests.foreign: every chapter on eight small sets and the real ones at hand, and with other parameters.

Exit status 1 if one fails. What was done stays done: a run that was stopped, or given again after a change, runs only what is
missing or out of date.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from tqdm import tqdm

from mwlib.course.claims import read_chapter
from mwlib.course.execute import NotDone, outdated, run_notebook
from mwlib.course.notebooks import chapter_number, course, find_notebook, read_notebook, read_parameters
from mwlib.experiments.results import result_of
from mwlib.experiments.systems import system
from mwlib.files import write_atomic
from mwlib.hashing import package_hash
from tests.foreign.sets import SETS, make_sets

REAL = ("cmu/asfamc", "bandai_namco", "lafan1")  # under MWLIB_DATA
TRAINS = "06"  # the chapter whose model others use
ENDS = ("lowest", "highest")  # every parameter at an end of its range
SEEDS = {"seed_1": 1, "seed_2": 2}
PRESETS = ("laptop", "laptop_paper")
QUICK = {"train_steps": 40, "warmup": 10, "samples": 6, "test_windows": 16}  # what they change
WAYS = (*ENDS, *SEEDS, *PRESETS)
OTHER = {"11": "inbetweening", "12": "text_to_motion", "13": "text_to_motion"}  # chapters that are not of prediction


def real_sets() -> dict[str, Path]:
    """The real motions that are at hand."""
    if not (folder := os.environ.get("MWLIB_DATA")):
        return {}
    return {name.replace("/", "-"): Path(folder) / name for name in REAL if (Path(folder) / name).is_dir()}


def is_current(folder: Path, notebook: Path) -> bool:
    """Whether a chapter's outcome is what a run would give today; what failed is tried again."""
    result = result_of(folder)
    if result.get("status") == "refused":
        return result["depends"].get("mwlib") == package_hash()
    return not outdated(folder, json.loads(notebook.read_text(encoding="utf-8")))


def changes(notebook: Path, way: str, sets: dict[str, Path], out: Path) -> dict[str, Any] | None:
    """The parameters of a chapter's run in one column of the table; None where it has none to change."""
    offered = read_parameters(read_notebook(notebook)).values()
    if way in sets:
        return {"data": str(sets[way])}
    if way in ENDS:
        limited = [one for one in offered if one.range and one.name != "seed"]
        return {one.name: type(one.default)(one.range[ENDS.index(way)]) for one in limited if one.range} or None
    if way in SEEDS:
        return {"seed": SEEDS[way]} if any(one.name == "seed" for one in offered) else None
    named = OTHER.get(chapter_number(notebook), "prediction")
    file, kind = out / "presets" / f"{named}_{way}.yaml", system(named).Config
    quick = {name: value for name, value in QUICK.items() if name in kind.owners()}
    write_atomic(file, kind.preset(way, **quick).to_yaml())
    return {"preset": str(file)}


def run(notebook: Path, given: dict[str, Any] | None, folder: Path) -> str:
    """What becomes of a chapter with some parameters: "ok", "refused" or "failed"; "–" if there is nothing to run."""
    if given is None:
        return "–"
    if not is_current(folder, notebook):
        try:
            run_notebook(notebook, folder, given, page=False, go_on=True)
        except NotDone as error:
            tqdm.write(f"{folder.name}: {error}", file=sys.stderr)
    return read_chapter(folder).status


def main() -> int:
    """Run what is missing and print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.foreign", description=__doc__)
    parser.add_argument("--sets", nargs="+", metavar="SET", help=f"some of {', '.join([*SETS, *WAYS])} and the real ones")
    parser.add_argument("--chapters", nargs="+", metavar="NUMBER", help="e.g. 04 05b (default: all)")
    parser.add_argument("--jobs", type=int, default=2, help="how many at a time (default 2)")
    parser.add_argument("--out", type=Path, default=Path("build/test-data"), help="folder of the runs (default build/test-data)")
    given = parser.parse_args()
    os.environ |= {"MW_STATIC": "1", "OMP_NUM_THREADS": "1"}
    out = given.out.resolve()
    sets = make_sets(out / "sets") | real_sets()
    known = [*sets, *WAYS]
    if unknown := {*(given.sets or ())} - {*known}:
        parser.error(f"no sets {sorted(unknown)}; expected some of {', '.join(known)}")
    chosen = [name for name in known if given.sets is None or name in given.sets]
    notebooks = [find_notebook(number) for number in given.chapters] if given.chapters else course()
    notebooks.sort(key=lambda path: not path.stem.startswith(TRAINS))  # the others find its model made
    started, jobs = time.perf_counter(), [(path, name) for path in notebooks for name in chosen]
    with ThreadPoolExecutor(given.jobs) as pool:
        runs = pool.map(lambda job: run(job[0], changes(*job, sets, out), out / job[1] / job[0].stem), jobs)
        fates = dict(zip(jobs, tqdm(runs, "chapters", len(jobs), unit="chapter"), strict=True))
    width = max(map(len, chosen))
    print(f"{'chapter':30s}  {'  '.join(f'{name:{max(width, 7)}s}' for name in chosen)}")
    for path in sorted(notebooks):
        print(f"{path.stem:30s}  {'  '.join(f'{fates[path, name]:{max(width, 7)}s}' for name in chosen)}")
    print(f"{time.perf_counter() - started:.0f} s; mwlib claims {given.out}/SET says why, and which claims hold")
    return int(any(fate not in ("ok", "refused", "–") for fate in fates.values()))


if __name__ == "__main__":
    sys.exit(main())

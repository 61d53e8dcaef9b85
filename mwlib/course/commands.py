"""The course's part of ``python -m mwlib``. Jupyter's packages are imported by the command that needs them."""

from __future__ import annotations

import json
import logging
import os
import sys
from argparse import ArgumentParser, Namespace, _SubParsersAction
from pathlib import Path

import yaml

from mwlib import plots
from mwlib.checkpoint import write_atomic
from mwlib.comparison import METRICS
from mwlib.config import Config
from mwlib.course.files import NOTEBOOKS, ROOT, course, find_notebook
from mwlib.course.manifest import MANIFEST
from mwlib.course.parameters import ParameterError, from_text, read_parameters
from mwlib.grids import GRIDS, Grid, lines, measure, provenance, read_grids


def add_parser(subparsers: _SubParsersAction) -> None:
    """Register `run-notebook`, `execute-notebooks`, `learner-copies` and `index-page`."""
    parser = subparsers.add_parser("run-notebook", help="run one notebook with other parameters")
    parser.add_argument("notebook", help="a path, a name, or two digits")
    parser.add_argument(
        "--out", type=Path, help="folder for the results; default: build/runs/<notebook>-<hash of the parameters>"
    )
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="one parameter; may be repeated")
    parser.add_argument("--parameters", type=Path, metavar="FILE", help="a YAML file of parameters; --set wins over it")
    parser.set_defaults(run=_run)

    parser = subparsers.add_parser(
        "run-experiment", help="run one row of a grid of figures/grids.yaml, at one seed, by papermill"
    )
    parser.add_argument("grid", help="its id, e.g. table_4")
    parser.add_argument("row", type=int, help="its number, from 0")
    parser.add_argument("seed", type=int)
    _grid_options(parser)
    parser.set_defaults(run=_experiment)

    parser = subparsers.add_parser("grid-table", help="write the table of a grid, computing the rows that are missing")
    parser.add_argument("grid", help="its id, e.g. table_4")
    _grid_options(parser)
    parser.set_defaults(run=_grid_table)

    parser = subparsers.add_parser("execute-notebooks", help="execute the committed notebooks in place and filter their outputs")
    parser.add_argument("notebooks", nargs="*", help="paths, names or two digits; default: the whole course")
    parser.set_defaults(run=_execute)

    parser = subparsers.add_parser("learner-copies", help="write copies of the notebooks without the solutions")
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "learner", help="folder; default: build/learner")
    parser.set_defaults(run=_learner)

    parser = subparsers.add_parser("index-page", help="write index.html for a folder of notebook runs")
    parser.add_argument("build", type=Path, help="folder with one sub-folder per notebook, as run-notebook leaves them")
    parser.add_argument("--notebooks", type=Path, default=NOTEBOOKS, help="folder of the notebooks; default: the course")
    parser.add_argument("--manifest", type=Path, default=MANIFEST)
    parser.set_defaults(run=_index)


def _prepare() -> None:
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # several notebooks run side by side
    os.environ["MW_STATIC"] = "1"
    logging.getLogger("papermill").setLevel(logging.ERROR)  # names and types are checked here, before papermill sees them


def _grid_options(parser: ArgumentParser) -> None:
    parser.add_argument("--preset", default="tiny", help="default: tiny")
    parser.add_argument("--data", default="", help="a source that load_motions reads; default: the preset's own")
    parser.add_argument("--grids", type=Path, default=GRIDS, help="default: figures/grids.yaml")
    parser.add_argument("--out", type=Path, required=True, help="folder for the results")


def _run(args: Namespace) -> int:
    from mwlib.course.worker import NotDone, run_notebook

    _prepare()
    try:
        notebook = find_notebook(args.notebook)
        given = (yaml.safe_load(args.parameters.read_text()) or {}) if args.parameters else {}
        offered = read_parameters(json.loads(notebook.read_text(encoding="utf-8")))
        print(run_notebook(notebook, args.out, {**given, **from_text(offered, args.set)}))
    except (NotDone, ParameterError, FileNotFoundError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def _experiment(args: Namespace) -> int:
    from mwlib.course.worker import NotDone, run_experiment

    _prepare()
    try:
        grid = _grid(args)
        print(run_experiment(grid, args.row, args.seed, args.preset, args.data, args.out))
    except (NotDone, ParameterError, ValueError, LookupError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def _grid_table(args: Namespace) -> int:
    grid = _grid(args)
    cfg = Config.preset(args.preset, **({"data": args.data} if args.data else {}))
    found = measure(grid, cfg, progress=True)
    about = provenance(grid, cfg, found) | {"preset": args.preset}
    plots.save_table(lines(found, METRICS, errors=True), args.out, grid.id, provenance=about)
    table = plots.results_table(lines(found, METRICS))
    write_atomic(args.out / f"{grid.id}.md", f"{table}\n")
    print(table)
    return 0


def _grid(args: Namespace) -> Grid:
    known = read_grids(args.grids)
    if args.grid not in known:
        raise SystemExit(f"no grid {args.grid!r}; {args.grids} has {', '.join(known)}")
    return known[args.grid]


def _execute(args: Namespace) -> int:
    from nbclient.exceptions import CellExecutionError, DeadKernelError

    from mwlib.course.execute import execute_notebook

    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ["MW_STATIC"] = "1"  # nothing of a widget is kept, and nbclient may wait for one for ever
    failed = 0
    for path in [find_notebook(name) for name in args.notebooks] or course():
        try:
            execute_notebook(path)
            print(f"{path.stem}: executed, {path.stat().st_size / 1000:.0f} kB")
        except (CellExecutionError, DeadKernelError) as error:
            failed = 1
            print(f"{path.stem}: left as it was\n{error}", file=sys.stderr)
    return failed


def _learner(args: Namespace) -> int:
    from mwlib.course.learner import write_learner_copies

    written = write_learner_copies(args.out, course())
    print(f"{len(written)} notebooks written to {args.out}; those that were there already are kept")
    return 0


def _index(args: Namespace) -> int:
    from mwlib.course.index import write_index

    print(write_index(args.build, course(args.notebooks), args.manifest))
    return 0

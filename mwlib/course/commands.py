"""The course's part of the command line. Jupyter's packages are imported by the command that needs them."""

from __future__ import annotations

import logging
import os
import sys
from argparse import ArgumentParser, Namespace, _SubParsersAction
from pathlib import Path

from mwlib.course.manifest import MANIFEST
from mwlib.course.notebooks import (
    NOTEBOOKS,
    TIMEOUT,
    course,
    find_notebook,
    from_text,
    read_notebook,
    read_parameters,
    read_values,
)
from mwlib.course.working_copy import lay_out, told
from mwlib.experiments.grid_options import chosen_grid, given_changes, grid_options
from mwlib.paths import CHECKOUT, PACKAGED, home
from mwlib.version import __version__


def add_parser(subparsers: _SubParsersAction) -> None:
    """Register the commands about notebooks."""
    _add_notebook_commands(subparsers)
    _add_experiment_command(subparsers)


def _add_notebook_commands(subparsers: _SubParsersAction) -> None:
    text = "lay out a working copy of the course: notebooks, grids, committed results, Snakefile"
    parser = subparsers.add_parser("course", help=text, description=f"{text.capitalize()}. Nothing that exists is overwritten.")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="made if missing")
    parser.set_defaults(run=_course)

    parser = subparsers.add_parser("run-notebook", help="run one notebook with other parameters")
    parser.add_argument("notebook", help="a path, a name, or a number: 05, 05b")
    parser.add_argument(
        "--out", type=Path, help="folder for the results; default: build/runs/<notebook>-<hash of the parameters>"
    )
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="one parameter; may be repeated")
    parser.add_argument("--parameters", type=Path, metavar="FILE", help="a YAML file of parameters; --set wins over it")
    _add_timeout(parser)
    parser.set_defaults(run=_run)

    parser = subparsers.add_parser("execute-notebooks", help="execute the committed notebooks in place and filter their outputs")
    parser.add_argument("notebooks", nargs="*", help="paths, names or numbers; default: the whole course")
    parser.set_defaults(run=_execute)

    parser = subparsers.add_parser("learner-copies", help="write copies of the notebooks without the solutions")
    parser.add_argument("--out", type=Path, default=home() / "build" / "learner", help="folder; default: build/learner")
    parser.set_defaults(run=_learner)

    parser = subparsers.add_parser("index-page", help="write index.html for a folder of notebook runs")
    parser.add_argument("build", type=Path, help="folder with one sub-folder per notebook, as run-notebook leaves them")
    parser.add_argument("--notebooks", type=Path, default=NOTEBOOKS, help="folder of the notebooks; default: the course")
    parser.add_argument("--manifest", type=Path, default=MANIFEST)
    text = "a parameter that every notebook of the build was to get; one that got another is shown as out of date"
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help=text)
    parser.set_defaults(run=_index)

    text = "lay out what Sphinx turns into the site: chapters, exhibits, texts, pages of the library"
    parser = subparsers.add_parser("site-sources", help=text, description=f"{text.capitalize()}. `make site` runs both.")
    parser.add_argument("folder", type=Path, help="where to; made if missing")
    parser.set_defaults(run=_site)


def _add_experiment_command(subparsers: _SubParsersAction) -> None:
    parser = subparsers.add_parser(
        "run-experiment", help="run one row of a grid of figures/grids.yaml, at one seed, by papermill"
    )
    parser.add_argument("grid", help="its id, e.g. table_4")
    parser.add_argument("row", type=int, help="its number, from 0")
    parser.add_argument("seed", type=int)
    grid_options(parser)
    _add_timeout(parser)
    parser.set_defaults(run=_experiment)


def _add_timeout(parser: ArgumentParser) -> None:
    text = f"seconds for one cell, then the kernel is killed; default: {TIMEOUT:.0f}, a day"
    parser.add_argument("--timeout", type=float, default=TIMEOUT, metavar="SECONDS", help=text)


def _course(args: Namespace) -> int:
    print(told(args.folder, lay_out(args.folder), __version__))
    return 0


def _prepare() -> None:
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # several notebooks run side by side
    os.environ["MW_STATIC"] = "1"
    logging.getLogger("papermill").setLevel(logging.ERROR)  # names and types are checked here, before papermill sees them


def _run(args: Namespace) -> int:
    from mwlib.course.execute import NotDone, run_notebook

    _prepare()
    try:
        notebook = find_notebook(args.notebook)
        given = read_values(args.parameters) if args.parameters else {}
        offered = read_parameters(read_notebook(notebook))
        print(run_notebook(notebook, args.out, {**given, **from_text(offered, args.set)}, args.timeout))
    except NotDone as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def _experiment(args: Namespace) -> int:
    from mwlib.course.execute import NotDone, run_experiment

    _prepare()
    try:
        print(run_experiment(chosen_grid(args), args.row, args.seed, args.preset, given_changes(args), args.out, args.timeout))
    except (NotDone, LookupError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def _execute(args: Namespace) -> int:
    from nbclient.exceptions import CellExecutionError, DeadKernelError

    from mwlib.course.execute import execute_notebook

    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ["MW_STATIC"] = "1"  # nothing of a widget is kept, and nbclient may wait for one for ever
    paths, failed = [find_notebook(name) for name in args.notebooks] or course(), 0
    if any(path.is_relative_to(PACKAGED) for path in paths):
        raise ValueError("the notebooks of an installed mwlib stay as they are; expected a copy: `mwlib course FOLDER`, cd there")
    for path in paths:
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
    from mwlib.course.exhibits import write_index

    print(write_index(args.build, course(args.notebooks), args.manifest, args.set))
    return 0


def _site(args: Namespace) -> int:
    from mwlib.course.site import write_site_sources

    print(f"{len(write_site_sources(args.folder, CHECKOUT))} files for Sphinx in {args.folder}")
    return 0

"""Commands on notebooks: course, run-notebook, execute-notebooks, learner-copies, index-page, site-sources, run-experiment.

Jupyter's packages are imported by the command that needs them, and none imports torch: notebooks run in kernels of their own.
"""

import logging
import os
import sys
from collections.abc import Sequence
from json import dumps
from pathlib import Path
from typing import Any

from mwlib import paths
from mwlib.cli import options
from mwlib.cli.options import Repeated
from mwlib.course import notebooks as chapters
from mwlib.experiments.grids import row_parameters
from mwlib.version import __version__


def course(folder: Path) -> None:
    """Lay out a working copy of the course: notebooks, grids, committed results, Snakefile.

    Nothing that exists is overwritten.

    Args:
        folder: made if missing.
    """
    print(chapters.told(folder, chapters.lay_out(folder), __version__))


def run_notebook(
    notebook: str,
    *,
    out: Path | None = None,
    set: Repeated[str] = (),
    parameters: Path | None = None,
    timeout: float = chapters.TIMEOUT,
    go_on: bool = False,
    column: str = "",
    font: str = "",
) -> int:
    """Run one notebook with other parameters.

    Args:
        notebook: a path, a name, or a number: 5, 05, 5b.
        out: folder for the results (default: build/runs/<notebook>-<hash of the parameters>); what an earlier run of the notebook
            left there goes before this one begins.
        set: one parameter; may be repeated.
        parameters: a YAML file of parameters; --set wins over it.
        timeout: seconds for one cell, then the kernel is killed (default: 86400, a day).
        go_on: a notebook that does not get to its end leaves a metrics.json that says why, and the exit code is 0.
        column: width of a paper's column that PDFs of pictures are to fit, such as 3.3in or 84mm (default: as drawn, or what
            MWLIB_COLUMN says).
        font: of the PDFs' texts, such as STIXGeneral, which is like Times (default: DejaVu Sans, or what MWLIB_FONT says).
    """
    from mwlib.course.execute import NotDone, run_notebook
    from mwlib.plots import printing

    _prepare()
    os.environ |= {name: said for name, said in ((printing.COLUMN, column), (printing.FONT, font)) if said}
    for check in (printing.column, printing.fonts):  # refused before anything runs
        check()
    try:
        path = chapters.find_notebook(notebook)
        given = chapters.read_values(parameters) if parameters else {}
        offered = chapters.read_parameters(chapters.read_notebook(path))
        print(run_notebook(path, out, {**given, **chapters.from_text(offered, set)}, timeout, go_on=go_on))
    except NotDone as error:
        print(error, file=sys.stderr)
        return int(not go_on)
    return 0


def execute_notebooks(notebooks: Sequence[str] = ()) -> int:
    """Execute the committed notebooks in place and filter their outputs.

    Args:
        notebooks: paths, names or numbers (default: the whole course).
    """
    from nbclient.exceptions import CellExecutionError, DeadKernelError

    from mwlib.course.execute import execute_notebook

    _prepare()
    found, failed = [chapters.find_notebook(name) for name in notebooks] or chapters.course(), 0
    if any(path.is_relative_to(paths.PACKAGED) for path in found):
        raise ValueError("the notebooks of an installed mwlib stay as they are; expected a copy: `mwlib course FOLDER`, cd there")
    for path in found:
        try:
            execute_notebook(path)
            print(f"{path.stem}: executed, {path.stat().st_size / 1000:.0f} kB")
        except (CellExecutionError, DeadKernelError) as error:
            failed = 1
            print(f"{path.stem}: left as it was\n{error}", file=sys.stderr)
    return failed


def learner_copies(*, out: Path | None = None) -> None:
    """Write copies of the notebooks without the solutions.

    Args:
        out: folder (default: build/learner).
    """
    from mwlib.course.learner import write_learner_copies

    out = out or paths.home() / "build" / "learner"
    written = write_learner_copies(out, chapters.course())
    print(f"{len(written)} notebooks written to {out}; those that were there already are kept")


def index_page(
    build: Path, *, notebooks: Path = chapters.NOTEBOOKS, manifest: Path = chapters.MANIFEST, set: Repeated[str] = ()
) -> None:
    """Write index.html for a folder of notebook runs.

    Args:
        build: folder with one sub-folder per notebook, as run-notebook leaves them.
        notebooks: folder of the notebooks (default: the course).
        manifest: list of the exhibits (default: figures/manifest.yaml).
        set: a parameter that every notebook of the build was to get; one that got another is shown as out of date; may be
            repeated.
    """
    from mwlib.course.exhibits import write_index

    print(write_index(build, chapters.course(notebooks), manifest, set))


def claims(builds: Sequence[Path], *, all: bool = False, json: bool = False, out: Path | None = None) -> int:
    """Say which of the course's claims hold on the motions of a build, and which chapters it lacks.

    Several builds are laid side by side. The exit code is 1 if a chapter failed or was not run; one that refused its data, as
    these lack what it needs, is no failure.

    Args:
        builds: folders that make figures made.
        all: show all claims (default: those that do not hold somewhere).
        json: write JSON: of each build and chapter its status, and all claims with what they rest on.
        out: a file to write the report into, instead of printing it.
    """
    from mwlib.course.claims import named, read_build, report, tree
    from mwlib.files import write_atomic

    names = [path.stem for path in chapters.course()]
    read = {name: read_build(build, names) for name, build in named(builds).items()}
    text = f"{dumps(tree(read), indent=1)}\n" if json else report(read, all)
    if out:
        write_atomic(out, text)
        print(out)
    else:
        print(text, end="")
    return int(any(chapter.status in ("failed", "not run") for build in read.values() for chapter in build.values()))


def site_sources(folder: Path) -> None:
    """Lay out what Sphinx turns into the site: chapters, exhibits, texts, pages of the library.

    `make site` runs both.

    Args:
        folder: where to; made if missing.
    """
    from mwlib.course.site import write_site_sources

    print(f"{len(write_site_sources(folder, paths.CHECKOUT))} files for Sphinx in {folder}")


def run_experiment(row: int, seed: int, *, timeout: float = chapters.TIMEOUT, **choice_of: Any) -> int:
    """Run one row of a grid of figures/grids.yaml, at one seed, by papermill.

    Args:
        row: its number, from 0.
        seed: of the sampling, and of the training where each row has its own.
        timeout: seconds for one cell, then the kernel is killed (default: 86400, a day).
    """
    from mwlib.course.execute import NotDone, run_notebook

    _prepare()
    try:
        grid, preset, changes, out = options.choice_of(**choice_of)
        print(run_notebook(chapters.EXPERIMENT, out, row_parameters(grid, row, seed, preset, changes), timeout))
    except (NotDone, LookupError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def _prepare() -> None:
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # several notebooks run side by side
    os.environ["MW_STATIC"] = "1"  # nothing of a widget is kept, and nbclient may wait for one for ever
    logging.getLogger("papermill").setLevel(logging.ERROR)  # names and types are checked here, before papermill sees them

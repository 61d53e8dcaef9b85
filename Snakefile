"""Every notebook, every figure and table: snakemake --cores 2 --config preset=tiny data=synthetic out=build/tiny-synthetic
The grids behind the tables alone: the same with the target `grids`; grids=my.yaml runs grids of your own.

A notebook that refuses the data, or fails, leaves a metrics.json that says why, and the others go on. `mwlib claims` on the
folder says what was made, what was not, and which claims hold. What failed is tried again by the next call.

On a cluster: the same with --executor slurm (and its plugin), or cluster-generic with a submit script. A notebook counts as done
if and only if run-notebook saw every cell run and wrote metrics.json; the executed notebook is the log, which stays when a run
fails. What changes presets, data files, sources or settings runs again what depends on them.
"""

import shlex
import sys
from pathlib import Path

from filelock import FileLock, Timeout
from snakemake.exceptions import WorkflowError

from mwlib.course.execute import print_settings
from mwlib.course.notebooks import EXPERIMENT, LONGEST, course, source_hash, write_hashes
from mwlib.course.notebooks import MANIFEST
from mwlib.experiments import read_grids, system
from mwlib.experiments.grids import grids_file, row_config, row_parameters
from mwlib.experiments.results import result_of
from mwlib.data.sources import data_fingerprint
from mwlib.hashing import digest, file_hash, package_hash
from mwlib.settings import parse_changes


def told(name, default=""):
    """A --config entry as text; Snakemake reads numbers into it."""
    return default if config.get(name) is None else str(config[name])


PRESET = told("preset", "tiny")
DATA = told("data", "" if "data" in config else "synthetic")  # empty: the preset's own
HERE = Path.cwd()  # relative paths are relative to where Snakemake was started
OUT = HERE / told("out", f"build/{PRESET}-{DATA.strip('/').replace('/', '-') or 'preset'}")
FOLDER = HERE / told("notebooks", "notebooks")
GRID_FILE = HERE / told("grids", str(grids_file()))
SET = shlex.split(told("set"))  # settings that the grids must not override: "test_windows=30 lr=1e-3"
GIVEN = ({"data": DATA} if DATA else {}) | parse_changes(SET)
TABLES = read_grids(GRID_FILE)
NAMES = [path.stem for path in course(FOLDER)]
RESULTS = [f"{name}/metrics.json" for name in NAMES]
TRAINING = "06_training"
LONG = rf"(?:{'|'.join(LONGEST)})_[^/]+"
MW = f"cd {shlex.quote(str(HERE))} && {shlex.quote(sys.executable)} -m mwlib"
NOTEBOOK = ["--set", f"preset={PRESET}", "--set", f"data={DATA}"]
ROW = ["--preset", PRESET, "--data", DATA, *(word for change in SET for word in ("--set", change)), "--grids", str(GRID_FILE)]

if workflow.overwrite_workdir is not None:
    raise WorkflowError(f"--directory is {workflow.overwrite_workdir}; leave it out: out=... is where everything is written")
if bad := [name for name in NAMES if {"{", "}"} & {*name}]:
    raise WorkflowError(f"notebooks are called {bad}; expected names without braces, which Snakemake takes for patterns")


def base(grid):
    """The configuration that a grid's rows change."""
    return system(grid.system).Config.preset(PRESET, **GIVEN)


def rows(grid):
    """Number and seed of every row of a grid at every seed."""
    return [(number, seed) for number, row in enumerate(grid.rows) for seed in grid.seeds(row, base(grid))]


def parts(grid):
    """The result of every row of a grid at every seed."""
    return [f"grids/{grid.id}/{number}-{seed}/metrics.json" for number, seed in rows(grid)]


def sources():
    """Every data source that a notebook or row of this build reads."""
    notebooks = system("prediction").Config.preset(PRESET, **({"data": DATA} if DATA else {}))
    changed = [base(grid).override(**{**grid.base, **row.changes}) for grid in TABLES.values() for row in grid.rows]
    return sorted({cfg.get("data") for cfg in (notebooks, *changed)})


def row_settings(wildcards):
    """What a row runs with, or why it cannot; a row whose settings stay is not run again, whatever else is in the file."""
    try:
        row = int(wildcards.row), int(wildcards.seed)
        return row_parameters(TABLES[wildcards.grid], *row, PRESET, GIVEN)
    except (LookupError, ValueError) as error:
        return str(error)


def training_first(wildcards):
    """Later notebooks use the run that 06 trains: after it they find it made, beside it they would only wait."""
    later = TRAINING in NAMES and wildcards.name > TRAINING
    return f"{TRAINING}/metrics.json" if later else []


def needed(wildcards):
    """Notebooks print the grids that were run before them; where a row takes less time than starting Python they do it all."""
    grids = [grid for grid in TABLES.values() if grid.notebook == wildcards.name and base(grid).training.train_steps > 1000]
    return [part for grid in grids for part in parts(grid)]


def one_training(wildcards):
    """Grids whose rows share the preset's own model wait for it."""
    return f"{TRAINING}/metrics.json" if TRAINING in NAMES and not TABLES[wildcards.grid].trains else []


def said(*names):
    """What files of .sources say. By its time alone one that changed after the clock was put back is older than results."""

    def read(wildcards):
        files = [OUT / ".sources" / f"{getattr(wildcards, name, name)}.sha256" for name in names]
        return digest([file.read_text(encoding="utf-8") for file in files])

    return read


if workflow.is_main_process:  # jobs on other machines find the files made
    AT_WORK = FileLock(OUT / ".lock")  # dies with this process, however it ends; Snakemake's own would stay behind a kill
    try:
        OUT.mkdir(parents=True, exist_ok=True)
        if not workflow.dryrun:
            AT_WORK.acquire(timeout=0)
    except Timeout:
        raise WorkflowError(f"another make or Snakemake is at work in {OUT}; wait for its end, or say another out")
    except OSError as error:
        raise WorkflowError(f"nothing can be written to {OUT}: {error.strerror}; say another out")
    for name in RESULTS:
        if result_of((OUT / name).parent).get("status") == "failed":
            (OUT / name).unlink()
    write_hashes(
        OUT / ".sources",
        {"mwlib": " ".join([package_hash(), *print_settings().values()]), "manifest": file_hash(MANIFEST), "grids": file_hash(GRID_FILE)}
        | {"data": "\n".join(f"{data_fingerprint(source)} {source}" for source in sources())}
        | {path.stem: source_hash(path) for path in (*course(FOLDER), EXPERIMENT)},
    )


onstart:
    # Job scripts hold paths and settings in double quotes, in which a shell would run $(...).
    texts = [str(HERE), str(OUT), workflow.main_snakefile, *map(str, config.values())]
    if workflow.non_local_exec and any({*"\"'`$\\"} & {*text} for text in texts):
        raise WorkflowError(f"one of {texts} holds a quote, $, ` or a backslash; expected none of them in the names of a cluster's jobs")


# Rules name files relative to OUT, whatever it is called: braces in a path of their own would be patterns to Snakemake.
workdir: str(OUT)


localrules:
    figures,
    index,
    grids,


rule figures:
    input:
        "index.html",
        RESULTS,  # by name: after an error the page is there, newer than every result that is


rule index:
    input:
        RESULTS,
        ".sources/manifest.sha256",
    output:
        "index.html",
    params:
        given=lambda wildcards: NOTEBOOK,  # a function, as braces in a plain list would be patterns
    shell:
        "{MW} index-page {OUT:q} --notebooks {FOLDER:q} {params.given:q}"


rule notebook:
    input:
        ".sources/{name}.sha256",
        ".sources/mwlib.sha256",
        ".sources/data.sha256",
        training_first,
        needed,
    output:
        "{name}/metrics.json",
    log:
        "{name}/notebook.ipynb",
    wildcard_constraints:
        name=rf"(?!{LONG})\d\d[a-z]?_[^/]+",
    params:
        said=said("name", "mwlib", "data"),
        given=lambda wildcards: NOTEBOOK,
        file=lambda wildcards: str(FOLDER / f"{wildcards.name}.ipynb"),
        out=lambda wildcards: str(OUT / wildcards.name),
    shell:
        "{MW} run-notebook {params.file:q} --go-on --out {params.out:q} {params.given:q}"


use rule notebook as long_notebook with:
    wildcard_constraints:
        name=LONG,
    priority: 1  # a long one that is begun last leaves the other jobs' cores idle


rule grids:
    input:
        expand("grids/{grid}.csv", grid=TABLES),


rule table:
    input:
        ".sources/grids.sha256",
        lambda wildcards: parts(TABLES[wildcards.grid]),
    output:
        "grids/{grid}.csv",
    params:
        said=said("grids"),
        given=lambda wildcards: ROW,
        out=lambda wildcards: str(OUT / "grids"),
    shell:
        "{MW} grid-table {wildcards.grid:q} {params.given:q} --out {params.out:q}"


rule experiment:
    input:
        f".sources/{EXPERIMENT.stem}.sha256",
        ".sources/mwlib.sha256",
        ".sources/data.sha256",
        one_training,
    output:
        "grids/{grid}/{row}-{seed}/metrics.json",
    log:
        "grids/{grid}/{row}-{seed}/notebook.ipynb",
    wildcard_constraints:
        row=r"\d+",
        seed=r"\d+",
    params:
        said=said(EXPERIMENT.stem, "mwlib", "data"),
        given=lambda wildcards: ROW,
        settings=row_settings,
        out=lambda wildcards: str(OUT / f"grids/{wildcards.grid}/{wildcards.row}-{wildcards.seed}"),
    shell:
        "{MW} run-experiment {wildcards.grid:q} {wildcards.row} {wildcards.seed} {params.given:q} --out {params.out:q}"


onerror:
    shell("{MW} index-page {OUT:q} --notebooks {FOLDER:q} {NOTEBOOK:q}")
    print(f"Not all notebooks got to their end. {OUT}/index.html shows what there is; */notebook.ipynb show what happened.")

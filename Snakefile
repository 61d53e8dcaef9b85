"""Every notebook, every figure and table: snakemake --cores 2 --config preset=tiny data=synthetic out=build/tiny-synthetic
The grids behind the tables alone: the same with the target `grids`; grids=my.yaml runs grids of your own.

On a cluster: the same with --executor slurm (and its plugin). A notebook counts as done if and only if its last cell
wrote metrics.json; the executed notebook is the log, which stays when a run fails.
"""

import shlex
import sys
from pathlib import Path

from mwlib.course.files import EXPERIMENT, course, write_source_hashes
from mwlib.course.manifest import MANIFEST
from mwlib.experiments import read_grids, system
from mwlib.experiments.grids import grids_file
from mwlib.settings import parse_changes

PRESET = config.get("preset", "tiny")
DATA = config.get("data", "synthetic")  # empty: the preset's own
OUT = config.get("out", f"build/{PRESET}-{DATA.strip('/').replace('/', '-') or 'preset'}")
FOLDER = Path(config.get("notebooks", "notebooks"))
MW = f"{shlex.quote(sys.executable)} -m mwlib"
NAMES = [path.stem for path in course(FOLDER)]
TRAINING = "06_training"
GRID_FILE = config.get("grids", grids_file())
SET = shlex.split(str(config.get("set", "")))  # settings that the grids must not override: "test_windows=30 lr=1e-3"
GIVEN = ({"data": DATA} if DATA else {}) | parse_changes(SET)
OPTIONS = " ".join(f"--set {shlex.quote(word)}" for word in SET)
TABLES = read_grids(Path(GRID_FILE))

# Hashes of sources, not the notebooks themselves: executing a notebook in place must not schedule everything again.
write_source_hashes(Path(OUT) / ".sources", [*course(FOLDER), EXPERIMENT])


def base(grid):
    """The configuration that a grid's rows change."""
    return system(grid.system).Config.preset(PRESET, **GIVEN)


def parts(grid):
    """The result of every row of a grid at every seed."""
    cfg = base(grid)
    cells = [(number, seed) for number, row in enumerate(grid.rows) for seed in grid.seeds(row, cfg)]
    return [f"{OUT}/grids/{grid.id}/{number}-{seed}/metrics.json" for number, seed in cells]


def training_first(wildcards):
    """Later notebooks use the run that 06 trains: after it they find it made, beside it they would only wait."""
    later = TRAINING in NAMES and wildcards.name > TRAINING
    return f"{OUT}/{TRAINING}/metrics.json" if later else []


def needed(wildcards):
    """Notebooks print the grids that were run before them; where a row takes less time than starting Python they do it all."""
    grids = [grid for grid in TABLES.values() if grid.notebook == wildcards.name and base(grid).training.train_steps > 1000]
    return [part for grid in grids for part in parts(grid)]


def one_training(wildcards):
    """Grids whose rows share the preset's own model wait for it."""
    return f"{OUT}/{TRAINING}/metrics.json" if TRAINING in NAMES and not TABLES[wildcards.grid].trains else []


rule index:
    input:
        expand("{out}/{name}/metrics.json", out=OUT, name=NAMES),
        MANIFEST,
    output:
        f"{OUT}/index.html",
    shell:
        "{MW} index-page {OUT:q} --notebooks {FOLDER:q}"


rule notebook:
    input:
        f"{OUT}/.sources/{{name}}.sha256",
        f"{OUT}/.sources/mwlib.sha256",
        training_first,
        needed,
    output:
        f"{OUT}/{{name}}/metrics.json",
    log:
        f"{OUT}/{{name}}/notebook.ipynb",
    wildcard_constraints:
        name=r"\d\d_\w+",
    params:
        folder=lambda wildcards, output: str(Path(output[0]).parent),
    shell:
        "{MW} run-notebook {FOLDER:q}/{wildcards.name}.ipynb --out {params.folder:q}"
        " --set preset={PRESET:q} --set data={DATA:q}"


rule grids:
    input:
        expand("{out}/grids/{grid}.csv", out=OUT, grid=TABLES),


rule table:
    input:
        lambda wildcards: parts(TABLES[wildcards.grid]),
    output:
        f"{OUT}/grids/{{grid}}.csv",
    shell:
        "{MW} grid-table {wildcards.grid} --preset {PRESET:q} --data {DATA:q} {OPTIONS} --grids {GRID_FILE:q} --out {OUT:q}/grids"


rule experiment:
    input:
        f"{OUT}/.sources/{EXPERIMENT.stem}.sha256",
        f"{OUT}/.sources/mwlib.sha256",
        GRID_FILE,
        one_training,
    output:
        f"{OUT}/grids/{{grid}}/{{row}}-{{seed}}/metrics.json",
    log:
        f"{OUT}/grids/{{grid}}/{{row}}-{{seed}}/notebook.ipynb",
    wildcard_constraints:
        row=r"\d+",
        seed=r"\d+",
    params:
        folder=lambda wildcards, output: str(Path(output[0]).parent),
    shell:
        "{MW} run-experiment {wildcards.grid} {wildcards.row} {wildcards.seed} --preset {PRESET:q} --data {DATA:q} {OPTIONS}"
        " --grids {GRID_FILE:q} --out {params.folder:q}"


onerror:
    shell("{MW} index-page {OUT:q} --notebooks {FOLDER:q}")
    print(f"Not all notebooks got to their end. {OUT}/index.html shows what there is; */notebook.ipynb show what happened.")

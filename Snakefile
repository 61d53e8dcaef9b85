"""Every notebook, every figure and table: snakemake --cores 2 --config preset=tiny data=synthetic out=build/tiny-synthetic

On a cluster: the same with --executor slurm (and its plugin). A notebook counts as done if and only if its last cell
wrote metrics.json; the executed notebook is the log, which stays when a run fails.
"""

import sys
from pathlib import Path

from mwlib.course.files import course, write_source_hashes
from mwlib.course.manifest import MANIFEST

PRESET = config.get("preset", "tiny")
DATA = config.get("data", "synthetic")  # empty: the preset's own
OUT = config.get("out", f"build/{PRESET}-{DATA.strip('/').replace('/', '-') or 'preset'}")
FOLDER = Path(config.get("notebooks", "notebooks"))
MW = f"{sys.executable} -m mwlib"
NAMES = [path.stem for path in course(FOLDER)]
TRAINING = "06_training"

# Hashes of sources, not the notebooks themselves: executing a notebook in place must not schedule everything again.
write_source_hashes(Path(OUT) / ".sources", course(FOLDER))


def training_first(wildcards):
    """Later notebooks use the run that 06 trains: after it they find it made, beside it they would only wait."""
    later = TRAINING in NAMES and wildcards.name > TRAINING
    return f"{OUT}/{TRAINING}/metrics.json" if later else []


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


onerror:
    shell("{MW} index-page {OUT:q} --notebooks {FOLDER:q}")
    print(f"Not all notebooks got to their end. {OUT}/index.html shows what there is; */notebook.ipynb show what happened.")

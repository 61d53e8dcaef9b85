# Needs Python >= 3.11 and make; everything else goes into .venv, made when missing and renewed when the dependencies change.
PYTHON ?= python3
PRESET ?= tiny
DATA ?= synthetic
OUT ?= build/$(PRESET)-$(subst /,-,$(or $(patsubst /%,%,$(DATA)),preset))
JOBS ?= 2
NB ?=
GRIDS ?= figures/grids.yaml

VENV := .venv
RUN := $(VENV)/bin/python
READY := $(VENV)/.ready

export OMP_NUM_THREADS ?= 1
export MWLIB_RUNS ?= $(CURDIR)/runs

.DEFAULT_GOAL := help
.PHONY: help figures grids test lab notebooks learner

help: ## show this list
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

figures: $(READY) ## run every notebook, make every figure and table: PRESET=tiny DATA=synthetic OUT=build/... JOBS=2
	$(RUN) -m snakemake --cores $(JOBS) --keep-going --rerun-incomplete --quiet progress rules \
		--config preset='"$(PRESET)"' data='"$(DATA)"' out='"$(OUT)"'
	@echo "Open $(OUT)/index.html"

grids: $(READY) ## run only the experiments behind the tables, and write these: same settings as figures, GRIDS=figures/grids.yaml
	$(RUN) -m snakemake grids --cores $(JOBS) --keep-going --rerun-incomplete --quiet progress rules \
		--config preset='"$(PRESET)"' data='"$(DATA)"' out='"$(OUT)"' grids='"$(GRIDS)"'
	@echo "Tables are in $(OUT)/grids"

test: $(READY) ## lint, unit tests, and every notebook executed and compared with its stored outputs
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	@rm -rf build/test-runs
	MW_STATIC=1 SOURCE_DATE_EPOCH=0 MWLIB_RUNS=$(CURDIR)/build/test-runs $(RUN) -m pytest -n 2 --dist loadfile \
		--nbval-lax --nbval-current-env --nbval-cell-timeout=300 --nbval-kernel-startup-timeout=120 notebooks tests

lab: $(READY) ## open JupyterLab on the first notebook
	$(RUN) -m jupyterlab notebooks/00_start_here.ipynb

notebooks: $(READY) ## execute the committed notebooks in place and filter their outputs: NB="02 07" for some only
	$(RUN) -m mwlib execute-notebooks $(NB)

learner: $(READY) ## write copies without the solutions to build/learner, keeping the ones already there
	$(RUN) -m mwlib learner-copies

$(READY): pyproject.toml constraints.txt
	@command -v $(PYTHON) >/dev/null || { echo "make: $(PYTHON) not found; install Python 3.11 or newer, or say PYTHON=/path/to/python" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
		echo "make: Python 3.11 or newer is needed; $(PYTHON) is $$($(PYTHON) --version 2>&1). Say PYTHON=/path/to/python3.11" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(RUN) -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[notebooks,dev]'
	@touch $(READY)

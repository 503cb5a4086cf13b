# Two commands on a fresh machine: `make run` and `make test`. Everything else is here too.
#
#   make run               install (first time), replay the play, print the verdict and where the bundle is
#                          (PLAY=demo, PLAYS=<folder of plays>, RESOLUTION=tiny|coarse)
#   make test              the whole test suite
#   make quick             the suite without its slow tests
#   make check             formatting, lint, types, spelling, workflow lint
#   make bench             speed: element cycles, roofline, peers where installed, start-up; an idle machine, please
#   make season            every play of config/plays.tsv: results/index.html (RESOLUTION=tiny|coarse)
#   make accuracy          both modes of reconstruction on motions of known truth; the table of docs/accuracy.md (long)
#   make report            the workflow's own report (needs a finished run)
#   make lock              resolve environment.lock again from pyproject.toml (needs uv)
#   make clean             remove results; `make distclean` also removes the environment

SHELL := /bin/bash
PLAY ?= demo
PLAYS ?=
RESOLUTION ?=
OVERRIDES := $(if $(PLAYS),plays_folder=$(PLAYS)) $(if $(RESOLUTION),resolution=$(RESOLUTION))
CONFIG := $(if $(strip $(OVERRIDES)),--config $(strip $(OVERRIDES)))
VENV := .venv
# An activated .venv is about to be replaced: its python is not the one to build the next from.
PYTHON ?= $(firstword $(shell PATH="$${PATH//$(CURDIR)\/.venv\/bin:/}" command -v python3.11 python3.12 python3.13 python3 2>/dev/null))
UV := $(shell command -v uv 2>/dev/null)
IN := source $(VENV)/bin/activate &&
READY := $(VENV)/.ready
# Two files of tests at a time; a file stays with one worker, which shares its fixtures.
SIDE_BY_SIDE := -n 2 --dist loadfile

.PHONY: run season test quick check bench accuracy report lock clean distclean install
.DEFAULT_GOAL := run

run: $(READY)
	$(IN) snakemake results/$(PLAY)/bundle/$(PLAY).zip $(CONFIG)
	@$(IN) replay verdict results/$(PLAY)

season: $(READY)
	$(IN) snakemake season --keep-going $(CONFIG)

test: $(READY)
	$(IN) pytest $(SIDE_BY_SIDE)

quick: $(READY)
	$(IN) pytest -m "not slow" $(SIDE_BY_SIDE)

check: $(READY)
	$(IN) ruff check . && ruff format --check .
	$(IN) snakefmt --check Snakefile workflow
	$(IN) mypy
	$(IN) codespell src tests docs workflow config *.md Makefile Snakefile
	$(IN) snakemake --lint

bench: $(READY)
	$(IN) python benchmarks/element_cycles.py 32 64 100
	$(IN) python benchmarks/roofline.py 64
	$(IN) python benchmarks/peers.py 32
	$(IN) python benchmarks/start_up.py

accuracy: $(READY)
	$(IN) cd benchmarks && python accuracy_suite.py run && python accuracy_suite.py table

report: $(READY)
	$(IN) snakemake results/$(PLAY)/bundle/$(PLAY).zip --report results/$(PLAY)/workflow-report.zip $(CONFIG)

install: $(READY)

# The environment is made aside and takes its name when it is complete: a broken download leaves nothing half-installed.
$(READY): environment.lock pyproject.toml
	@echo "installing the locked environment into $(VENV) (once; a few minutes with pip, less than one with uv)"
	@rm -rf $(VENV)
ifneq ($(UV),)
	$(UV) venv --quiet --python $(PYTHON) $(VENV)
	$(UV) pip install --quiet --python $(VENV)/bin/python --require-hashes -r environment.lock
	$(UV) pip install --quiet --python $(VENV)/bin/python --no-deps --no-build-isolation -e .
else
	$(PYTHON) -m venv $(VENV)
	$(VENV)/bin/pip install --quiet --disable-pip-version-check --require-hashes -r environment.lock
	$(VENV)/bin/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
endif
	@touch $(READY)

lock:
	uv pip compile --universal --generate-hashes --python-version 3.11 --extra dev \
	    --custom-compile-command "make lock" pyproject.toml -o environment.lock

clean:
	rm -rf results .snakemake

distclean: clean
	rm -rf $(VENV) .numba_cache .pytest_cache .ruff_cache .mypy_cache

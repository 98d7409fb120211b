# Needs make and Python 3.11 or later. PYTHON=python3.12 make test takes another one; VENV=... another place.
PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11 python; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
BENCH := $(VENV)/bench
WORLD ?= paper/rooms
SEEDS ?= 100

.PHONY: help run test check bench reproduce clean
.DEFAULT_GOAL := help

help: ## show this
	@sed -n 's/^\([a-z]*\):.*## /  make \1\t/p' $(MAKEFILE_LIST) | expand -t 18

run: $(READY) ## explore a building (WORLD=paper/rooms) and write a report
	$(BIN)/sonar-explore run $(WORLD)

test: $(READY) ## run the tests
	$(BIN)/python -m pytest -n auto

check: $(READY) ## lint, format, types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

bench: $(BENCH)/.ready ## measure, in an environment of its own
	$(BENCH)/bin/python -m pytest benchmarks -o addopts= -o python_files='bench_*.py' -o python_functions='bench_*' \
		--benchmark-columns=min,median,rounds --benchmark-sort=name

reproduce: $(READY) ## the paper's runs over 100 seeds (SEEDS=...); can be stopped and taken up
	$(BIN)/sonar-explore reproduce --seeds $(SEEDS)
	$(BIN)/python -m sonar_explore.studies.document runs/reproduce

clean: ## remove what make and Python made, the environment too; keeps runs/
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(BENCH)/.ready: $(READY)
	[ -x $(BENCH)/bin/python ] || $(BIN)/python -m venv $(BENCH)
	$(BENCH)/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[bench]'
	@touch $@

# One environment, made once, and brought up to date when the dependencies change.
$(READY): pyproject.toml
	@[ -n "$(PYTHON)" ] || { echo "no Python 3.11 or later found; say PYTHON=..." >&2; exit 1; }
	@echo "setting up $(VENV): a minute or two, the first time"
	[ -x $(BIN)/python ] || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

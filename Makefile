# Everything works from a bare clone with Python 3.11-3.13 and make: the targets that need the environment build it first.
#
#   make setup      build .venv with all that demo and test need; a second call does nothing until pyproject.toml changes
#   make demo       the main job on the data that ship with the package
#   make test       the gate: style, types, layers, documentation, tests
#   make test-all   the same with the slow tests, and more examples for each property
#   make bench      the benchmarks, one process
#   make docs       the documentation as HTML, in docs/_build/html
#   make figures    draw the pictures of the documentation anew (examples, tutorials, effects): some minutes
#   make blind      the sealed trial, 400 cases: two hours; goes on where it was; writes docs/blind_results_table.md (SEED=2: another one)
#   make format     put the code in the house style
#
# Choose the interpreter with PYTHON=/path/to/python3.12, the number of test processes with JOBS=4.

BIN := .venv/bin
STAMP := .venv/.setup-done
JOBS ?= 2

# Another environment's modules must not leak into this one; BLAS threads would fight with the test processes.
unexport PYTHONPATH PYTHONHOME
test test-all: export OMP_NUM_THREADS := 1
test test-all: export OPENBLAS_NUM_THREADS := 1

SPHINX := $(BIN)/sphinx-build -q -W --keep-going -j $(JOBS) -d docs/_build/doctrees
PYTEST := $(BIN)/pytest -n $(JOBS) --benchmark-disable --doctest-modules cutvib_ss tests

.PHONY: help setup demo test test-all bench docs figures blind format checks style types layers docs-check
.DEFAULT_GOAL := help

help:
	@sed -n 's/^#   //p' Makefile

setup: $(STAMP)

$(STAMP): pyproject.toml
	@python=$$(./.ci/find-python) || exit 1; \
	if [ -n "$(PYTHON)" ] || ! PYTHON=$(BIN)/python ./.ci/find-python >/dev/null 2>&1; then \
	    echo "Building .venv with $$python ($$($$python --version))"; \
	    "$$python" -m venv --clear .venv || exit 1; \
	fi
	@echo "Installing cutvib_ss and its dependencies into .venv (a minute or two the first time)"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

demo: $(STAMP)
	$(BIN)/cutvib demo

test: checks
	$(PYTEST) -m "not slow and not benchmark"

test-all: checks
	HYPOTHESIS_PROFILE=thorough $(PYTEST) -m "not benchmark"

bench: $(STAMP)
	$(BIN)/pytest -n 0 -s -m benchmark tests

docs: $(STAMP)
	@rm -rf docs/api
	$(SPHINX) -b html docs docs/_build/html
	@echo "Open docs/_build/html/index.html"

figures: $(STAMP)
	$(BIN)/python docs/make_figures.py
	$(BIN)/python docs/make_signatures.py

# Trials lie in build/trials; their names end in their seeds. Baselines learn from the trial fit-1001, where it is there.
TRIALS := build/trials
TRIAL_CASES ?= 400
MIX ?= none=150,outside=60,pair=40
SEED ?= 1
blind: export OMP_NUM_THREADS := 1
blind: export OPENBLAS_NUM_THREADS := 1

blind: $(STAMP)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[trial]'
	@mkdir -p $(TRIALS)
	$(BIN)/cutvib blind run --cases $(TRIAL_CASES) --seed $(SEED) --mix $(MIX) --out $(TRIALS)/sealed-$(SEED) --jobs $(JOBS)
	$(BIN)/cutvib blind score $(TRIALS)/sealed-$(SEED) --jobs $(JOBS) --json $(TRIALS)/score-$(SEED).json \
	    --report $(TRIALS)/score-$(SEED).html --report docs/blind_results_table.md \
	    $(addprefix --baselines ,$(wildcard $(TRIALS)/fit-1001))

format: $(STAMP)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# --- the parts of the gate -------------------------------------------------------------------------------------------

checks: $(STAMP)
	@$(MAKE) --no-print-directory -j $(JOBS) style types layers docs-check

style: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(STAMP)
	$(BIN)/mypy

layers: $(STAMP)
	$(BIN)/lint-imports --no-logo --cache-dir build/import-linter

# Reads every page and docstring, resolves every reference, writes no HTML. Pages of modules that are gone go too.
docs-check: $(STAMP)
	@rm -rf docs/api
	$(SPHINX) -b dummy docs docs/_build/dummy

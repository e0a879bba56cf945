# make demo      responses, branches, a border and an isola of the reference oscillator: tables, pictures in ./demo
# make test      lint, then the tests (about a quarter of an hour on two cores)
# make test-all  lint, then all tests, the long ones too
# make lint      ruff and mypy
# make docs      the documentation as a site, docs/_build/html; runs the examples (some minutes the first time)
# make clean     remove the environment and everything generated
#
# Needs Python (3.11 or newer) and make. Everything is installed into .venv of this folder: by `make demo` what a user
# needs, by `make test` and `make docs` what developers need besides.
# Another interpreter: make PYTHON=/path/to/python ...

SHELL := /bin/sh
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
DEVELOPERS := $(VENV)/.developers
# What is installed is compiled by Python module by module when it is first imported, most of it never.
INSTALL := $(BIN)/python -m pip install --disable-pip-version-check --no-compile --editable
DEMO := demo

# One BLAS thread: the matrices are small, and threads that wait for each other cost more than they give.
export OMP_NUM_THREADS := 1
export OPENBLAS_NUM_THREADS := 1
export MKL_NUM_THREADS := 1
export MPLBACKEND := Agg
# Tests are compiled once, not at every run: with this set their modules take 15 s of each process.
unexport PYTHONDONTWRITEBYTECODE

# Two processes, each file of tests in one of them: what a module computes once for its tests stays together.
TOGETHER := -n 2 --dist loadfile

.PHONY: demo test test-all lint docs format clean

demo: $(STAMP)
	@$(BIN)/suboctave demo --out $(DEMO)

test: lint
	@$(BIN)/python -m pytest $(TOGETHER) -m "not slow"

test-all: lint
	@$(BIN)/python -m pytest $(TOGETHER)

lint: $(DEVELOPERS)
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy

docs: $(VENV)/.docs
	@echo "Running the examples and writing the site: some minutes the first time, then what has changed ..."
	@$(BIN)/python -m sphinx -b html -d docs/_build/doctrees -W --keep-going -n docs docs/_build/html
	@echo "open docs/_build/html/index.html"

format: $(DEVELOPERS)
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .

# An interpreter counts when it runs, is in the range of pyproject.toml and can make environments:
# a name on the PATH may be a placeholder that fails when it is called.
$(STAMP): pyproject.toml
	@found="$(PYTHON)"; \
	if [ -z "$$found" ]; then \
	  for name in python3.13 python3.12 python3.11 python3.14 python3.15 python3 python; do \
	    if $$name -c 'import sys, venv, ensurepip; sys.exit(not (3, 11) <= sys.version_info[:2] < (3, 16))' \
	        >/dev/null 2>&1; then found=$$name; break; fi; \
	  done; \
	fi; \
	if [ -z "$$found" ]; then \
	  echo "suboctave needs Python 3.11 to 3.15; none that runs was found on the PATH." >&2; \
	  echo "Install one, or name it: make PYTHON=/path/to/python" >&2; exit 1; \
	fi; \
	echo "Installing into $(VENV) with $$($$found --version): about 620 MB on disk, 170 MB to download ..."; \
	$$found -m venv --clear $(VENV) \
	  && $(INSTALL) . \
	  && du -sh $(VENV) | awk '{ print $$1 " installed in $(VENV)" }' \
	  && echo "Compiling the numerical kernels, once: about a minute ..." \
	  && $(BIN)/suboctave compile \
	  && touch $(STAMP)

$(DEVELOPERS): $(STAMP)
	@echo "Installing what tests and lint need besides: about 120 MB ..."
	@$(INSTALL) '.[dev]' && touch $@

$(VENV)/.docs: $(DEVELOPERS)
	@echo "Installing what the site needs besides: about 60 MB ..."
	@$(INSTALL) '.[dev,docs]' && touch $@

clean:
	rm -rf $(VENV) $(DEMO) docs/_build docs/examples build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .benchmarks
	find src tests -name __pycache__ -type d -prune -exec rm -rf {} +

# Two commands for a fresh machine: `make compare` and `make test`. Each target sets up .venv first.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed

.PHONY: compare test lint types studies study coverage rllib bench bitcode pythons docs pages dist clean

compare: $(INSTALLED)
	$(BIN)/hybridtrack compare $(ARGS)

test: lint types
	$(BIN)/python -m pytest -n auto --maxprocesses 8 --dist worksteal $(ARGS)

lint: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/codespell
	$(BIN)/python -m tools.house

types: $(INSTALLED)
	$(BIN)/mypy

# every study in its quick form, and the tests of the studies
studies: $(INSTALLED)
	$(BIN)/python -m pytest studies -n auto --maxprocesses 8 --dist worksteal $(ARGS)

# long statistical tests and attacks, then the quick tests with every index of compiled code checked
study: $(INSTALLED)
	$(BIN)/python -m pytest -m study -n auto --maxprocesses 8 --dist worksteal --durations 30 $(ARGS)
	NUMBA_BOUNDSCHECK=1 NUMBA_CACHE_DIR=$(CURDIR)/$(VENV)/checked $(BIN)/python -m pytest -n auto --maxprocesses 8 --dist worksteal $(ARGS)

# lines of the three packages that the quick tests run; compiled functions are left out
coverage: $(INSTALLED)
	$(BIN)/python -m pytest -n auto --maxprocesses 8 --cov --cov-report=term $(ARGS)

# RLlib, which needs an older Gymnasium, in an environment of its own
rllib:
	$(PYTHON) -m venv $(VENV)-rllib
	grep -v '^gymnasium=' constraints.txt > $(VENV)-rllib/constraints.txt
	$(VENV)-rllib/bin/python -m pip install --disable-pip-version-check -q -c $(VENV)-rllib/constraints.txt -e . pytest 'ray[rllib]' torch
	$(VENV)-rllib/bin/python -m pytest tests/agents/rllib.py

# speed beside CartPole and filterpy: make bench ARGS="single vector"
bench: $(INSTALLED)
	$(BIN)/python -m tools.bench $(ARGS)

# what the wheel has and a clone has not: kernels for a first step in 1 to 2 s, which copies of the folder share
bitcode: $(INSTALLED)
	$(BIN)/python -m tools.bitcode

# the quick tests with every other Python that is at hand, each in an environment of its own
OTHER_PYTHONS ?= python3.12 python3.13 python3.14
pythons:
	@for python in $(OTHER_PYTHONS); do \
	  if name=$$($$python -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null); then \
	    $(MAKE) test PYTHON=$$python VENV=.venv-$$name || exit 1; \
	  else echo "$$python is not at hand"; fi; \
	done

# the site, with its examples: open docs/_build/html/index.html
docs: $(INSTALLED)-docs
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build/html
	@echo docs/_build/html/index.html

# the pages of the site with their links, without running examples and the notebook; no page is written
pages: $(INSTALLED)-docs
	$(BIN)/python -m sphinx -W --keep-going -q -b dummy -D plot_gallery=0 -D nb_execution_mode=off docs docs/_build/pages

# wheel and source distribution with bitcode, checked as the package index checks them
dist:
	$(PYTHON) -m venv $(VENV)-dist
	$(VENV)-dist/bin/python -m pip install --disable-pip-version-check -q -c constraints.txt build twine -e .
	rm -rf dist
	$(VENV)-dist/bin/python -m tools.bitcode
	$(VENV)-dist/bin/python -m build
	$(VENV)-dist/bin/python -m twine check --strict dist/*

$(INSTALLED)-docs: $(INSTALLED)
	$(BIN)/python -m pip install --disable-pip-version-check -q -c constraints.txt -e '.[all,dev,docs]'
	@touch $@

$(INSTALLED): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "$(PYTHON) is too old: Python 3.11 or newer is needed, say which with PYTHON=..."; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --disable-pip-version-check -q -c constraints.txt -e '.[all,dev]'
	@touch $@

clean:
	rm -rf hybrid_env/core/*.bc.xz $(VENV) .venv-* .coverage build dist *.egg-info docs/_build docs/gallery docs/api/generated docs/api/examples
	find . -name __pycache__ -prune -exec rm -rf {} +

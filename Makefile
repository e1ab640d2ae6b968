# Everything from a clean clone: needs Python 3.11, nothing else. `make help` lists the targets.

PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
SOURCES := stitching orchestrator sweeps analysis tests docs

.PHONY: help setup reproduce test campaign lint bench docs wheel clean browser constraints

help:  ## list the targets
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 14

setup: $(VENV)/.installed  ## make the virtual environment

# torch goes first and alone: with it in place, nothing pulls another build of it.
$(VENV)/.installed: pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet torch==2.13.0 --constraint constraints.txt
	$(BIN)/pip install --quiet --editable '.[dev]' --constraint constraints.txt
	touch $@

reproduce: setup  ## Table 1 at full scale; resumes when run again
	$(BIN)/skillstitch run table1 --scale paper --results results

test: setup browser  ## all tests, the slow tail included
	$(BIN)/pytest -n 2 --dist worksteal

campaign: setup  ## every fault we know of, thousands of times, in at most 20 minutes
	$(BIN)/python -m tests.campaign

lint: setup  ## style and types
	$(BIN)/ruff check $(SOURCES)
	$(BIN)/ruff format --check $(SOURCES)
	$(BIN)/mypy

bench: setup  ## ratios that the documentation quotes, each within one run
	$(BIN)/python -m tests.bench

docs: $(VENV)/.docs  ## these pages as a site, with an API reference, in site/
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

$(VENV)/.docs: $(VENV)/.installed
	$(BIN)/pip install --quiet --editable '.[docs]' --constraint constraints.txt
	touch $@

wheel: setup  ## a wheel in dist/
	rm -rf build  # what an earlier one left would be packed, too
	$(BIN)/pip wheel --quiet --no-deps --wheel-dir dist .

clean:  ## delete what builds and checks leave; runs/ and the environment stay
	rm -rf build dist site *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -not -path './$(VENV)/*' -prune -exec rm -rf {} +

# The report is tested in a real browser; Debian's is the one that needs no download of its own.
browser:
	@if command -v chromium >/dev/null; then :; \
	elif [ "$$(id -u)" = 0 ]; then \
		apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium; \
	else \
		echo "no chromium, and only root can install it: the tests of reports in a browser are skipped"; \
	fi

constraints: $(VENV)/.docs
	(echo "# Exact versions that this revision is tested with. Written by 'make constraints'."; \
	 $(BIN)/pip freeze --exclude-editable | sed 's/+cpu$$//') > constraints.txt

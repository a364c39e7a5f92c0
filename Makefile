# Set-up is part of every target: a bare machine with Python 3.11+ needs nothing else.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: demo test check clean

demo: $(READY)  ## simulated town to HTML report
	$(BIN)/semgrid-eval demo

test: $(READY)  ## the whole suite
	$(BIN)/python -m pytest -n auto

check: $(READY)  ## lint, format and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

$(READY): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable '.[synthetic,dev]'
	touch $@

clean:
	rm -rf $(VENV) build dist

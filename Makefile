# Set-up is part of every target: a bare machine with Python 3.11+ needs nothing else.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

# Logs and results of the reference run, which is not kept, and its report, which is.
REFERENCE ?= build/reference
REFERENCE_REPORT ?= reports/reference
REFERENCE_LOGS ?= convert town-v1 $(REFERENCE)/logs --size small
REFERENCE_MATRIX ?= reference
REFERENCE_COMMANDS := "$(REFERENCE_LOGS)" \
  "run $(REFERENCE_MATRIX) --logs $(REFERENCE)/logs --out $(REFERENCE)/run --jobs 2" \
  "report $(REFERENCE)/run --out $(REFERENCE_REPORT)"

# Cases of each kind, and a bound for all of them together.
FUZZ_COUNT ?= 1000
FUZZ_SECONDS ?= 600

.PHONY: demo test check fuzz licences reference clean

demo: $(READY)  ## simulated town to HTML report
	$(BIN)/semgrid-eval demo

reference: $(READY)  ## the paper's table on the simulated town: 15 trainings, time not measured yet; continues where it was stopped
	for command in $(REFERENCE_COMMANDS); do $(BIN)/semgrid-eval $$command || exit 1; done
	$(BIN)/python tools/reference_readme.py $(REFERENCE)/run $(REFERENCE_REPORT) $(REFERENCE_COMMANDS)

test: $(READY)  ## the whole suite
	$(BIN)/python -m pytest -n auto --dist loadfile

check: $(READY)  ## lint, format and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --explicit-package-bases semgrid_eval tools/*.py

fuzz: $(READY)  ## mutated logs, pictures, settings and results, of each kind FUZZ_COUNT within FUZZ_SECONDS in all
	PYTHONPATH=.:tests $(BIN)/python tools/fuzz.py --count $(FUZZ_COUNT) --seconds $(FUZZ_SECONDS)

licences: $(READY)  ## of all packages that are needed
	$(BIN)/python tools/licences.py

$(READY): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable '.[synthetic,dev]'
	touch $@

clean:
	rm -rf $(VENV) build dist

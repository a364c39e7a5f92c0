# Set-up is part of every target: a bare machine with Python 3.11+ needs nothing else.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

# Reports that are kept with the code are runs of these presets on the frozen town. Logs, grids, trainings and results,
# which are not kept, lie in KEPT.
PRESET_reference := reference
PRESET_architecture := architecture-cpu
PRESET_sensitivity := sensitivity
KEPT ?= build/kept
KEPT_LOGS ?= convert town-v1 $(KEPT)/logs --size small
KEPT_REPORTS ?= reports
KEPT_SHARED := --grids $(KEPT)/grids --trainings $(KEPT)/trainings
KEPT_COMMANDS = "$(KEPT_LOGS)" \
  "run $(PRESET_$@) --logs $(KEPT)/logs --out $(KEPT)/$@ $(KEPT_SHARED) --jobs 2" \
  "report $(KEPT)/$@ --out $(KEPT_REPORTS)/$@"

# Cases of each kind, and a bound for all of them together.
FUZZ_COUNT ?= 1000
FUZZ_SECONDS ?= 600

# Tests that are quick and need neither a browser, a simulation nor a cluster; the last ones need no torch either.
QUICK := tests/recording tests/log tests/grids tests/sensors tests/windows tests/models tests/scores tests/segmentation \
  tests/runs/test_runner.py tests/runs/test_matrix.py tests/report/tables tests/report/estimates tests/report/rows \
  tests/test_api.py tests/test_arrays.py tests/test_config.py tests/test_files.py tests/test_seals.py
WITHOUT_TORCH := tests/recording tests/log tests/test_config.py tests/test_files.py tests/test_geometry.py tests/test_motion.py
SOAK ?= build/soak

# What the installed wheel is tried with: the stages of the demo at their smallest, in a folder of its own.
PACKAGE ?= build/package
PACKAGE_COMMANDS := "convert synthetic logs --recordings 4 --towns 2 --town-size-m 250 --duration-s 15" "check logs" \
  "run smoke --logs logs --out run" "report run" "play run ED-DC --logs logs --out play.mcap" \
  "latency logs/val --model residual-town --frames 4 --warm-up 1 --out profile.json"

.PHONY: demo test test-slow test-all check docs reference architecture sensitivity fuzz licences soak package test-lowest \
  test-pythons clean

demo: $(READY)  ## simulated town to HTML report
	$(BIN)/semgrid-eval demo

reference architecture sensitivity: $(READY)  ## a kept report (reports/README.md); goes on where it was stopped
	mkdir -p $(KEPT)/trainings
	for command in $(KEPT_COMMANDS); do $(BIN)/semgrid-eval $$command || exit 1; done
	$(BIN)/python tools/report_readme.py $(KEPT)/$@ $(KEPT_REPORTS)/$@ $(KEPT_COMMANDS)

test: $(READY)  ## the suite, but for what takes more than three seconds a test: five minutes on two idle cores
	$(BIN)/python -m pytest -rs -n auto --dist loadfile -m "not slow"

test-slow: $(READY)  ## the rest of it: whole chains, kills, clusters, pages run from end to end
	$(BIN)/python -m pytest -rs -n auto --dist loadfile -m slow

test-all: $(READY)  ## all of it: the suite with real viewers, the site, the wheel, lowest and other versions, the fuzz
	$(BIN)/python -m pip install --quiet --editable '.[viewers]'
	SEMGRID_VIEWERS=1 $(BIN)/python -m pytest -n auto --dist loadfile -rs
	$(MAKE) docs package test-lowest test-pythons fuzz

soak: $(READY)  ## kills, stops, full disks and two processes in one folder: the same bytes in the end; some ten minutes
	rm -rf $(SOAK)
	OMP_NUM_THREADS=1 $(BIN)/python tools/soak.py $(SOAK)

package: $(READY)  ## wheel and sdist in dist, and the wheel at work in a bare environment, away from this checkout
	rm -rf dist $(PACKAGE)
	$(BIN)/python -m build --outdir dist
	$(PYTHON) -m venv $(PACKAGE)/venv
	$(PACKAGE)/venv/bin/python -m pip install --quiet "$$(echo dist/*.whl)[synthetic]"
	cd $(PACKAGE) && for command in $(PACKAGE_COMMANDS); do venv/bin/semgrid-eval $$command || exit 1; done

test-lowest: $(READY)  ## the quick tests with the lowest versions of all requirements, but for torch
	rm -rf build/lowest && $(PYTHON) -m venv build/lowest
	$(BIN)/python tools/lowest_bounds.py synthetic segment > build/lowest/requirements.txt
	build/lowest/bin/python -m pip install --quiet --requirement build/lowest/requirements.txt \
	  pytest hypothesis pytest-xdist onnx scipy scikit-learn \
	  "torch==$$($(BIN)/python -c 'import torch; print(torch.__version__)')"
	build/lowest/bin/python -m pip install --quiet --no-deps --editable .
	build/lowest/bin/python -m pytest -W ignore::DeprecationWarning -n auto --dist loadfile $(QUICK)

test-pythons: $(READY)  ## what needs no torch, with every other Python from 3.11 to 3.13 that is found here
	for python in $$($(BIN)/python tools/other_pythons.py); do \
	  rm -rf build/python && $$python -m venv build/python \
	  && $(BIN)/python tools/lowest_bounds.py --usual synthetic > build/python/requirements.txt \
	  && build/python/bin/python -m pip install --quiet --requirement build/python/requirements.txt pytest hypothesis scipy \
	  && build/python/bin/python -m pip install --quiet --no-deps --editable . \
	  && build/python/bin/python --version && build/python/bin/python -m pytest $(WITHOUT_TORCH) || exit 1; \
	done

check: $(READY)  ## lint, format and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --explicit-package-bases semgrid_eval tools/*.py

fuzz: $(READY)  ## mutated logs, pictures, settings and results, of each kind FUZZ_COUNT within FUZZ_SECONDS in all
	PYTHONPATH=.:tests $(BIN)/python tools/fuzz.py --count $(FUZZ_COUNT) --seconds $(FUZZ_SECONDS)

docs: $(READY)  ## these pages as a site, in build/site; a warning is an error
	$(BIN)/python -m pip install --quiet --editable '.[docs]'
	$(BIN)/python tools/format_pages.py --check
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet

licences: $(READY)  ## of all packages that are needed
	$(BIN)/python tools/licences.py

$(READY): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable '.[synthetic,dev]'
	touch $@

clean:
	rm -rf $(VENV) build dist

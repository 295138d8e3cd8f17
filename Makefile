# `make` prints what can be done here. All that is needed is Python 3.11 or newer; everything goes into .venv and out.

SHELL := /bin/sh
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL:
.PHONY: help venv demo test check site processor tolerances bounds release-check mutants rules lint sbom audit constraints validate real-data docs figures calibrate models peers bench clean

RECENT := import sys; sys.exit(sys.version_info < (3, 11))
PYTHON ?= $(shell for p in python3 python3.14 python3.13 python3.12 python3.11; do \
	"$$p" -c "$(RECENT)" >/dev/null 2>&1 && { echo "$$p"; break; }; done)
JOBS ?= 2

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
# Two q: pip stays silent unless something goes wrong. The constraints hold for what builds the package, too. Files are
# held to their hashes; only the project itself, a folder, has none. The variable reaches what pip starts to build a package.
INSTALL := PIP_NO_REQUIRE_HASHES=1 $(PIP) install -qq -c constraints.txt --build-constraint constraints.txt
# A pip that knows this variable; the one that comes with Python reads its hashes as requirements only.
BOOTSTRAP := sed -n '/^pip==/,/[^\]$$/p' constraints.txt > $(VENV)/pip.txt && $(PIP) install -qq --require-hashes -r $(VENV)/pip.txt
DEMO := out/tdrs_approach

help: ## print this list
	@echo "rso_lidar: fly a flash LiDAR past a satellite before you build one"
	@echo
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-13s %s\n", $$1, $$2 }' Makefile
	@echo
	@echo "  PYTHON=... chooses the interpreter (3.11 or newer), JOBS=... the test processes (now $(JOBS))"

venv: $(VENV)/.installed ## install rso_lidar into .venv

# Every ninth frame of the approach, to its end; `make demo FRAMES=0:540` flies all.
FRAMES ?= 3:540:9

demo: $(VENV)/.installed ## fly the example: a recording, a contact sheet and an animation, in out/ (half a minute)
	@mkdir -p out
	@echo "A flash LiDAR hops from 3 km to 300 m behind a TDRS satellite (examples/tdrs_approach.toml), frames $(FRAMES)."
	@echo "The recording takes about 10 s, and 15 s more the first time, when numba compiles the inner loops."
	@$(BIN)/rso-lidar run examples/tdrs_approach.toml -o $(DEMO).h5 --frames $(FRAMES) --overwrite
	@$(BIN)/rso-lidar plot $(DEMO).h5 -o $(DEMO).png --overwrite >/dev/null
	@echo "  $(DEMO).png  contact sheet: range and intensity, frame by frame, as the satellite grows"
	@$(BIN)/rso-lidar animate $(DEMO).h5 $(DEMO).gif --overwrite >/dev/null
	@echo "  $(DEMO).gif  the same as an animation"
	@echo "  $(DEMO).h5   the recording: each frame with its truth and labels; rso_lidar.open reads it"

# One of the tests checks types, so that it shares the cores with the others. In this order the shortest tests come last.
PYTEST := $(BIN)/python -m pytest -q -n $(JOBS) --dist loadscope --no-loadscope-reorder

test: rules ## run before each commit: format, lint, floors, types, doctests and all tests that are quick (8 minutes)
	$(PYTEST) -m "not slow"

check: test ## run all that CI runs: `make test`, site, tests that are slow, processor and bounds (25 minutes)
	@$(MAKE) $(VENV)/.installed-site
	@mkdir -p out
	@$(MAKE) bounds >out/bounds.txt 2>&1 & other=$$!; $(MAKE) site; site=$$?; \
		wait $$other; bounds=$$?; cat out/bounds.txt; exit $$((site || bounds))  # each of one process, at the same time
	$(PYTEST) -m slow
	@$(MAKE) processor

site: $(VENV)/.installed-site ## build the documentation into out/site: every example run, every link checked
	@rm -rf out/site
	$(BIN)/python -m sphinx -q -W --keep-going -b html -d out/site-doctrees docs out/site
	@echo "out/site/index.html"

mutants: $(VENV)/.installed-test ## plant faults one by one and see that tests notice (slow; ROOM=... NAME=... choose)
	$(BIN)/python -m tests.mutants --jobs $(JOBS) $(addprefix --room ,$(ROOM)) --name "$(NAME)"

processor: $(VENV)/.installed-test ## repeat quick tests of rooms that compute numbers as on the oldest processor
	$(BIN)/python -m tests.processor -q -n $(JOBS) --dist loadscope -m "not slow"

tolerances: $(VENV)/.installed-test ## list tolerances that rounding could exceed (slow; TESTS=... chooses)
	$(BIN)/python -m tests.tolerances -n $(JOBS) --dist loadscope $(TESTS)

bounds: $(VENV)/.installed-test ## install the declared lower bounds elsewhere, and fly, record and export with them
	$(BIN)/python -m tests.bounds

release-check: $(VENV)/.installed-release ## build, install elsewhere, fly the examples, check README, licences and metadata
	$(BIN)/python -m tests.release_check

sbom: $(VENV)/.installed-release ## list what each extra installs, in out/sbom (slow; EXTRA=... chooses)
	$(BIN)/python -m tests.bill_of_materials $(EXTRA)

audit: $(VENV)/.installed-release ## look for known vulnerabilities in the versions of constraints.txt
	$(BIN)/python -m pip_audit --strict --require-hashes --disable-pip --progress-spinner off -r constraints.txt

# Versions stay as they are where they fit; UPGRADE=1 takes the newest.
constraints: $(VENV)/.installed-release ## compile constraints.txt anew: versions, and hashes of all their files
	$(BIN)/uv pip compile -q --universal --python-version 3.11 --fork-strategy fewest --generate-hashes --no-annotate \
		--custom-compile-command "make constraints" --all-extras \
		$(addprefix --group ,bootstrap test site release workflows peers) $(if $(UPGRADE),--upgrade) \
		pyproject.toml -o constraints.txt

lint: rules ## run the checks that need no tests: format, lint, floors, types
	$(BIN)/mypy

rules: $(VENV)/.installed-test ## run the quick ones of them: format, lint, floors
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports --no-logo

# Pages go to out/. PAGES=docs renews the committed ones; what cannot run on this machine keeps its earlier result there.
PAGES ?= out/validation
validate: export RSO_LIDAR_SHARED ?= $(abspath $(firstword $(wildcard real_data ../shared)))
validate: $(VENV)/.installed-test ## compare with the outside world; writes the ledger of what is validated to out/validation
	$(BIN)/python -m pytest -q -n $(JOBS) --dist loadscope --validation=$(PAGES) tests/physics tests/peers \
		$$($(BIN)/python -m tests.ledger --tests)

real-data: $(VENV)/.installed-test ## bring spacecraft and orbits that you downloaded to where tests look (FROM=folder)
	$(BIN)/python -m tests.real_data $(if $(FROM),"$(FROM)")

peers: $(VENV)/.installed-test ## render anew what tests/peers compares with, by Mitsuba and mitransient (needs Debian's libllvm19)
	@$(INSTALL) -e . --group peers
	$(BIN)/python -m tests.peers.render
	$(BIN)/python -m tests.peers.render_sunlit

docs: $(VENV)/.installed ## write the generated parts of docs/ anew
	$(BIN)/python docs/generate.py

figures: $(VENV)/.installed-test ## draw the curves of docs/instrument.md and the picture of the imports anew
	$(BIN)/python docs/figures.py
	$(BIN)/python docs/draw_architecture.py

calibrate: $(VENV)/.installed ## solve the constants of the shipped detectors through the whole chain, anew
	$(BIN)/python -m rso_lidar.detector.bench.calibration

models: $(VENV)/.installed ## build the models in models/ anew
	$(BIN)/python -m models.build.write

bench: export RSO_LIDAR_SHARED ?= $(abspath $(wildcard ../shared))
bench: $(VENV)/.installed ## measure how fast it is, stage by stage and beside peers that are installed
	$(BIN)/python -m benchmarks

clean: ## remove all that make made: .venv, out and caches
	rm -rf $(VENV) out build dist docs/api docs/files docs/auto_gallery docs/auto_tutorial .mypy_cache .ruff_cache .pytest_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Of its wheel, which constraints.txt cannot hold: it pins another fmpy.
GEMSEO_FMU_SHA256 := 940b0200fe13cd00cc2b0a318bc4f1c8ddc147357fe3fe7ef8e53ae6ace5728e

# The stamps: installing again only when what is to be installed has changed.
$(VENV)/.installed: pyproject.toml constraints.txt | $(BIN)/python
	@echo "Installing rso_lidar and what it needs into $(VENV): about a minute, once."
	@$(BOOTSTRAP)
	@$(INSTALL) -e .
	@touch $@

$(VENV)/.installed-test: pyproject.toml constraints.txt | $(BIN)/python
	@echo "Installing rso_lidar, what it needs and what tests it into $(VENV): a minute or two, once."
	@$(BOOTSTRAP)
	@$(INSTALL) -e . --group test
	@# FMUs that OpenModelica exported. It pins another fmpy and has no wheel for Python 3.14; its tests are skipped without it.
	@echo "gemseo-fmu==3.1.1 --hash=sha256:$(GEMSEO_FMU_SHA256)" > $(VENV)/gemseo-fmu.txt
	@$(PIP) install -qq --no-deps --only-binary :all: -r $(VENV)/gemseo-fmu.txt 2>/dev/null || true
	@touch $(VENV)/.installed $@

$(VENV)/.installed-site: pyproject.toml constraints.txt | $(BIN)/python
	@echo "Installing rso_lidar and what builds its site into $(VENV): a minute, once."
	@$(BOOTSTRAP)
	@$(INSTALL) -e . --group site
	@touch $(VENV)/.installed $@

$(VENV)/.installed-release: pyproject.toml constraints.txt | $(BIN)/python
	@echo "Installing rso_lidar and what checks a release into $(VENV): a minute, once."
	@$(BOOTSTRAP)
	@$(INSTALL) -e . --group release
	@touch $(VENV)/.installed $@

$(BIN)/python:
	@"$(PYTHON)" -c "$(RECENT)" >/dev/null 2>&1 || { \
		echo "rso_lidar needs Python 3.11 or newer, and '$(PYTHON)' is not: make PYTHON=/path/to/python3.11" >&2; exit 1; }
	@"$(PYTHON)" -m venv $(VENV) || { rm -rf $(VENV); \
		echo "'$(PYTHON)' cannot make a virtual environment: install its venv module (such as python3-venv)" >&2; exit 1; }

# 'make help' lists what there is. Each target sets up all it needs in .venv: Python 3.11 or newer and make are enough.

.DEFAULT_GOAL := help

PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV ?= .venv
ROBOT ?= chefbot
BIN := $(VENV)/bin
WHEEL_VENV := build/wheel-venv
EXTRAS := teleop,tune,joystick,depth,discovery,maps,navigation,page,recording,plot,foxglove,urdf
DEB_EXTRAS ?= discovery,maps,page,recording,teleop,tune,urdf
FUZZ_S ?= 60
SOAK_MINUTES ?= 60
JOBS_OF_FAULTS ?= 2
CLOCK ?= both
TIER ?= full
FUZZ_OPTIONS := -max_total_time=$(FUZZ_S) -artifact_prefix=build/fuzz/ -verbosity=0 -print_final_stats=1

# Bytecode is kept and shared, whatever the environment says: without it, each of the tests' processes compiles it all anew.
unexport PYTHONDONTWRITEBYTECODE

# Tests that need the real clock share a worker, which mostly waits: so one more than there are cores. JOBS=0: one process.
JOBS ?= $(shell expr $$(nproc 2>/dev/null || echo 1) + 1)
PARALLEL := -n $(JOBS) --dist loadgroup

.PHONY: docs run serve map test test-again test-all coverage check audit lint format client wheel deb wheel-test wheel-test-again bench fuzz soak faults clean help

help:  ## List the targets
	@echo "make TARGET, one of:"
	@sed -n 's/^\([a-z-]*\):.*  ## \(.*\)/  \1|\2/p' $(MAKEFILE_LIST) | awk -F '|' '{ printf "%-17s %s\n", $$1, $$2 }'

run: $(VENV)/ready  ## Drive the simulated robot through a 2 m square (ROBOT=khan: the other one)
	$(BIN)/chefbotctl square --sim --robot $(ROBOT)

serve: $(VENV)/ready  ## Have a simulated ChefBot serve three tables in a flat, with people in its way
	$(BIN)/chefbotctl serve

map: $(VENV)/ready  ## Have a simulated ChefBot with a lidar map a flat of six rooms, and write the map to build/map
	$(BIN)/chefbotctl map demo --out build/map

# For every change: no long scenario, few examples, each scenario on one robot.
test: $(VENV)/ready  ## Run the tests that belong to every change, on all cores (JOBS=0: one process)
	@echo "About 5800 tests; about two minutes on two cores, three the first time."
	$(BIN)/pytest -q $(PARALLEL) -m "not slow"

# One at a time, for a machine on which tests of the real clock may have been held up by others.
test-again: $(VENV)/ready  ## Run what failed in the last run once more, one test at a time
	$(BIN)/pytest -q --last-failed --last-failed-no-failures none -m "not slow"

# Everything, as `make check` and .ci/run try it.
test-all: $(VENV)/ready  ## Run every test, with all examples and long scenarios
	@echo "Every test, with all examples and long scenarios; about ten minutes on two cores."
	TEST_TIER=full $(BIN)/pytest -q $(PARALLEL)

coverage: $(VENV)/ready  ## The same with branch coverage
	TEST_TIER=full $(BIN)/pytest -q $(PARALLEL) --cov --cov-report=term-missing:skip-covered

check: lint coverage wheel-test audit  ## All that has to hold: lint, coverage, wheel-test, audit
lint: $(VENV)/ready  ## Check format, style, strict types and import rules
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# Whether the dependencies fit together, and whether any has a known vulnerability (see docs/dependencies.md).
audit: $(VENV)/ready  ## Check that the dependencies fit together and have no known vulnerability
	$(BIN)/pip check
	$(BIN)/python -m tests.audit

client: $(VENV)/ready  ## Write the client's methods, models and topics and the tables of docs/api.md from the registered ones
	$(BIN)/python -m tests.chefbotd.client.generate

format: $(VENV)/ready  ## Format the code, and mend what can be mended
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

wheel: $(VENV)/ready  ## Build the wheel into dist
	rm -rf dist
	$(BIN)/python -m build --outdir dist

# For this computer's architecture and Debian's own Python; with DEB_EXTRAS, which are extras of pyproject.toml.
deb: $(VENV)/ready  ## Build the Debian package into dist (DEB_EXTRAS=page,teleop,...)
	rm -rf build/deb-wheel
	$(BIN)/python -m build --wheel --outdir build/deb-wheel
	packaging/deb/build "$$(ls build/deb-wheel/*.whl)" "$(DEB_EXTRAS)"

# The tests, run against the installed wheel in an environment of its own, away from the sources. TIER=rest leaves out
# those that `make test` runs in the same way and that no wheel makes a difference to (tests/budget.py says which).
wheel-test: wheel  ## Run the tests against the installed wheel (TIER=rest: those that `make test` leaves)
	rm -rf build/wheel-test $(WHEEL_VENV)
	$(PYTHON) -m venv $(WHEEL_VENV)
	$(WHEEL_VENV)/bin/pip install --quiet "$$(ls dist/*.whl)[$(EXTRAS),testing]" axe-playwright-python hypothesis jsonschema playwright psutil pytest-timeout pytest-xdist trustme
	mkdir -p build/wheel-test
	cp -r tests fuzz benchmarks docs config README.md CHANGELOG.md Makefile pyproject.toml build/wheel-test/
	cd build/wheel-test && TEST_TIER=$(TIER) ../wheel-venv/bin/python -P -m pytest -q $(PARALLEL)

wheel-test-again:  ## Run what failed in the last wheel-test once more, one test at a time
	cd build/wheel-test && TEST_TIER=$(TIER) ../wheel-venv/bin/python -P -m pytest -q --last-failed --last-failed-no-failures none

# Coverage-guided, for FUZZ_S seconds a target; what it finds is kept in build/fuzz and belongs into tests/vectors/fuzz.
fuzz: $(VENV)/ready  ## Throw bytes at the parsers (FUZZ_S=60 a target)
	$(BIN)/pip install --quiet --editable '.[fuzz]'
	mkdir -p build/fuzz/decode build/fuzz/request build/fuzz/stops build/fuzz/lidars
	$(BIN)/python -m fuzz decode build/fuzz/decode tests/vectors/fuzz/decode $(FUZZ_OPTIONS)
	$(BIN)/python -m fuzz request build/fuzz/request tests/vectors/fuzz/request $(FUZZ_OPTIONS)
	$(BIN)/python -m fuzz stops build/fuzz/stops tests/vectors/fuzz/stops $(FUZZ_OPTIONS)
	$(BIN)/python -m fuzz lidars build/fuzz/lidars tests/vectors/fuzz/lidars $(FUZZ_OPTIONS)

# An hour of simulated driving with seeded faults on the virtual clock, with either robot: both at once, a core each.
# ChefBot's hour is shared by its published sketches, the less the more lines a second they send.
soak: $(VENV)/ready  ## Drive an hour with random faults, both robots, every sketch (SOAK_MINUTES=60)
	$(MAKE) --jobs=2 --output-sync soak-khan soak-chefbot soak-tiva_bare soak-tiva_second soak-duemilanove

soak-khan: SHARE := 60
soak-chefbot: SHARE := 40
soak-duemilanove: SHARE := 10
soak-tiva_second: SHARE := 6
soak-tiva_bare: SHARE := 4
soak-%: $(VENV)/ready
	$(BIN)/python -m tests.scenarios.soak $$(awk 'BEGIN { print $(SOAK_MINUTES) * $(SHARE) / 60 }') 1 \
	  $(if $(filter khan chefbot,$*),$*,chefbot/$*)

# Every fault of docs/safety.md that the simulated robot can have, on both robots and, where the board makes a difference,
# on every sketch; and what it does. CLOCK=virtual leaves out those of the real program, which take real time: what is left
# is the same in every run.
faults: $(VENV)/ready  ## Let every fault of docs/safety.md happen (CLOCK=virtual: without the real program)
	$(BIN)/python -m tests.scenarios.matrix --clock $(CLOCK) --jobs $(JOBS_OF_FAULTS) --json build/faults.json

docs: $(VENV)/ready  ## Build the documentation as a site, build/site/index.html, and check its links
	$(BIN)/pip install --quiet --editable '.[docs]'
	$(BIN)/sphinx-build -q -W --keep-going -b html -d build/doctrees docs build/site

bench: $(VENV)/ready  ## Measure, as in docs/benchmarks.md
	$(BIN)/python -m benchmarks

clean:  ## Remove .venv and whatever was built
	rm -rf build dist $(VENV)

$(VENV)/ready: pyproject.toml
	@echo "Setting up $(VENV) with $(PYTHON), once: it downloads some 100 MB and takes a minute or two."
	@$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "Python 3.11 or newer is needed: make PYTHON=/path/to/it")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --editable '.[dev,$(EXTRAS)]'
	touch $@

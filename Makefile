# 'make help' lists what there is. Each target sets up all it needs in .venv: Python 3.11 or newer and make are enough.

.DEFAULT_GOAL := help

PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV ?= .venv
ROBOT ?= chefbot
BIN := $(VENV)/bin
WHEEL_VENV := build/wheel-venv
comma := ,
UPGRADE ?=
EXTRAS := camera,teleop,tune,joystick,depth,discovery,maps,mujoco,navigation,page,recording,plot,foxglove,urdf
WITH ?=
DEB_EXTRAS ?= discovery,maps,page,recording,teleop,tune,urdf$(WITH:%=,%)
FUZZ_S ?= 60
SOAK_MINUTES ?= 60
SEQUENCES ?= 100000
RUNS ?= 5
REPOSITORY ?=
EMAIL ?= $(shell git log -1 --format=%ae)
SEED ?= 1
ORDERS ?= 60
JOBS_OF_FAULTS ?= 2
CLOCK ?= both
TIER ?= full
FUZZ_OPTIONS := -max_total_time=$(FUZZ_S) -artifact_prefix=build/fuzz/ -verbosity=0 -print_final_stats=1

# Bytecode is kept and shared, whatever the environment says: without it, each of the tests' processes compiles it all anew.
unexport PYTHONDONTWRITEBYTECODE

# Tests that need the real clock share a worker, which mostly waits: so one more than there are cores. JOBS=0: one process.
JOBS ?= $(shell expr $$(nproc 2>/dev/null || echo 1) + 1)
PARALLEL := -n $(JOBS) --dist loadgroup

.PHONY: sources-test addons-test addons-tools fleet firmware firmware-test docs pictures run serve waiter map calibrate test examples-test test-loaded test-all coverage check audit lock newest lint format client wheel deb release wheel-test bench fuzz soak faults sequences clean help

help:  ## List the targets
	@echo "make TARGET, one of:"
	@sed -n 's/^\([a-z-]*\):.*  ## \(.*\)/  \1|\2/p' $(MAKEFILE_LIST) | awk -F '|' '{ printf "%-17s %s\n", $$1, $$2 }'

run: $(VENV)/ready  ## Drive the simulated robot through a 2 m square (ROBOT=khan: the other one)
	$(BIN)/chefbotctl square --sim --robot $(ROBOT)

serve: $(VENV)/ready  ## Have a simulated ChefBot serve three tables in a flat, with people in its way
	$(BIN)/chefbotctl serve

waiter: $(VENV)/ready  ## Have a simulated ChefBot take orders on its page, and serve them in a flat
	$(BIN)/python -m examples.waiter

fleet: $(VENV)/ready build/constraints.txt  ## Have a manager drive six ChefBots through an office over MQTT, and kill what can be killed (ORDERS=60)
	$(BIN)/pip install --quiet --constraint build/constraints.txt --no-build-isolation --editable addons/chefbot-vda5050 --editable addons/chefbot-fleet
	$(BIN)/python -m chefbot_fleet.demo --orders $(ORDERS)

map: $(VENV)/ready  ## Have a simulated ChefBot with a lidar map a flat of six rooms, and write the map to build/map
	$(BIN)/chefbotctl map demo --out build/map

calibrate: $(VENV)/ready  ## Have a simulated ChefBot that is wrong in everything calibrate itself (SEED=1)
	$(BIN)/chefbotctl calibrate --sim $(SEED) --out build/calibration

# For every change: no long scenario, few examples, each scenario on one robot. `make firmware-test` has tests/firmware.
test: $(VENV)/ready  ## Run the tests that belong to every change, on all cores (JOBS=0: one process)
	$(BIN)/pytest -q $(PARALLEL) -m "not slow" --ignore tests/firmware

# No test may depend on the computer's speed: here each has a sixth of it and less.
test-loaded: $(VENV)/ready  ## Run the same with six busy loops beside, and name who fails (RUNS=5)
	$(BIN)/python tests/flaky.py loaded $(RUNS) $(BIN)/pytest -q $(PARALLEL) -m "not slow" --ignore tests/firmware

# Those long tests that `make wheel-test` cannot run: no wheel has what they need.
sources-test: $(VENV)/ready  ## Run each command of the pages, and take each component out that can be
	$(BIN)/pytest -q $(PARALLEL) -m slow tests/test_doc_commands.py tests/chefbotd/test_component_list.py

# Everything, as `make check` and .ci/run try it.
test-all: $(VENV)/ready  ## Run every test, with all examples and long scenarios
	TEST_TIER=full $(BIN)/pytest -q $(PARALLEL)

coverage: $(VENV)/ready  ## The same with branch coverage
	TEST_TIER=full $(BIN)/pytest -q $(PARALLEL) --cov --cov-report=term-missing:skip-covered

# What two of the examples need is theirs: it is installed for these tests alone.
examples-test: $(VENV)/ready build/constraints.txt  ## Install what two of the examples need, and run their tests
	$(BIN)/pip install --quiet --constraint build/constraints.txt -r examples/learning/requirements.txt -r examples/notebook/requirements.txt
	$(BIN)/pytest -q examples

firmware:  ## Build the board's firmware for this computer, the boards and the emulators (apt: see firmware/README.md)
	$(MAKE) -C firmware

# Distributions of their own beside the daemon: installed into the same environment, with what is locked.
ADDONS := ros2[rosbridge,test] devtools[test] vda5050[test] fleet[test] speech[test,whisper]
addons-test: $(VENV)/ready build/constraints.txt build/ros-venv/ready build/roslib/ready  ## Install the add-ons, and run their tests
	$(BIN)/pip install --quiet --constraint build/constraints.txt --no-build-isolation $(foreach addon,$(ADDONS),--editable 'addons/chefbot-$(addon)')
	$(BIN)/mypy $(foreach addon,$(ADDONS),--package chefbot_$(firstword $(subst [, ,$(addon))))
	$(BIN)/pytest -q -m "not slow" addons

# ROS 2 brings 300 MB and a numpy of its own choice: an environment apart from the daemon's, as a user has it too.
ROS2 := addons/chefbot-ros2
ROS_CONSTRAINTS := --constraint build/ros-constraints.txt --constraint $(ROS2)/ros-constraints.txt
build/ros-venv/ready: pyproject.toml build/ros-constraints.txt $(ROS2)/pyproject.toml $(ROS2)/ros-constraints.txt $(wildcard $(ROS2)/tf2_msgs/* $(ROS2)/tf2_msgs/msg/*)
	rm -rf build/ros-venv
	$(PYTHON) -m venv build/ros-venv
	build/ros-venv/bin/pip install --quiet $(ROS_CONSTRAINTS) hatchling editables setuptools wheel
	build/ros-venv/bin/pip install --quiet $(ROS_CONSTRAINTS) --no-build-isolation \
	  --editable . --editable '$(ROS2)[node,tf2]'
	$(ROS2)/tf2_msgs/install build/ros-venv
	@touch $@

build/roslib/ready: $(ROS2)/tests/roslib/package.json
	mkdir -p build/roslib
	cp $< build/roslib
	npm install --prefix build/roslib --no-package-lock --no-audit --no-fund --silent
	@touch $@

# What the add-ons' tests drive and are judged by, from Debian's packages and npm; and Boost, which a benchmark's search is held against.
addons-tools:  ## Install what the tests of the add-ons need: a broker, another maker's fleet manager, voices, a browser, Boost
	apt-get -o DPkg::Lock::Timeout=300 update -qq
	DEBIAN_FRONTEND=noninteractive RUNLEVEL=1 apt-get -o DPkg::Lock::Timeout=300 install -y -qq --no-install-recommends mosquitto espeak-ng flite alsa-utils chromium cmake g++ libboost-dev
	npm install --silent --no-save --prefix build/addons-tools vda-5050-lib@1.4.0

# The tests of the firmware are to fail, not to skip, where a compiler or an emulator is missing.
firmware-test: $(VENV)/ready firmware  ## Build and check the firmware, and run its tests; nothing is left out
	$(MAKE) -C firmware check images-check
	FIRMWARE_TESTS=required $(BIN)/pytest -q $(PARALLEL) tests/firmware
	$(BIN)/python -m tests.scenarios.soak 2 1 chefbot/emulated  # random faults, with the image itself on the board

check: lint coverage wheel-test audit  ## All that has to hold: lint, coverage, wheel-test, audit
lint: $(VENV)/ready  ## Check format, style, strict types, import rules and names
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m tests.names

# Whether the dependencies fit together, and whether any has a known vulnerability (see docs/dependencies.md).
audit: $(VENV)/ready  ## Check that the dependencies fit together and have no known vulnerability
	$(BIN)/pip check
	$(BIN)/python -m tests.audit

client: $(VENV)/ready  ## Write the client's methods, models and topics and the tables of docs/api.md from the registered ones, and the reference of every key
	$(BIN)/python -m tests.chefbotd.client.generate
	$(BIN)/python -m tests.chefbotd.settings.write_reference

format: $(VENV)/ready  ## Format the code, and mend what can be mended
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

wheel: $(VENV)/ready  ## Build the wheel into dist
	rm -f dist/*.whl dist/*.tar.gz
	$(BIN)/python -m build --no-isolation --outdir dist

# For this computer's architecture and Debian's own Python; with DEB_EXTRAS, which are extras of pyproject.toml.
deb: wheel build/constraints.txt  ## Build the Debian package into dist (WITH=navigation: one more extra)
	packaging/deb/build "$$(ls dist/*.whl)" "$(DEB_EXTRAS)"

# Nothing is published: CONTRIBUTING.md has the maintainer's command. The authors' address is the last commit's, which whoever
# has the sources knows.
release: $(VENV)/ready build/constraints.txt  ## Build and check every distribution, and write the notes (REPOSITORY=https://... EMAIL=...)
	$(BIN)/python packaging/release.py --email "$(EMAIL)" $(if $(REPOSITORY),--repository $(REPOSITORY))

# The tests, run against the installed wheel in an environment of its own, away from the sources. TIER=rest leaves out
# those that `make test` runs in the same way and that no wheel makes a difference to (tests/budget.py says which).
wheel-test: wheel  ## Run the tests against the installed wheel (TIER=rest: those that `make test` leaves)
	rm -rf build/wheel-test $(WHEEL_VENV)
	$(PYTHON) packaging/set_up.py $(WHEEL_VENV) --wheel "$$(ls dist/*.whl)"
	$(WHEEL_VENV)/bin/pip check
	mkdir -p build/wheel-test
	cp -r tests examples fuzz benchmarks docs config README.md CHANGELOG.md Makefile pyproject.toml requirements.lock build/wheel-test/
	cd build/wheel-test && TEST_TIER=$(TIER) ../wheel-venv/bin/python -P -m pytest -q $(PARALLEL)

# Coverage-guided, for FUZZ_S seconds a target; what it finds is kept in build/fuzz and belongs into tests/vectors/fuzz.
fuzz: $(VENV)/ready build/constraints.txt  ## Throw bytes at the parsers (FUZZ_S=60 a target)
	$(BIN)/pip install --quiet --constraint build/constraints.txt --no-build-isolation --editable '.[fuzz]'
	mkdir -p build/fuzz/decode build/fuzz/request build/fuzz/stops build/fuzz/lidars build/fuzz/firmware
	$(BIN)/python -m fuzz decode build/fuzz/decode tests/vectors/fuzz/decode $(FUZZ_OPTIONS)
	$(BIN)/python -m fuzz request build/fuzz/request tests/vectors/fuzz/request $(FUZZ_OPTIONS)
	$(BIN)/python -m fuzz stops build/fuzz/stops tests/vectors/fuzz/stops $(FUZZ_OPTIONS)
	$(BIN)/python -m fuzz lidars build/fuzz/lidars tests/vectors/fuzz/lidars $(FUZZ_OPTIONS)
	$(BIN)/python -m fuzz firmware build/fuzz/firmware tests/vectors/fuzz/firmware $(FUZZ_OPTIONS)

# An hour of simulated driving with seeded faults on the virtual clock, with either robot: both at once, a core each.
# ChefBot's hour is shared by its published sketches and our own firmware, the less the more lines a second they send.
soak: $(VENV)/ready  ## Drive an hour with random faults, both robots, every sketch (SOAK_MINUTES=60)
	$(MAKE) --jobs=2 --output-sync soak-khan soak-chefbot soak-tiva_bare soak-tiva_second soak-duemilanove soak-own

soak-khan: SHARE := 60
soak-chefbot: SHARE := 34
soak-duemilanove: SHARE := 10
soak-tiva_second: SHARE := 6
soak-tiva_bare: SHARE := 4
soak-own: SHARE := 6
soak-%: $(VENV)/ready
	$(BIN)/python -m tests.scenarios.soak $$(awk 'BEGIN { print $(SOAK_MINUTES) * $(SHARE) / 60 }') 1 \
	  $(if $(filter khan chefbot,$*),$*,chefbot/$(if $(filter own,$*),chefbot,$*))

# Every fault of docs/safety.md that the simulated robot can have, on both robots and, where the board makes a difference,
# on every sketch; and what it does. CLOCK=virtual leaves out those of the real program, which take real time: what is left
# is the same in every run.
faults: $(VENV)/ready  ## Let every fault of docs/safety.md happen (CLOCK=virtual: without the real program)
	$(BIN)/python -m tests.scenarios.matrix --clock $(CLOCK) --jobs $(JOBS_OF_FAULTS) --json build/faults.json

# Random sequences of whoever drives, waits, stops, fails, arms and connects again, each with the rule beside it.
sequences: $(VENV)/ready  ## Search sequences for a motion that nobody decided on since the last stop (SEQUENCES=100000)
	SEQUENCES=$(SEQUENCES) $(BIN)/python -m pytest -q tests/chefbotd/driving/test_stop_sequences.py \
	  tests/chefbotd/components/navigation/test_waiting_sequences.py
	$(foreach addon,ros2 speech vda5050,{ ! $(BIN)/python -c "import chefbot_$(addon)" 2>/dev/null \
	  || SEQUENCES=$(SEQUENCES) $(BIN)/python -m pytest -q addons/chefbot-$(addon)/tests/test_*_sequences.py; } &&) true

docs: $(VENV)/ready  ## Build the documentation as a site, build/site/index.html; check its links, and its widths in Chromium
	$(BIN)/sphinx-build -q -W --keep-going -b html -d build/doctrees docs build/site
	$(BIN)/python docs/_site/check_widths.py build/site

# Where Chromium is. Look at what was drawn: a busy computer shows in it.
pictures: $(VENV)/ready  ## Draw the pictures of README and the pages anew, from the programs
	PYTHONPATH=. $(BIN)/python docs/_site/pictures.py docs/images
	PYTHONPATH=. $(BIN)/python docs/_site/page_screens.py docs/images

bench: $(VENV)/ready  ## Measure, as in docs/benchmarks.md
	$(BIN)/python -m benchmarks

clean:  ## Remove .venv and whatever was built
	rm -rf build dist $(VENV)

# What was tested is what is installed: requirements.lock has each version, with its hashes.
$(VENV)/ready: pyproject.toml requirements.lock
	@$(PYTHON) -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else "Python 3.11 or newer is needed: make PYTHON=/path/to/it")'
	@$(PYTHON) packaging/set_up.py $(VENV)
	@touch $@

# The versions alone, for what is installed with extras that the lock's users do not have: pip wants the hashes of all or none.
build/constraints.txt: requirements.lock
	mkdir -p build
	grep -oE '^[A-Za-z0-9._-]+==[^\\]*' $< > $@

# ROS 2 has a setuptools of its own, which the checkers of a release must not raise.
build/ros-constraints.txt: build/constraints.txt
	grep -v '^setuptools==' $< > $@

# For every platform and Python at once; what is locked stays where it is but for `make lock UPGRADE=--upgrade`.
lock:  ## Lock each dependency to a version with hashes, as pyproject.toml allows (UPGRADE=--upgrade: the newest)
	$(PYTHON) -m venv build/lock-venv
	build/lock-venv/bin/pip install --quiet uv
	printf 'hatchling>=1.26\neditables\n' | build/lock-venv/bin/uv pip compile --quiet --no-config --universal --python-version 3.11 \
	  --generate-hashes --no-emit-index-url --custom-compile-command "make lock" $(UPGRADE) \
	  $(foreach extra,$(subst $(comma), ,dev,docs,release,$(EXTRAS)),--extra $(extra)) pyproject.toml - --output-file requirements.lock

# As somebody gets it who installs chefbotd with pip, some day: what fails here will fail there.
newest:  ## Run the tests with the newest releases that pyproject.toml allows, in an environment of their own
	rm -rf build/newest-venv
	$(PYTHON) packaging/set_up.py build/newest-venv --newest 'dev,$(EXTRAS)'
	build/newest-venv/bin/pip list --outdated
	build/newest-venv/bin/pytest -q $(PARALLEL) -m "not slow"

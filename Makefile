PYTHON ?= python3.11
VENV ?= .venv
BIN := $(VENV)/bin

$(VENV)/ready: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --editable '.[dev,teleop]'
	touch $@

.PHONY: setup test check bench clean
setup: $(VENV)/ready

test: setup
	$(BIN)/pytest -q

check: setup
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/pytest -q --cov --cov-report=term

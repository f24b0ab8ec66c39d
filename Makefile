# On a machine with Python 3.11 or newer, make and apt, every target sets up what it needs.

PYTHON ?= python3
WORKERS ?= 2
BIN := .venv/bin
SUDO := $(if $(filter 0,$(shell id -u)),,sudo)
PIP_INSTALL := $(BIN)/pip install -qq --constraint constraints.txt
# A file's tests stay on one worker, so that what they share is made once.
PYTEST := $(BIN)/pytest -n $(WORKERS) --dist loadfile
SOURCES := app study_core migrations tests

.DEFAULT_GOAL := help
.PHONY: run test check check-slow bench format messages chromium npm clean help

run: .venv/runtime.stamp ## Set up, then serve the quickstart study; prints the participant's link
	$(BIN)/prefstudy serve --study quickstart

test: .venv/dev.stamp ## Set up, then run the fast tests (no browser)
	$(PYTEST) -m "not slow and not browser"

check: .venv/dev.stamp chromium node_modules/axe.stamp ## Format, lint, types, imports, every test but the slow ones
	$(BIN)/ruff format --check $(SOURCES)
	$(BIN)/ruff check $(SOURCES)
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(PYTEST) -m "not slow and not browser"
	$(BIN)/pytest -m "browser and not slow" # one at a time: a browser that draws in software needs a core of its own

check-slow: .venv/bench.stamp chromium node_modules/axe.stamp ## The slow tests: calibration, kills, whole sessions
	$(BIN)/pytest -m slow

bench: .venv/bench.stamp ## Measure queries, drives, posterior, training and server beside their alternatives; prints JSON
	$(BIN)/prefstudy bench query --json
	$(BIN)/prefstudy bench trajectories --json
	$(BIN)/prefstudy bench posterior --json
	$(BIN)/prefstudy bench training --json
	$(BIN)/prefstudy bench serve --json

format: .venv/dev.stamp ## Format, and mend what the linter can mend
	$(BIN)/ruff check --fix $(SOURCES)
	$(BIN)/ruff format $(SOURCES)

messages: .venv/dev.stamp ## Bring the translations' catalogues up to date with the words in templates and code
	mkdir -p build
	$(BIN)/pybabel -q extract --mapping pyproject.toml --add-location file --output build/prefstudy.pot .
	$(BIN)/pybabel -q update --domain prefstudy --input-file build/prefstudy.pot --output-dir static/locale \
		--no-fuzzy-matching --ignore-obsolete --ignore-pot-creation-date --width 110

chromium: ## Install Chromium, which the browser tests drive, when there is none
	@command -v chromium >/dev/null || command -v chromium-browser >/dev/null || \
		{ $(SUDO) apt-get update && $(SUDO) apt-get install --yes --no-install-recommends chromium; }

npm:
	@command -v npm >/dev/null || \
		{ $(SUDO) apt-get update && $(SUDO) apt-get install --yes --no-install-recommends npm; }

# What looks for barriers on the pages; the lock file pins it by its hash.
node_modules/axe.stamp: package.json package-lock.json | npm
	npm ci --ignore-scripts --no-audit --no-fund
	touch $@

clean: ## Remove the environment and every cache
	rm -rf .venv node_modules build dist .hypothesis .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find app study_core migrations tests -name __pycache__ -type d -prune -exec rm -rf {} +

help: ## Show this
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

$(BIN)/pip:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Expected Python 3.11 or newer, got $$($(PYTHON) --version). Run: make PYTHON=python3.12 ..." >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || \
		{ $(SUDO) apt-get update && $(SUDO) apt-get install --yes --no-install-recommends python3-venv; }
	$(PYTHON) -m venv .venv

.venv/runtime.stamp: pyproject.toml constraints.txt | $(BIN)/pip
	@echo "Installing into .venv; the first time takes some minutes."
	$(PIP_INSTALL) --editable .
	touch $@

.venv/dev.stamp: pyproject.toml constraints.txt | $(BIN)/pip
	@echo "Installing into .venv; the first time takes some minutes."
	$(PIP_INSTALL) --editable '.[dev]'
	touch .venv/runtime.stamp $@

.venv/bench.stamp: pyproject.toml constraints.txt | $(BIN)/pip
	@echo "Installing into .venv; the first time takes some minutes."
	$(PIP_INSTALL) --editable '.[dev,bench]'
	touch .venv/runtime.stamp .venv/dev.stamp $@

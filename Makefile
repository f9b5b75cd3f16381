# Everything here works from a fresh checkout: what a target needs is installed into ./.venv first,
# and reused as long as pyproject.toml stays the same. `make` alone lists the targets.
#
# Settings (all optional), e.g. `make test JOBS=4 PYTEST_ARGS="-k helix"`:
#   PYTHON       the interpreter .venv is made with (default: the first python3 that is 3.11 or newer)
#   JOBS         parallel test processes (default 2)
#   PYTEST_ARGS  more arguments for pytest
#   MINUTES      length of `make fuzz` (default 60)
#   NO_APT       set to 1 to never install Debian packages, not even when that needs no password

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help demo test test-lowest fuzz docs look bench wheel lint format setup setup-dev clean distclean

# A sourced ROS or openrobots environment must not put its own pinocchio before ours.
unexport PYTHONPATH
unexport PYTHONHOME
# Python stores what it compiles in .venv and __pycache__. Without, every process that a test starts
# compiles all modules again: two seconds and more each time.
unexport PYTHONDONTWRITEBYTECODE

JOBS ?= 2
PYTEST_ARGS ?=
MINUTES ?= 60
export JOBS PYTEST_ARGS PYTHON NO_APT

help: ## list the targets
	@echo "usage: make TARGET"
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  \1\t\2/p' Makefile | expand -t 14

demo: setup ## follow a helix with the 3-RPS robot; results go to demo/
	.venv/bin/rps-pin helix --output demo

test: setup-dev ## lint, format check, types, documentation and all tests; installs or finds Chromium
	@sh tools/check lint format types docs tests

test-lowest: ## the tests that use each dependency, with the lowest versions allowed (by uv)
	@sh tools/check-lowest "$$PWD/build/lowest"

fuzz: setup-dev ## hostile files, options and calls for MINUTES=60; findings go to build/fuzz
	OPENBLAS_NUM_THREADS=1 .venv/bin/python -m tests.fuzz --minutes $(MINUTES)

docs: setup-dev ## build the documentation into build/docs, warnings are errors
	@sh tools/check docs

look: setup-dev ## walk what a new user does, with pictures of it all: build/look/index.html
	@browser=$$(sh tools/install-browser) || \
		{ echo "no Chromium that runs: sudo apt-get install chromium libatomic1"; exit 1; }; \
		RPS_PIN_CHROMIUM="$$browser" .venv/bin/python -u tools/look.py

bench: setup-dev ## measure the speed of the solvers, and of generated code against its peers
	OPENBLAS_NUM_THREADS=1 .venv/bin/python -m pytest benchmarks --benchmark-only $(PYTEST_ARGS)
	OPENBLAS_NUM_THREADS=1 .venv/bin/python -m benchmarks.generated_code_table

wheel: ## build sdist and wheel into dist, and try the wheel on every Python found
	@sh tools/check-wheel build/wheel
	@mkdir -p dist && cp build/wheel/*.whl build/wheel/*.tar.gz dist/

lint: setup-dev ## lint, format check and types only
	@sh tools/check lint format types

format: setup-dev ## format the code and apply the linter's safe fixes
	.venv/bin/ruff check --fix
	.venv/bin/ruff format

setup: ## only make .venv, with what the program needs
	@sh tools/setup run

setup-dev: ## only make .venv, with what the tests need too
	@sh tools/setup dev

clean: ## remove what the targets wrote, except .venv
	rm -rf demo build dist docs/api/objects .mypy_cache .ruff_cache .pytest_cache .hypothesis .benchmarks
	find src tests benchmarks tools -type d -name __pycache__ -exec rm -rf {} +

distclean: clean ## the same, and .venv
	rm -rf .venv

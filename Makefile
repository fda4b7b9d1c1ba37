# Everything happens in .venv of this checkout. Needs make and a Python 3.11 to 3.13 with venv, nothing else.
# Another Python: make PYTHON=/path/to/python3.12 test     Arguments for pytest: make test PYTEST_ARGS="-n 0 -k optics"
# What changed since an old report: make bench BENCH_ARGS="--compare docs/reports/software.json"

# The first that runs (a pyenv shim may exist and fail), has the right version and can make environments.
PYTHON ?= $(shell for python in python3.13 python3.12 python3.11 python3; do \
    if $$python -c 'import ensurepip, sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' >/dev/null 2>&1; \
    then echo $$python; exit; fi; done; echo python3)
PYTEST_ARGS ?=
BENCH_ARGS ?=
BLENDER_ARGS ?=

BOOTSTRAP = @$(PYTHON) tools/bootstrap.py
BIN = .venv/bin

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help venv demo test test-drivers lint bench gpu-report blender docs gallery meshes web wheel clean

help: ## list these commands
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "make %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

venv: ## make .venv for development, and find an OpenGL
	$(BOOTSTRAP) --group dev

demo: ## render a few pictures into out/, and build what runs in browsers where npm is
	$(BOOTSTRAP)
	@$(BIN)/python tools/build_web.py --if-npm
	@$(BIN)/python tools/demo.py

# One thread of the BLAS in each: more would wait for one another. Bytecode is kept whatever the shell says: tests start
# Python dozens of times, and pytest keeps the asserts that it rewrites.
# glibc keeps the memory of freed arrays: else it goes back to the system, which clears it anew for each of the next ones.
test: ## run the tests, in two processes
	$(BOOTSTRAP) --group test
	@$(BIN)/python tools/build_web.py --if-npm
	OPENBLAS_NUM_THREADS=1 PYTHONDONTWRITEBYTECODE= \
	GLIBC_TUNABLES=glibc.malloc.mmap_threshold=33554432:glibc.malloc.trim_threshold=268435456 \
	$(BIN)/python -m pytest -n 2 --dist worksteal $(PYTEST_ARGS)

test-drivers: ## run the tests of rendering on every OpenGL driver that is here: it takes long, see docs/drivers.md
	$(BOOTSTRAP) --group test
	@$(BIN)/python tools/drivers.py

lint: ## check style, types and the layers of the imports
	$(BOOTSTRAP) --group dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	@$(BIN)/python tools/build_web.py --if-npm --types

bench: ## measure speed and error of every method into out/report/, in half an hour; BENCH_ARGS=--quick: in one or two minutes
	$(BOOTSTRAP) --group test
	$(BIN)/translucent report -o out/report $(BENCH_ARGS)

gpu-report: ## on a machine with a GPU: tests, report, frames of large models, previewer, into docs/reports/gpu*
	$(BOOTSTRAP) --group test
	$(BIN)/python tools/gpu_report.py --keep

docs: ## build the site of docs/ into out/docs/, with the pictures of examples/ and a live scene where npm is
	$(BOOTSTRAP) --group docs
	@$(BIN)/python tools/build_web.py --if-npm
	@rm -rf docs/generated
	$(BIN)/python -m sphinx -W --keep-going -q docs out/docs

gallery: ## draw the pictures of docs/gallery and docs/pictures, and the contact sheets of docs/presets; it takes half an hour without a GPU
	$(BOOTSTRAP)
	$(BIN)/python tools/gallery.py
	$(BIN)/python tools/preset_sheets.py

meshes: ## regenerate the files in meshes/
	$(BOOTSTRAP) --group meshes
	$(BIN)/python tools/make_meshes.py

web: ## build what runs in browsers into web/dist/, and check its types; it needs npm
	$(BOOTSTRAP)
	@$(BIN)/python tools/build_web.py --types

wheel: ## build the wheel into dist/ and check it in an environment of its own
	$(BOOTSTRAP) --group dev
	@$(BIN)/python tools/build_web.py --if-npm
	$(BIN)/python tools/check_wheel.py

blender: ## build the extension for Blender into dist/, with wheels for each platform
	$(BOOTSTRAP) --group dev
	@$(BIN)/python tools/build_blender.py $(BLENDER_ARGS)

clean: ## remove all that these commands made: .venv, out/, dist/, caches
	rm -rf .venv out build dist web/dist web/node_modules web/src/generated docs/generated docs/gallery_of_examples .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find translucent tests tools -name __pycache__ -type d -prune -exec rm -rf {} +

# make demo   renders one glossy object, decomposes it, prints the paths of the pictures
# make test   linter, type checker and tests, within minutes
# make test-all   the same and the slow tests (test-slow: only these)
# make docs   the documentation site, in build/site (open build/site/index.html)
# make extension   Blender's add-on: one zip per platform and Python version in dist/; TARGET=here builds only for this machine
# make wheel   the wheel, with kernels for all machines, and the sdist, in dist/
# make kernels   the kernels for this machine, which an editable installation then uses; tests do so automatically
# The first call makes .venv; later ones reuse it until pyproject.toml or constraints.txt change. PYTHON=... selects an interpreter.

BIN := .venv/bin
INPUTS := pyproject.toml constraints.txt tools/setup.sh

.PHONY: demo test test-slow test-all lint docs kernels extension wheel clean
.DEFAULT_GOAL := demo

demo: .venv/.ready-demo
	@echo "demo: rendering a glossy object"
	@$(BIN)/python -m synth.demo_scene -o demo/input
	@echo "demo: taking it apart; the object is glossy, so likely highlights are removed, not only certain ones"
	@$(BIN)/isc decompose demo/input/photo.png -o demo/result --highlight-odds 1
	@echo "The photo:        demo/input/photo.png"
	@echo "What came out:    demo/result/preview.png (look at this first)"
	@echo "The textured mesh: demo/result/mesh.glb"

# Tests start hundreds of processes: bytecode is cached, even if the environment disables it.
test test-slow test-all: export PYTHONDONTWRITEBYTECODE =
# There is one process per core: threads of libraries within it would only wait for each other.
test test-slow test-all: export OPENBLAS_NUM_THREADS = 1
test test-slow test-all: export OMP_NUM_THREADS = 1

# One process per core. Workers process whole files, so that the fixtures of a file are made once.
PYTEST = $(BIN)/python -m pytest --numprocesses auto --dist loadfile

test: lint kernels
	$(PYTEST)

test-slow: kernels
	$(PYTEST) -m slow

# In one run: fixtures that fast and slow tests share are made once.
test-all: lint kernels
	$(PYTEST) -m "slow or not slow"

lint: .venv/.ready-dev
	$(BIN)/ruff check .
	$(BIN)/mypy --num-workers auto

docs: .venv/.ready-docs
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --clean --quiet
	@echo "The documentation: build/site/index.html"

# Compiles nothing if the kernels are unchanged.
kernels: build/.kernels-ready

build/.kernels-ready: .venv/.ready-dev $(shell find isc_core -name '*.py') $(wildcard blender_addon/packaging/kernels/*.*)
	@echo "kernels: compiling what changed (the first time, it takes a minute)"
	@mkdir -p build
	@$(BIN)/python -m blender_addon.packaging.kernels
	@touch $@

wheel: .venv/.ready-dev
	@$(BIN)/python -m blender_addon.packaging.kernels --all
	@$(BIN)/python -m build --sdist --wheel

TARGET := all

extension: .venv/.ready-dev
	@$(BIN)/python -m blender_addon.packaging $(TARGET) -o dist --wheels build/wheels

# A development environment also works for the demo; the demo alone does not need the large Blender module.
.venv/.ready-demo: $(INPUTS)
	@sh tools/setup.sh synth
	@touch $@

.venv/.ready-dev: $(INPUTS)
	@sh tools/setup.sh synth,blender,batch,dev,docs
	@touch $@ .venv/.ready-demo .venv/.ready-docs

.venv/.ready-docs: $(INPUTS)
	@sh tools/setup.sh docs
	@touch $@

clean:
	rm -rf .venv demo build dist isc_core/numerics/compiled *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# `make demo` and `make test` do all the set-up themselves; `make help` lists what there is.
.DEFAULT_GOAL := help
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.ready
SCENE ?=
# Most of the time goes into compiling kernels, one at a time. A file has one process, which builds
# what its tests share once.
PARALLEL ?= --numprocesses 2 --dist loadfile

# Of the views in docs/views, for `make figures`.
MESHES ?=
FIGURES ?=

.PHONY: help setup system demo view test test-all mutate torture lint format docs dist pictures figures figures-render figures-agreement clean

help:
	@echo "make demo [SCENE=path.glb]  render two built-in scenes, and your own, to out/; one beside a path tracer"
	@echo "make view [SCENE=path.glb]  show the built-in hall, or your scene, in the browser"
	@echo "make test                   run the tests"
	@echo "make test-all               run the slow ones too, on every OpenCL driver found"
	@echo "make mutate                 mutate the code at random and see which changes tests notice"
	@echo "make torture                threads, interrupts, kills, limits and hostile input, from a seed"
	@echo "make lint                   check style and types, and kernels with clang"
	@echo "make format                 format Python and OpenCL C"
	@echo "make docs [GALLERY=0]       build the documentation site to docs/_build/html; GALLERY=0 runs no scripts"
	@echo "make pictures               make the pictures of README and docs, small"
	@echo "make dist                   build wheel and sdist to dist/, and try them in a clean environment"
	@echo "make figures [MESHES=dir]   record every figure of README and docs on this machine, from a clean revision"
	@echo "make figures-render         make README and docs from the recorded figures"
	@echo "make figures-agreement      docs/agreement.md: all drivers held to each other, slow"
	@echo "make clean                  remove $(VENV), out/ and build products"

setup: $(STAMP)

# Debian packages that serve the OpenGL backend, the faster OpenCL driver, the lint of kernels and tests of the window.
# Nothing fails without them: what needs them says so.
system:
	@PYTHON=$(PYTHON) sh tools/system-packages.sh

# System packages come while pip works, but first where Python needs one of them to make environments.
$(STAMP): pyproject.toml Makefile tools/system-packages.sh
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || PYTHON=$(PYTHON) sh tools/system-packages.sh
	@PYTHON=$(PYTHON) sh tools/system-packages.sh & \
	$(PYTHON) -m venv $(VENV) && \
	$(BIN)/python -m pip install --quiet --upgrade pip && \
	$(BIN)/python -m pip install --quiet --editable '.[pocl,opengl,draco,truth,plots,cluster,docs,video,viewer,test]'; \
	status=$$?; wait; exit $$status
	@touch $(STAMP)

demo: setup
	@mkdir -p out
	$(BIN)/ssgi render cornell_box --output out/cornell_box.png
	$(BIN)/ssgi render hall --views --output out/hall.png
	$(BIN)/ssgi bench frame.default --scene cornell_box --size 160x120 --seconds 0.1 \
		--truth-paths 32 --markdown out/frames.md
	$(BIN)/ssgi devices
	@if [ -n "$(SCENE)" ]; then \
		set -x; $(BIN)/ssgi render "$(SCENE)" --views \
			--output "out/$$(basename "$(SCENE)" | sed 's/\.[^.]*$$//').png"; \
	fi

view: setup
	$(BIN)/ssgi view $(or $(SCENE),hall)

test: setup
	$(BIN)/python -m pytest -m "not slow" $(PARALLEL)

# The slow tests on the default device (kernels under oclgrind too), then the fast ones on every other
# device, each in its own process.
test-all: setup
	@PYTHON=$(PYTHON) sh tools/system-packages.sh oclgrind
	$(BIN)/python -m pytest $(PARALLEL)
	@$(BIN)/python -c "from ssgi_cl.device import drivers as d; best = d.choose(None); \
		print(*(i.label for i in d.devices() if i.best and i != best), sep='\n')" | \
	while read -r label; do \
		[ -z "$$label" ] || { echo "on $$label"; \
		SSGI_CL_DEVICE="$$label" $(BIN)/python -m pytest -m "not slow" $(PARALLEL) || exit 1; }; \
	done
	$(MAKE) docs

# Works on a copy of the tree; build/mutation.md is the report. MUTATE="--help" lists the options.
MUTATE ?=
mutate: setup
	$(BIN)/python -m tools.mutate $(MUTATE)

# Under ten minutes on two cores. TORTURE="--help" lists the options.
TORTURE ?=
torture: setup
	$(BIN)/python -m tools.torture $(TORTURE)

# mypy and import-linter do not follow an editable installation into folders of other names.
lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check --quiet .
	git ls-files 'kernels/*.cl' 'kernels/*.clh' | xargs $(BIN)/clang-format --dry-run --Werror
	@rm -rf build/types && mkdir -p build/types/ssgi_cl
	@ln -s $(CURDIR)/ssgi_cl/* $(CURDIR)/bench $(CURDIR)/rasterize build/types/ssgi_cl/
	cd build/types && $(CURDIR)/$(BIN)/mypy --config-file $(CURDIR)/pyproject.toml
	cd build/types && PYTHONPATH=. $(CURDIR)/$(BIN)/lint-imports --config $(CURDIR)/pyproject.toml
	$(BIN)/python -m pytest --quiet --numprocesses 2 tests/lint_kernel_files.py

# Warnings are errors. Scripts of the gallery whose text did not change do not run again.
GALLERY ?= 1
docs: setup
	$(BIN)/python -m sphinx -W --keep-going -q -b html -d docs/_build/doctrees \
		-D plot_gallery=$(GALLERY) docs docs/_build/html
	@echo "docs/_build/html/index.html"

pictures: setup
	$(BIN)/python -m tools.pictures

dist: setup
	PYTHON=$(PYTHON) VENV=$(VENV) sh tools/dist.sh

# About 20 minutes on two cores. FIGURES="--quick --allow-dirty" tries it.
figures: setup
	$(BIN)/python -m tools.figures $(if $(MESHES),--meshes "$(MESHES)") $(FIGURES)

figures-render: setup
	$(BIN)/python -m tools.figures --render

figures-agreement: setup
	$(BIN)/python -m ssgi_cl.bench.experiments.agreement

format: setup
	$(BIN)/ruff format .
	git ls-files 'kernels/*.cl' 'kernels/*.clh' | xargs $(BIN)/clang-format -i

clean:
	rm -rf $(VENV) out build dist *.egg-info docs/_build docs/generated

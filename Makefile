# make repro   the whole workflow, from params.yaml to reports/
# make test    every check
# make bench   benchmarks
# make setup   .venv as requirements.lock has it
# make lock    requirements.lock anew, from pyproject.toml
# make clean   remove .venv

SHELL := bash
.SHELLFLAGS := -eo pipefail -c
PYTHON ?= $(shell command -v python3.11 || command -v python3)
# dvc, and the `python` in dvc.yaml's commands, are the ones in .venv.
export PATH := $(CURDIR)/.venv/bin:$(PATH)
CODE := benchmarks src stages tests
STAMP := .venv/.made-from-lock

.PHONY: repro test bench setup lock clean python

repro: setup
	graspfn check
	dvc repro

# What the hooks of .pre-commit-config.yaml run, which ask for git. pytest comes last: its closing line is the verdict.
test: setup
	graspfn check
	ruff check $(CODE)
	ruff format --check $(CODE)
	mypy
	pytest --numprocesses auto --maxprocesses 4 --dist loadfile

bench: setup
	graspfn check
	python benchmarks/height_map.py
	OPENBLAS_NUM_THREADS=1 python benchmarks/speed.py
	python benchmarks/run.py
	python benchmarks/feeding.py

# DVC has to be told that an unpacked archive is no git repository. It reads one that git refuses, all but for its diffs.
setup: $(STAMP)
	@git rev-parse 2>/dev/null || { test ! -e .git && dvc config core.no_scm true; } \
	  || echo "git refuses this folder, and dvc's diffs with it; if another user's, git config --global --add safe.directory '$(CURDIR)'"

# Rebuilt from nothing, so that a package that left the lock leaves .venv as well.
$(STAMP): requirements.lock pyproject.toml | python
	"$(PYTHON)" -m venv --clear .venv
	.venv/bin/python -m pip install -qq --disable-pip-version-check --requirement requirements.lock
	.venv/bin/python -m pip install -qq --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@

# One lock for running and developing. Left out of it: local version tags and CUDA's own packages, which belong to
# the build of torch that a machine gets, not to this project.
lock: | python
	"$(PYTHON)" -m venv --clear .venv-lock
	.venv-lock/bin/python -m pip install -qq --disable-pip-version-check '.[workflow,dev,opengl,bench,serve]'
	{ echo "# Every package in .venv. Made by \`make lock\` from pyproject.toml; do not edit."; \
	  echo "# torch is pinned without a local tag: where pip finds a CUDA build, it adds the nvidia-* packages of that build."; \
	  .venv-lock/bin/python -m pip freeze --all --exclude pip --exclude graspfn \
	  | grep -vE '^(nvidia|cuda|triton)' | sed -E 's/\+[[:alnum:].]+$$//'; } > requirements.lock.tmp
	mv requirements.lock.tmp requirements.lock
	rm -rf .venv-lock

clean:
	rm -rf .venv .venv-lock

python:
	@"$(or $(PYTHON),false)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null \
	  || { echo "Python 3.11 or later not found: apt-get install python3 python3-venv"; exit 1; }
	@"$(PYTHON)" -c 'import ensurepip, venv' 2>/dev/null \
	  || { echo "$(PYTHON) cannot make virtual environments: apt-get install python3-venv"; exit 1; }

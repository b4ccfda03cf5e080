# SPDX-License-Identifier: Apache-2.0
# `make run` and `make test` need only Python 3.11 or later with venv; the rest goes into .venv.

PYTHON ?= python3
JOBS ?= 2
BIN := .venv/bin

# A sourced ROS environment or another virtualenv must not reach .venv, whose ROS 2 is its own.
# What a user sets on purpose stays.
unexport PYTHONPATH PYTHONHOME VIRTUAL_ENV LD_LIBRARY_PATH CMAKE_PREFIX_PATH
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE
unexport $(filter-out ROS_DOMAIN_ID ROS_HOME ROS_LOG_DIR, \
  $(filter ROS_% AMENT_% COLCON_% RMW_% FASTRTPS_% FASTDDS_% CYCLONEDDS_%,$(.VARIABLES)))
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: help run test test-all lint studies examples test-matrix clean FORCE

help:
	@echo 'make run    walk hexapod_patches on ROS 2 nodes: a bag, a report, a comparison'
	@echo 'make test   the core, the nodes, one trial of each kind: a few minutes'
	@echo 'make test-all  ruff, mypy, every test, one row of the matrix; what CI runs'
	@echo 'make docs   the site of docs/, in build/site; its examples are run, its links checked'
	@echo 'make test-matrix  the tests on other Pythons, and with old NumPy and SciPy'
	@echo 'make studies  the evidence: charts and tables, written to runs'
	@echo 'make examples  the pictures of docs/examples.md, anew'
	@echo 'make clean  remove .venv and what builds and tests left; runs/ stays'
	@echo 'All make .venv if need be; PYTHON=python3.12 chooses its Python.'

run: .venv/ros.stamp
	@$(BIN)/pad run hexapod_patches $(ARGS)

# Tests run on all cores: threads of matrix products would only wait for one another (25 s in place
# of 4 for one film).
test test-all test-matrix: export OPENBLAS_NUM_THREADS := 1

test: .venv/test.stamp
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile -m 'not realtime and not slow' \
	  --ignore test/studies $(ARGS)

test-all: .venv/test.stamp lint
	$(BIN)/python -m pytest -n $(JOBS) --dist loadfile -m 'not realtime' $(ARGS) || $(NONE_CHOSEN)
	$(BIN)/python -m pytest -m realtime $(ARGS) || $(NONE_CHOSEN)
	@$(MAKE) --no-print-directory test-matrix MATRIX=$(CI_ROW) \
	  MARKS='not realtime and not slow' CORE_TESTS='$(CI_ROW_TESTS)' \
	  CORE_PACKAGES='$(CI_ROW_PACKAGES)'

lint: .venv/test.stamp
	$(BIN)/python -m ruff check
	$(BIN)/python -m ruff format --check
	$(BIN)/python -m mypy

# Warnings are errors. test_site.py looks at what is in SITE.
.PHONY: docs
docs: export OPENBLAS_NUM_THREADS := 1
docs: export SITE := build/site
docs: .venv/test.stamp
	$(BIN)/python -m sphinx -q -E -W --keep-going docs $(SITE)
	$(BIN)/python -m pytest test/test_site.py test/test_docs.py test/test_tutorials.py $(ARGS)
	@echo 'site:     $(SITE)/index.html'

STUDIES := contact meniscus capillary walk stability estimator film

# What takes minutes at most; `python -m studies` lists the longer ones.
studies: .venv/test.stamp
	@for study in $(STUDIES); do \
	  $(BIN)/python -m studies $$study --out runs/studies || exit; done
	@$(BIN)/python -m studies thesis --out runs/studies/thesis.html --force

examples: .venv/test.stamp
	@for each in examples/*.py; do \
	  $(BIN)/python $$each docs/charts/example_$$(basename $$each .py).png || exit; done

# pytest's status when ARGS chose tests of one of the two runs only. What is measured against the
# clock has the processors to itself.
NONE_CHOSEN := [ $$? -eq 5 ]

# A row is a version of Python, alone or with what it is to run on. Rows without ROS test the core,
# and so that it needs none; `oldest` is the NumPy and SciPy of Ubuntu 24.04; `jazzy` and `kilted`
# test the nodes; `wheel` installs the wheel with its libraries into an empty environment.
# `make test-matrix MATRIX=3.12-kilted` runs one row.
# `test-all` runs CI_ROW on physics, estimation, control and drivers: what Ubuntu 24.04 has, the home
# of ROS 2 Jazzy. Where its Python is missing, the summary says so.
CI_ROW := 3.12-oldest
CI_ROW_TESTS := test/contact test/estimation test/control test/regulators test/simulation
# What these tests import; all of the extra `test` takes twice as long to install.
CI_ROW_PACKAGES := .[mujoco,fast] hypothesis mpmath pytest pytest-xdist
MARKS := not realtime
CORE_PACKAGES := .[test]
MATRIX ?= 3.11 3.12 3.13 3.12-oldest 3.12-jazzy 3.13-jazzy 3.12-kilted
CORE_TESTS := test --ignore test/nodes
NODE_TESTS := test/nodes test/bags test/trials/test_recorded.py test/test_cli.py

test-matrix:
	@mkdir -p .matrix && : > .matrix/summary
	@set -f; for row in $(MATRIX); do $(MATRIX_ROW); done
	@echo && cat .matrix/summary && ! grep -q FAILED .matrix/summary

# Where Pythons are managed by pyenv, PYENV_VERSION makes python3.13 mean what it says.
define MATRIX_ROW
  version=$${row%%-*}; python=.matrix/$$row/bin/python; tests='$(CORE_TESTS)'; \
  export WHEEL_LIBRARIES=; \
  case $$row in \
    *-oldest) packages='$(CORE_PACKAGES) numpy==1.26.* scipy==1.11.*' ;; \
    *-jazzy) packages='.[ros,test]'; tests='$(NODE_TESTS)' ;; \
    *-kilted) packages='.[kilted,test]'; tests='$(NODE_TESTS)' ;; \
    *-wheel) packages='. pytest pytest-xdist setuptools'; tests=test/test_wheel.py; \
      export WHEEL_LIBRARIES=index ;; \
    *) packages='$(CORE_PACKAGES)' ;; \
  esac; \
  if ! PYENV_VERSION=$$version python$$version -c 'import ensurepip, venv' 2>/dev/null; then \
    echo "$$row: not run: python$$version is missing, or cannot make a virtual environment" \
      | tee -a .matrix/summary; \
    continue; \
  fi; \
  echo "$$row: installing $$packages into .matrix/$$row ..."; \
  if PYENV_VERSION=$$version python$$version -m venv .matrix/$$row && \
     $$python -m pip install --quiet --no-compile --editable $$packages && \
     $$python -m pytest -n $(JOBS) --dist loadfile -m '$(MARKS)' $$tests $(ARGS); \
  then verdict=passed; else verdict=FAILED; fi; \
  echo "$$row: $$verdict, with $$($$python -m pip freeze | grep -iE '^(numpy|scipy|rclpy)==' \
    | xargs)" >> .matrix/summary
endef

# Without --no-compile pip takes twice as long: most modules that it compiles are never imported.
# A stamp holds the path of its checkout: a .venv that was moved or lost its Python is redone.
STALE := $(shell grep -sqxF '$(CURDIR)' .venv/ros.stamp && test -x $(BIN)/python || echo FORCE)

.venv/ros.stamp: EXTRAS := ros,mujoco,plot,make
.venv/test.stamp: EXTRAS := ros,test
.venv/ros.stamp .venv/test.stamp: setup.py setup.cfg $(STALE)
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || { $(MAKE_VENV); }
	@echo 'Installing ros_pad[$(EXTRAS)] with ROS 2 Jazzy into .venv:' \
	  'about 600 MB, one minute on a fast line ...'
	@$(BIN)/python -m pip install --quiet --no-compile --editable '.[$(EXTRAS)]' || { \
	  echo 'ros_pad was not installed: pip says why above. Can this machine reach the Python package index?'; \
	  exit 1; }
	@pwd > .venv/ros.stamp
	@pwd > $@

# On Debian and Ubuntu ensurepip, and with it a working venv, comes in a package of its own.
define MAKE_VENV
  if command -v $(PYTHON) >/dev/null && \
     ! $(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then \
    echo "ros_pad needs Python 3.11 or later; $(PYTHON) is $$($(PYTHON) -V)."; \
    echo 'Name another one, for instance: make $(MAKECMDGOALS) PYTHON=python3.12'; exit 1; fi; \
  $(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
    echo '$(PYTHON) is missing, or cannot make a virtual environment. Run this once:'; \
    echo '  sudo apt install $(notdir $(PYTHON))-venv'; exit 1; }; \
  $(PYTHON) -m venv --clear .venv || { rm -rf .venv; exit 1; }
endef

clean:
	rm -rf .venv .matrix build install log *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

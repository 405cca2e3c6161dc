# run, test, test-long, lint, doc, bench, figures, clean: each makes .venv first where it has to.
PYTHON ?= python3
ARGS ?=
VENV := .venv
BIN := $(VENV)/bin
SOURCES := gear_rattle_ros test tools benchmark config/launch doc setup.py
# What an editable install copies or reads: a change of it installs anew.
INSTALLED := setup.py setup.cfg package.xml constraints.txt requirements.txt gear_rattle_ros/start.py $(shell find config resource -type f)
PIP := $(BIN)/python -m pip install --quiet --no-input --disable-pip-version-check \
	--constraint constraints.txt

COMPUTING := test/attractors test/cli test/core test/figures test/store test/studies

# Nodes find each other on this machine only, and files below the prefix of the environment.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
# A sourced ROS installation would mix its own rclpy into it.
export AMENT_PREFIX_PATH := $(CURDIR)/$(VENV)
unexport PYTHONPATH
# Each of hundreds of processes would compile its sources anew.
unexport PYTHONDONTWRITEBYTECODE

define CHECK
import platform as p, sys
version, system, machine = sys.version_info[:2], p.system(), p.machine()
good = (system, machine, p.libc_ver()[0]) == ('Linux', 'x86_64', 'glibc')
if not good or not (3, 11) <= version <= (3, 14):
    sys.exit(
        'make: the ROS 2 wheels need Linux on x86_64 with glibc and Python 3.11 to 3.14, and '
        f'$(PYTHON) is Python {version[0]}.{version[1]} on {system} {machine}; '
        'name another with make PYTHON=...')
try:
    import ensurepip, venv
except ImportError:
    sys.exit(
        'make: $(PYTHON) cannot make a virtual environment; install the package '
        f'python{version[0]}.{version[1]}-venv, or name another with make PYTHON=...')
endef
export CHECK

.PHONY: run test test-long lint doc bench figures clean
.DELETE_ON_ERROR:

run: $(VENV)/run.stamp
	@$(BIN)/python -S tools/foreground.py $(BIN)/gear_rattle suite $(ARGS)

# The workers have all cores already.
test test-long: export OPENBLAS_NUM_THREADS := 1

test: $(VENV)/test.stamp
	$(BIN)/python -m pytest -n 2 --dist loadfile $(ARGS)

# Computing runs in parallel, nodes one test at a time; status 5 means that ARGS select no test.
test-long: $(VENV)/test.stamp
	@status=0; for part in '-n 2 --dist worksteal $(COMPUTING)' \
		'$(COMPUTING:%=--ignore=%)'; \
	do $(BIN)/python -m pytest -m long $$part $(ARGS) || test $$? = 5 || status=1; done; \
	exit $$status

# All of them run, even if the first fails.
lint: $(VENV)/test.stamp
	@status=0; for check in \
		'ruff check $(SOURCES)' \
		'flake8 $(SOURCES)' \
		'ament_pep257 gear_rattle_ros' \
		mypy \
		lint-imports \
		'python tools/check_manifest.py package.xml'; \
	do echo "== $$check"; $(BIN)/$$check || status=1; done; exit $$status

# The site, in build/doc; a warning is an error.
doc: $(VENV)/doc.stamp
	$(BIN)/python -m sphinx -q -W --keep-going -E -b html doc build/doc
	@echo 'build/doc/index.html'

bench: $(VENV)/test.stamp
	@set -e; for script in $(sort $(wildcard benchmark/*.py)); do \
		echo "== $$script"; $(BIN)/python $$script; done

figures: $(VENV)/run.stamp
	$(BIN)/gear_rattle figures $(ARGS)

clean:
	rm -rf $(VENV) build install log *.egg-info .mypy_cache .pytest_cache .ruff_cache \
		.import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(VENV)/run.stamp: $(INSTALLED)
	@command -v $(PYTHON) >/dev/null || { \
		echo 'make: no $(PYTHON) here; name a Python 3.11 to 3.14 with make PYTHON=...' >&2; exit 2; }
	@$(PYTHON) -c "$$CHECK"
	@echo 'Installing ROS 2 Jazzy, numba, rerun and what they need into $(VENV): about 1.5 GB, some'
	@echo 'minutes ...'
	@test -x $(BIN)/pip || $(PYTHON) -m venv --clear $(VENV)
	@$(PIP) setuptools
	@$(PIP) --no-build-isolation --editable '.[ros]'
	@touch $@

$(VENV)/test.stamp: $(VENV)/run.stamp
	@echo 'Installing the tools of the tests into $(VENV) ...'
	@$(PIP) --no-build-isolation --editable '.[ros,test,lint]'
	@touch $@

$(VENV)/doc.stamp: $(VENV)/run.stamp
	@echo 'Installing what builds the site into $(VENV) ...'
	@$(PIP) --no-build-isolation --editable '.[ros,doc]'
	@touch $@

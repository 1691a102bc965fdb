# Two commands do everything: `make demo` and `make test`. They need Python >= 3.11 and make, nothing else.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
STAMP  := $(VENV)/.installed

.PHONY: help demo test long hidden lint wheel bench scoreboard clean
.DEFAULT_GOAL := help

help:
	@echo "make demo    the main job on a simulated machine: gauges in, corrected setpoints out (20 s)"
	@echo "make test    the tests; two hidden causes are found on wires among them"
	@echo "make long    the tests that take minutes"
	@echo "make hidden  hidden causes are found, adopted, and the live error falls: on wires, four at a time (15 min)"
	@echo "make lint    ruff, mypy, import contracts"
	@echo "make wheel   build the wheel, install it in a clean environment, run it"
	@echo "make scoreboard  the diagnosis on hundreds of simulated machines (hours; goes on where it was)"
	@echo "make bench   the benchmarks, as ratios (gcc and cyclictest are used where present)"

$(STAMP): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "compd needs Python >= 3.11; this is $$($(PYTHON) --version). Try: make PYTHON=python3.12"; exit 1; }
	@$(PYTHON) -m venv $(VENV) || \
	  { echo "Python cannot make a virtual environment; on Debian and Ubuntu: apt-get install python3-venv"; exit 1; }
	@echo "Installing compd and what it needs into $(VENV) (a minute or two, once) ..."
	@$(BIN)/pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

demo: $(STAMP)
	@$(BIN)/compd demo

# A hidden cause is found on wires, in real time: two minutes each, so they have a target of their own. One takes a
# third of a processor: four at a time leave two processors enough for everything to be in time.
HIDDEN := tests/system/test_tutorial.py tests/system/test_hidden_effect.py
SIDE_BY_SIDE ?= 4

test: $(STAMP)
	$(BIN)/pytest $(HIDDEN:%=--ignore=%)
	$(BIN)/pytest -n 2 $(HIDDEN)

long: $(STAMP)
	$(BIN)/pytest -m long $(HIDDEN:%=--ignore=%)

hidden: $(STAMP)
	$(BIN)/pytest -m '' -n $(SIDE_BY_SIDE) --dist worksteal $(HIDDEN)

lint: $(STAMP)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports

wheel: $(STAMP)
	rm -rf dist build/wheel-test
	$(BIN)/python -m build --wheel --outdir dist .
	$(PYTHON) -m venv build/wheel-test
	build/wheel-test/bin/pip install --quiet --disable-pip-version-check dist/compd-*.whl
	cd build && wheel-test/bin/compd --help && wheel-test/bin/compd check --drivers

bench: $(STAMP)
	$(BIN)/python -m tests.benchmarks.bench_kinematics
	$(BIN)/python -m tests.benchmarks.bench_cycle
	$(BIN)/python -m tests.benchmarks.bench_loop
	$(BIN)/python -m tests.benchmarks.bench_latency
	$(BIN)/python -m tests.benchmarks.bench_throughput
	$(BIN)/python -m tests.benchmarks.bench_compare
	$(BIN)/python -m tests.benchmarks.bench_diagnose

# More by option: make scoreboard OPTIONS="--seeds 10 --jobs 8"
scoreboard: $(STAMP)
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.scoreboard $(OPTIONS)

clean:
	find . -name __pycache__ -not -path "./$(VENV)/*" -prune -exec rm -rf {} +
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis

# Two commands do everything: `make demo` and `make test`. They need Python >= 3.11 and make, nothing else.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
# compd with what the demo needs, and its kernels compiled
COMPILED := $(VENV)/.compiled
# with the tools of development, too
STAMP  := $(VENV)/.installed
PIP    := $(BIN)/pip install --quiet --disable-pip-version-check
# what a build and compiling the kernels need, a line each
BUILD_PACKAGES := import tomllib; project = tomllib.load(open("pyproject.toml", "rb")); \
  hooks = project["tool"]["hatch"]["build"]["targets"]["wheel"]["hooks"]; \
  print(*project["build-system"]["requires"], *hooks["custom"]["dependencies"], sep="\n")
# Where it is set, as in many containers, every start of Python takes twice as long.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help gallery docs demo demo-linuxcnc live test long service pages pages-sample walks walks-sample hidden hidden-sample faults faults-sample lint pre-commit wheel deb bench bench-sample costs budget worlds soak scoreboard sensitivity nightly clean
.DEFAULT_GOAL := help

help:
	@echo "make demo    the main job on a simulated machine: gauges in, corrected setpoints out (20 s)"
	@echo "make demo-linuxcnc  LinuxCNC corrected, a hidden effect probed, diagnosed, adopted (ten minutes; Debian's linuxcnc-uspace)"
	@echo "make live    the same machine live in the browser, until Ctrl-C"
	@echo "make test    the tests; a hidden cause is found on wires among them (9 min)"
	@echo "make sample  some of the longer ones: the page in a real browser, LinuxCNC, the fault matrix, fuzzers (10 min)"
	@echo "make lint    ruff, mypy, import contracts"
	@echo "make docs    the documentation with its gallery; compd docs opens it"
	@echo "make wheel   build sdist and wheel, check them, install the wheel in a clean environment, run it"
	@echo "make deb     Debian packages for Debian 12 and 13, in dist/ (root; debootstrap, systemd-container; 12 min)"
	@echo "make pages   every command and piece of Python of README and docs, run (15 min; make pages-sample 6)"
	@echo "make walks   the examples of CONTRIBUTING.md, applied to a copy of the tree (8 min; make walks-sample 1)"
	@echo "make service the daemon under systemd in a container: sandbox, restart, watchdog, reload, stop (root; 3 min)"
	@echo "make hidden  hidden causes are found, adopted, and the live error falls: on wires, four at a time (16 min)"
	@echo "make faults  every fault at rest, in motion, restarted and under load, and 150 pairs, in simulated time, against the stated bound (20 min)"
	@echo "make worlds  the daemon, its machine and random faults in simulated time, from seeds (OPTIONS=\"--seed 7 --minutes 10\")"
	@echo "make soak    a machine without faults for a day in time-lapse: false alarms (1 h; OPTIONS=\"--hours 1\")"
	@echo "make bench   the benchmarks, as ratios (gcc and cyclictest are used where present)"
	@echo "make costs   the README's table of what compd costs (cyclictest; half an hour, less with OPTIONS="--rounds 2 --rows 2000000")"
	@echo "make budget  lines, files, doors, commands and keys of the tree, beside their limits (1 min)"
	@echo "make scoreboard  the diagnosis on 1600 simulated machines (hours; continues where it stopped)"
	@echo "make sensitivity  the scoreboard with each threshold of the diagnosis halved and doubled (hours; continues, too)"
	@echo "make nightly everything: lint, wheel, demo, test, the long tests, hidden, bench, faults, an hour of fresh worlds, soak, the scoreboard"
	@echo "tests/README.md says what each takes and what .ci/run runs"

# numba and what the kernels import come first. Then two processes compile, beside the installation of the other
# packages, which needs no build environment of its own: it would have numba once more.
$(COMPILED): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "compd needs Python >= 3.11; this is $$($(PYTHON) --version). Try: make PYTHON=python3.12"; exit 1; }
	@$(PYTHON) -m venv $(VENV) || \
	  { echo "Python cannot make a virtual environment; on Debian and Ubuntu: apt-get install python3-venv"; exit 1; }
	@echo "Installing compd and what it needs into $(VENV), and compiling the kernels (one minute, once) ..."
	@$(PYTHON) -c '$(BUILD_PACKAGES)' | $(PIP) --requirement /dev/stdin
	@$(BIN)/python -m compd.compile_kernels & compiling=$$!; \
	  $(PIP) --no-build-isolation --editable '.[page]'; installed=$$?; wait $$compiling && exit $$installed
	@touch $@

$(STAMP): $(COMPILED)
	@echo "Installing the tools of development into $(VENV) ..."
	@$(PIP) --no-build-isolation --editable '.[dev]'
	@touch $@

demo: $(COMPILED)
	@$(BIN)/compd demo

# A hidden effect, to be found in the browser: out/workbench has the recording, and its answer under seal.
workbench: $(COMPILED)
	@mkdir -p out/workbench
	@$(BIN)/compd sim campaign config/tripod-cmm.yaml --hidden 8 --out out/workbench/hidden.csv --overwrite
	@$(BIN)/compd page --recordings out/workbench --models out/workbench --workbench hidden

live: $(COMPILED)
	@$(BIN)/compd demo --live

# Needs Debian's linuxcnc-uspace.
demo-linuxcnc: $(COMPILED)
	@$(BIN)/python examples/linuxcnc/run.py

# A hidden cause is found on wires, in real time: two minutes each, so they have a target of their own. Each takes a
# third of a processor: four at a time leave two processors enough for everything to be in time.
HIDDEN := tests/system/test_tutorial.py tests/system/test_hidden_effect.py \
	tests/system/test_hidden_effect_any_machine.py tests/system/test_hidden_effect_of_kinds.py
SIDE_BY_SIDE ?= 4
# Likewise the commands of the documentation's pages and the examples of CONTRIBUTING.md.
DOCUMENTED := tests/system/test_pages.py tests/system/test_contributing.py

# What runs a daemon or a browser in real time. It waits as much as it computes: two side by side are still in time, but
# not beside tests that compute.
REAL_TIME := $(addprefix tests/system/,page processes linuxcnc test_budget.py test_chain.py test_demo.py test_fault_matrix.py \
  test_half_open_connections.py test_pushed_lines.py test_reference_examples.py test_simultaneous_sampling.py)
COMPUTED := $(REAL_TIME:%=--ignore=%) $(HIDDEN:%=--ignore=%)
# Files are shared out whole: what the tests of one share is made once.
IN_REAL_TIME := -n 2 --dist loadfile

# Tests run side by side: threads of the linear algebra beside them take twice the processor time.
ONE_THREAD := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
PYTEST := $(ONE_THREAD) $(BIN)/pytest

# Three at once: some of them wait for a process or a line.
test: $(STAMP)
	$(PYTEST) -n 3 --dist worksteal $(COMPUTED)
	$(PYTEST) -rs $(IN_REAL_TIME) $(HIDDEN) $(REAL_TIME)

long: $(STAMP)
	$(PYTEST) -m long $(HIDDEN:%=--ignore=%) $(DOCUMENTED:%=--ignore=%) $(SERVICE:%=--ignore=%)

# Of the long ones those that .ci/run runs, but for the targets below. Attacks and browsers have the computer for themselves.
sample: $(STAMP)
	$(PYTEST) -m sample -n 2 $(COMPUTED) $(DOCUMENTED:%=--ignore=%)
	$(PYTEST) -m sample $(REAL_TIME)

# The unit under systemd, in a container, and the packages that `make deb` has built; -rP prints the times of restart and stop. Skipped but for root with the
# packages debootstrap and systemd-container.
SERVICE := tests/system/test_service_in_container.py tests/system/test_debian_package.py

service: $(STAMP)
	$(PYTEST) -m long -rsP $(SERVICE)

# Every command and every piece of Python of README and docs/; those with a machine in real time one after the other.
PAGES := tests/system/test_pages.py

pages: $(STAMP)
	$(PYTEST) -m long -n 2 --dist worksteal $(PAGES) -k test_everything_on_a_page_runs
	$(PYTEST) -m long $(PAGES) -k test_everything_on_a_page_with_a_machine_runs

# Without the longest.
pages-sample: $(STAMP)
	$(PYTEST) -m sample -n 2 --dist worksteal $(PAGES) -k test_everything_on_a_page_runs
	$(PYTEST) -m sample $(PAGES) -k test_everything_on_a_page_with_a_machine_runs

# The worked examples of CONTRIBUTING.md.
walks: $(STAMP)
	$(PYTEST) -m long tests/system/test_contributing.py

# All of them together, without what takes minutes.
walks-sample: $(STAMP)
	$(PYTEST) -m sample tests/system/test_contributing.py

hidden: $(STAMP)
	$(PYTEST) -m '' -n $(SIDE_BY_SIDE) --dist worksteal $(HIDDEN)

# The tutorial, and a cause outside the library; one after the other, as other work may run beside them.
hidden-sample: $(STAMP)
	$(PYTEST) -m sample $(HIDDEN)

lint: $(STAMP)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports

# As git runs it before a commit, on all files.
pre-commit: $(STAMP)
	$(BIN)/pre-commit run --all-files --show-diff-on-failure

wheel: $(STAMP) docs
	rm -rf dist build/wheel-test
	$(BIN)/python -m build --outdir dist .
	$(BIN)/twine check --strict dist/*
	$(PYTHON) -m venv build/wheel-test
	build/wheel-test/bin/pip install --quiet --disable-pip-version-check dist/compd-*.whl
	cd build && wheel-test/bin/compd --help && wheel-test/bin/compd gauge list
	test -s "$$(cd build && wheel-test/bin/compd docs --path)"
	$(PYTEST) tests/system/test_wheel.py

# A Debian package for each release, in dist/, judged by lintian; root, and the packages debootstrap and systemd-container.
RELEASES ?= bookworm trixie

deb: $(STAMP) docs
	rm -rf build/deb
	$(BIN)/python -m build --sdist --outdir build/deb .
	for release in $(RELEASES); do debian/build $$release build/deb/compd-*.tar.gz || exit 1; done

SAMPLE := kinematics cycle diagnose worlds
BENCH := $(SAMPLE) compare loop latency flood throughput page gateway long fleet kilohertz targets

bench: $(STAMP)
	@for name in $(BENCH); do $(BIN)/python -m tests.benchmarks.bench_$$name || exit 1; done

# The README's table of costs, from one run of half an hour on a quiet machine.
costs: $(STAMP)
	@$(BIN)/python -m tests.benchmarks.costs $(OPTIONS)

# What the tree weighs, beside its limits: tests/budget/numbers.yaml
budget: $(STAMP)
	@$(BIN)/python -m tests.budget

# Without those that run in real time for minutes.
bench-sample: $(STAMP)
	@for name in $(SAMPLE); do $(BIN)/python -m tests.benchmarks.bench_$$name || exit 1; done

# Every fault in every situation, and pairs of faults: a valid setpoint is wrong by no more than it says. One trial:
# make faults OPTIONS="scale-jumps@motion"; those with real parts are of tests/system/test_fault_matrix.py.
faults: $(STAMP)
	$(ONE_THREAD) $(BIN)/python -m tests.injection $(OPTIONS)

faults-sample: $(STAMP)
	$(ONE_THREAD) $(BIN)/python -m tests.injection --sample $(OPTIONS)

# A failing seed has its line to repeat it: make worlds OPTIONS="--seed 7 --minutes 1 --rates campaign"
worlds: $(STAMP)
	$(ONE_THREAD) $(BIN)/python -m tests.worlds $(OPTIONS)

# What is judged wrong of readings that are right.
soak: $(STAMP)
	$(BIN)/python -m tests.soak $(OPTIONS)

# A part of it by option: make scoreboard OPTIONS="--family glints change --jobs 8"
scoreboard: $(STAMP)
	$(ONE_THREAD) $(BIN)/python -m tests.scoreboard --set full $(OPTIONS)

# On cases that `make scoreboard` never shows.
sensitivity: $(STAMP)
	$(ONE_THREAD) $(BIN)/python -m tests.scoreboard --set tuning --prepare --campaigns out/tuning
	$(ONE_THREAD) $(BIN)/python -m tests.scoreboard.sensitivity --campaigns out/tuning $(OPTIONS)

# The gallery runs simulations for a minute: only when the code or the configurations have changed.
# SCREENSHOTS=required makes it an error that there is no Chromium.
GALLERY := docs/_build/gallery.made

$(GALLERY): $(shell find compd drivers config docs/gallery -name '*.py' -o -name '*.yaml' -o -name '*.html') | $(STAMP)
	$(BIN)/python -m docs.gallery --screenshots $(or $(SCREENSHOTS),where-possible)
	@touch $@

# A simulation, a diagnosis and a spreadsheet: 20 seconds.
EXAMPLE := docs/_build/worked-example/.made

$(EXAMPLE): $(shell find compd config docs/worked_example -name '*.py' -o -name '*.yaml') | $(STAMP)
	$(BIN)/python -m docs.worked_example
	@touch $@

gallery: $(GALLERY) $(EXAMPLE)

# Begun afresh, so that the wheel has no page of yesterday.
docs: gallery
	rm -rf docs/_build/html
	$(BIN)/python -m docs.generate
	$(BIN)/sphinx-build --builder html --fail-on-warning --keep-going --quiet \
	  --doctree-dir docs/_build/doctrees docs docs/_build/html
	@echo "docs/_build/html/index.html"

# Hours of faults, and other examples of every fuzzer than yesterday's.
nightly: lint wheel deb demo test pages walks long service hidden bench faults
	$(ONE_THREAD) $(BIN)/python -m tests.worlds --fresh-for 3600 --fresh-fails --jobs 2
	$(BIN)/python -m tests.worlds.defects --seeds 1
	$(BIN)/python -m tests.soak --hours 24
	COMPD_FUZZ=20 $(PYTEST) --timeout 1800 tests/fuzz
	$(MAKE) scoreboard

clean:
	find . -name __pycache__ -not -path "./$(VENV)/*" -prune -exec rm -rf {} +
	rm -rf $(VENV) build dist docs/_build docs/gallery/cases.md .pytest_cache .mypy_cache .ruff_cache .hypothesis

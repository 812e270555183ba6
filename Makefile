# make demo: build the FMUs, fly the paper's scenario, draw it. make test: lint and run the tests.
# make test-all: the same, with the whole of what make test has a sample of (CONTRIBUTING.md). Before a release.
# make check: lint and the most informative fast tests, under a minute, for while you work.
# make coverage: all tests, and which lines they run. make site: the documentation as a site, in site/.
# make bench: time the loop. make figures, make findings, make interop: figures, tables and icons of docs/ and examples/.
# make faults: commands whose calls of the operating system fail, and the C under sanitizers; half an hour.
# make release: wheel, sources, native FMUs, SSP and their checksums, in dist/.
# make newcomer: run every block of every page in a clone of the last commit; an hour or more.
# Each makes its own environment first.
PYTHON ?= python3
BIN := .venv/bin
COFMUPY := .venv-cofmupy/bin/python
# Parallel test processes: one more than two cores, since tests wait for child processes and time limits.
WORKERS ?= 3
# Tests try the same examples on every run.
export CI ?= true
# Tests start many processes, which share compiled modules.
unexport PYTHONDONTWRITEBYTECODE
# Threads of numpy's BLAS would cost each 0.1 s without benefit.
export OPENBLAS_NUM_THREADS ?= 1
# Third-party masters that need a separate environment are run if it exists: make interop makes it.
export QUADCOSIM_COFMUPY ?= $(abspath $(wildcard $(COFMUPY)))

# Tests make and remove tens of thousands of temporary files, which is slow on some disks: they are in memory where Linux
# has 4 GB for files there that may be executed. $(IN_FOLDER) COMMAND: with a temporary folder of its own.
IN_MEMORY = $(shell awk '$$2 == "/dev/shm" && $$4 !~ /noexec/ {found = 1} END {exit !found}' /proc/mounts 2>/dev/null \
	&& test -w /dev/shm && test "$$(df -Pk /dev/shm | awk 'END {print $$4}')" -gt 4000000 && echo "-p /dev/shm")
IN_FOLDER = folder=$$(mktemp -d $(IN_MEMORY)) && trap 'rm -rf "$$folder"' EXIT && trap 'exit 130' INT TERM && TMPDIR=$$folder

.PHONY: demo newcomer check test test-all tests coverage lint bench faults figures findings interop release site clean

demo: .venv/.base
	$(BIN)/quadcosim build
	$(BIN)/quadcosim run --period 0.01 --out results/demo
	@echo "figures: results/demo/path.png errors.png components.png commands.png"

SLOW := flight frames gain_scaling show yaw
# The parts of what is added; laws, plant, algebra, expressions, timetable, master with stubs, files of systems and
# scenarios; axes of figures; one FMU, built and run. Not flights of the quadrotor by its FMUs.
QUICK := $(addprefix tests/,test_additions.py docs/test_claims.py docs/test_metrics.py controller_fmu plant_fmu fmus/test_one_fmu.py fmus/test_mutants.py::test_every_rule_has_a_mutant_that_it_finds fmu_kit/test_algebra.py fmu_kit/test_trajectory.py fmu_kit/test_units.py quadcosim/test_names.py) \
	$(addprefix tests/orchestration/,systems/expressions systems/schedule/test_timetable.py simulation/engines/test_master.py simulation/engines/batch/test_folds.py systems/schedule/test_order.py \
	quadrotor/scenarios/test_loop.py quadrotor/scenarios/test_scenario.py quadrotor/scenarios/test_timing.py quadrotor/flight/test_figures.py::test_every_axis_of_every_figure_has_a_name_and_a_unit \
	experiments/studies/test_axes.py experiments/studies/test_study_file.py systems/system simulation/requests/ssp/test_reading.py foundation/basics/test_statistics.py)

check: lint
	$(IN_FOLDER) $(BIN)/pytest --numprocesses 2 --dist load $(patsubst %,--ignore-glob '*/test_%.py',$(SLOW)) --deselect tests/docs/test_claims.py::test_what_is_shown_is_what_is_flown $(QUICK)

# Both in parallel: a failure of one does not stop the other.
test: .venv/.test
	+@$(MAKE) --no-print-directory --jobs 2 lint tests

# What tests/extent.py tells them.
test-all coverage: export TEST_ALL := 1

test-all: test

tests: .venv/.test
	$(IN_FOLDER) $(BIN)/pytest --numprocesses $(WORKERS) --dist loadfile --no-loadscope-reorder

coverage: .venv/.test
	$(BIN)/coverage erase
	$(IN_FOLDER) $(BIN)/coverage run -m pytest --numprocesses $(WORKERS) --dist loadfile --no-loadscope-reorder
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage report

lint: .venv/.test
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: .venv/.test
	$(BIN)/python -m benchmarks.bench
	$(BIN)/python -m benchmarks.scaling
	$(BIN)/python -m benchmarks.bench_studies
	$(BIN)/python -m benchmarks.mathematics
	$(BIN)/python -m benchmarks.native
	$(BIN)/python -m benchmarks.engines
	$(BIN)/python -m benchmarks.batch
	$(BIN)/python -m benchmarks.wrapped
	$(BIN)/python -m benchmarks.floor
	$(BIN)/python -m benchmarks.taylor
	$(BIN)/python -m benchmarks.cold
	$(BIN)/python -m benchmarks.stores
	$(BIN)/python -m benchmarks.cluster
	$(BIN)/python -m benchmarks.peers

figures: .venv/.base
	$(BIN)/python -m docs.make_figures
	$(BIN)/python -m docs.make_icons
	$(BIN)/python examples/make_figures.py
	$(BIN)/python examples/linear/design.py
	$(BIN)/python examples/lqg/design.py

site: .venv/.test .venv/.release
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict
	@echo "open site/index.html"

# By a path, not by setuptools' finder, which each process of this environment would import in 15 ms.
EDITABLE := --config-settings editable_mode=compat --editable

.venv/.base: pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet $(EDITABLE) .
	touch $@

.venv/.test: pyproject.toml .venv/.base
	$(BIN)/python -m pip install --quiet $(EDITABLE) ".[test]"
	touch $@

.venv/.release: pyproject.toml .venv/.base
	$(BIN)/python -m pip install --quiet $(EDITABLE) ".[release]"
	touch $@

release: .venv/.release
	rm -rf dist
	$(BIN)/python -m docs.make_release

findings: .venv/.test
	$(BIN)/python -m docs.make_findings

interop: .venv/.test .venv-cofmupy/.made
	QUADCOSIM_COFMUPY=$(abspath $(COFMUPY)) $(BIN)/python -m docs.make_interop

faults: .venv/.test
	$(IN_FOLDER) $(BIN)/python -m tests.faults --page
	$(IN_FOLDER) $(BIN)/python -m tests.faults.sanitised

newcomer: .venv/.test
	$(BIN)/python -m docs.newcomer

.venv-cofmupy/.made:
	$(PYTHON) -m venv .venv-cofmupy
	$(COFMUPY) -m pip install --quiet cofmupy==1.0.0
	touch $@

clean:
	rm -rf .cache/built_for_tests .venv .venv-cofmupy results site build dist fmus/*.fmu fmus/native fmus/*.ssp examples/*/*.fmu examples/*/native

# The commands a person needs; each sets up what it uses in .venv and says what it does.
ifndef PYTHON
# the first that runs and is new enough
PYTHON := $(shell for p in python3 python3.11 python3.12 python3.13 python3.14; do \
	$$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)
endif
VENV := .venv
BIN := $(VENV)/bin
# two threads on two busy cores are slower than one, for matrices of this size
# recordings of real arms, which the repository does not hold
CATENARY_DATA ?= ../shared/data
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
# where bytecode is not kept, each worker of the tests and each program that they start compiles every file again
export PYTHONDONTWRITEBYTECODE =


.PHONY: demo acceptance test test-slow test-ros2 lint campaign campaign-short bench bench-dds bench-serving clean help
.PHONY: papers refit docs truth pictures notebooks release

help:
	@echo "make demo        set up, calibrate a simulated arm, write demo/report.html"
	@echo "make test        set up, run the tests (11 minutes from nothing on two processors); EXAMPLES=100 of each law and all cases alike"
	@echo "make test-slow   the tests that take long: hours simulated, endurance (ENDURANCE_MINUTES=30: of several tools at one robot), other programs"
	@echo "make test-ros2   served robots and rclpy itself, from its wheels, both ways: DISTROS=\"kilted jazzy\" (minutes the first time)"
	@echo "make acceptance  programs of dVRK and CRTK against a served PSM, over ROS 1 and 2 (PROGRAMS=a folder of their clones); rewrites a table of docs/crtk.md"
	@echo "make lint        format, lint, types, import order"
	@echo "make campaign    what is left of the campaign of faults, half an hour at most; again goes on (PART=files COUNT=100), into build/campaign/"
	@echo "make campaign-short  those parts of it whose cases are short, a minute, always the same seeds"
	@echo "make bench       speed of kernels, deployed models, the control loop and the simulator, beside other libraries"
	@echo "make bench-dds   a served robot over ROS 2's DDS and a client that hears every topic (10 minutes)"
	@echo "make bench-serving  a served robot and a client that hears every topic, by sockets and by rospy: rate, loss, latency, processor time, memory; a model deployed beside it (25 minutes)"
	@echo "make truth       hold what commands claim against the truth, on recordings spoilt in 17 ways (minutes); rewrites tests/truth/table.md"
	@echo "make docs        the documentation site into build/site: open build/site/index.html"
	@echo "make notebooks   the examples as notebooks into build/notebooks"
	@echo "make pictures    the pictures of docs/images, of today's demo and view (minutes; needs Chromium)"
	@echo "make papers      figures and tables of the papers with verdicts, into results/papers; goes on where it stopped (PAPER=calibration, QUICK=1 for ten minutes of everything)"
	@echo "make refit       fit the RAVEN-II with friction to a paper and a recording again (15 minutes); rewrites its data file"
	@echo "make release     wheel, sdist and archive of results in dist, checked; the wheel alone runs the demo"
	@echo "make clean       remove .venv and everything made here"

demo: $(VENV)/.package
	$(BIN)/catenary demo --out demo

# one more at a time than there are processors, up to four: many tests wait for other processes
WORKERS = $(shell n=$$(nproc); echo $$((n < 4 ? n + 1 : 4)))
PYTEST = $(BIN)/python -m pytest -rs -n $(WORKERS) --dist loadfile

test: $(VENV)/.development
	$(PYTEST) -m "not slow"

# LEAVE_OUT: folders
test-slow: $(VENV)/.development
	$(PYTEST) -m slow $(addprefix --ignore=,$(LEAVE_OUT))

DISTROS ?= kilted jazzy
test-ros2: $(VENV)/.development
	CRTK_MSGS=1 .ci/ros2 $(DISTROS)
	$(BIN)/python -m pytest -rs tests/crtk/dds/test_real_ros2.py tests/crtk/dds/test_users_environment.py -m ""

lint: $(VENV)/.development
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

PART ?= all
CAMPAIGN_OUT ?= build/campaign
campaign: $(VENV)/.development
	$(BIN)/python -m tests.campaign $(PART) $(if $(COUNT),--count $(COUNT)) --seconds 1800 --out $(CAMPAIGN_OUT)

# those whose cases take seconds; others take a minute a case
SHORT = files messages kills.recorder signals.simulated
campaign-short: $(VENV)/.development
	rm -rf build/campaign-short
	$(BIN)/python -m tests.campaign $(SHORT) --seconds 60 --out build/campaign-short

bench: $(VENV)/.benchmarks
	$(BIN)/python -m tests.benchmarks.inference --json build/benchmarks/inference.json
	$(BIN)/python -m tests.benchmarks.control_tick --json build/benchmarks/control_tick.json
	$(BIN)/python -m tests.benchmarks.plants --json build/benchmarks/plants.json
	$(BIN)/python -m tests.benchmarks.kernels --json build/benchmarks/kernels.json
	$(BIN)/python -m tests.benchmarks.c_law --json build/benchmarks/c_law.json

bench-dds: $(VENV)/.development
	$(BIN)/python -m tests.benchmarks.serving --listener dds --seconds 300 --json build/benchmarks/dds_serving.json

bench-serving: $(VENV)/.development
	$(BIN)/python -m tests.benchmarks.serving --listener sockets --listener rospy --seconds 300 --json build/benchmarks/serving.json
	$(BIN)/python -m tests.benchmarks.deployed --seconds 60 --json build/benchmarks/deployed.json

PAPER ?= all
papers: $(VENV)/.papers
	$(BIN)/python -m papers $(PAPER) --workers $(shell nproc) --data $(CATENARY_DATA) $(if $(QUICK),--quick)

notebooks: $(VENV)/.development
	$(BIN)/python -m tests.notebooks build/notebooks

docs: $(VENV)/.documentation
	$(BIN)/python -m zensical build --strict --clean
	@echo "open build/site/index.html"

pictures: $(VENV)/.development demo
	PYTHONPATH=tests $(BIN)/python -m tests.pictures demo docs/images
	PYTHONPATH=tests $(BIN)/python -m tests.cause_pictures docs/images

refit: $(VENV)/.package
	$(BIN)/python -m papers.plant.refit src/catenary/simulation/data/raven2_friction.toml \
		$(CATENARY_DATA)/raven2_recorded_state/raven_state_circle.npz

$(BIN)/python:
	@test -n "$(PYTHON)" || { echo "Python 3.11 or newer is needed: apt install python3 python3-venv"; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
		{ echo "Python's venv module is missing: apt install python3-venv"; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.package: $(BIN)/python pyproject.toml
	$(BIN)/python -m pip install --disable-pip-version-check -e ".[view]"
	@touch $@

$(VENV)/.papers: $(VENV)/.package
	$(BIN)/python -m pip install --disable-pip-version-check -e ".[papers]"
	@touch $@

$(VENV)/.documentation: $(BIN)/python pyproject.toml
	$(BIN)/python -m pip install --disable-pip-version-check -e ".[docs]"
	@touch $@

$(VENV)/.development: $(BIN)/python pyproject.toml
	$(BIN)/python -m pip install --disable-pip-version-check -e ".[dev]"
	@touch $@ $(VENV)/.package $(VENV)/.documentation

$(VENV)/.benchmarks: $(VENV)/.package
	$(BIN)/python -m pip install --disable-pip-version-check -e ".[bench,test]"
	@touch $@

release:
	rm -rf dist build/release
	$(PYTHON) -m venv build/release/tool
	build/release/tool/bin/pip install -q --disable-pip-version-check build twine
	build/release/tool/bin/pyproject-build
	build/release/tool/bin/twine check --strict dist/*
	git archive --format=tar.gz --output=dist/catenary-results.tar.gz HEAD papers/results docs/results
	cd dist && sha256sum * >SHA256SUMS
	$(PYTHON) -m venv build/release/empty
	build/release/empty/bin/pip install -q --disable-pip-version-check dist/*.whl
	cd build/release && empty/bin/catenary demo

truth: $(VENV)/.development
	$(BIN)/python -m tests.truth

clean:
	rm -rf $(VENV) demo build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find src tests -name __pycache__ -type d -prune -exec rm -rf {} +

# PROGRAMS: a folder with clones of dvrk_python, crtk_python_client and crtk_msgs
acceptance: $(VENV)/.development
	CRTK_MSGS=$(abspath $(PROGRAMS))/crtk_msgs .ci/ros2 $(DISTROS)
	PYTHONPATH=tests:$$PYTHONPATH $(BIN)/python -m tests.acceptance $(PROGRAMS) --page docs/crtk.md

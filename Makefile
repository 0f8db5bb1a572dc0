# make run [SCENE=bend5]  install, simulate, record, draw        make test  lint, format, tests
# make live [SCENE=pneunet] the running scene in the browser
# make install            .venv with the commands gdfe, sim_node, and all that make run does not need
# make first-run          the first minute on a new machine, in a scratch clone: times, and sizes of the extras
# make test-loaded        the tests five times beside two busy loops
# make test-elsewhere     what computes with the rounding of other processors, and with vertices shifted by 1e-13
# make torture            the numerical torture test             make bench run time against error
# make measure            every table of the pages anew, where its solver is not this one [ONLY=robots] [AGAIN=1]
# make bench-since COMMIT=...   run times over those of another commit, in turn
# make bench-loop [COMMIT=...]  one table of before and after of the solver's loop: times in turn, true errors
# make bench-node         latency of commands of a node
# make manners            the node asked from outside: a table of what was expected and found; then fuzzed
# make bags               record bags/ anew and replay them        make docs build/site from docs/
# make clean              remove .venv and everything that was built

VENV   := .venv
BIN    := $(VENV)/bin
PYTHON ?= python3
SCENE  ?= bend5
# Workers of the tests, three for each of two cores: many tests wait for other processes.
JOBS   ?= 6
PARALLEL := -n $(JOBS) --dist loadfile --no-loadscope-reorder

# With a ROS 2 sourced, its rclpy serves and the wheels are left out; the stamp's name remembers which it was.
ifdef ROS_DISTRO
FLAVOUR   := ros-$(ROS_DISTRO)
VENVFLAGS := --system-site-packages
EXTRAS    := mcap,fast,plot
else
FLAVOUR   := wheels
VENVFLAGS :=
EXTRAS    := ros,mcap,fast,plot
endif
SOURCES := setup.py setup.cfg pyproject.toml package.xml Makefile
STAMP   := $(VENV)/.installed-$(FLAVOUR)
# What only some commands need: mesh and CAD files, sweeps in parallel, arms
ALL     := $(VENV)/.extra-mesh,sweep,arm
OTHER   := $(filter-out $(STAMP),$(wildcard $(VENV)/.installed-*))
PIP     := $(BIN)/python -m pip --disable-pip-version-check --quiet install --use-pep517

.PHONY: install run first-run live test test-loaded test-elsewhere browser torture manners measure bench bench-node \
        bench-since bench-loop bench-motion bench-contact bench-streams bags docs clean

install: $(ALL)

define CHECK_MACHINE
if ! $(PYTHON) -c 'import sys; sys.exit(not (3, 10) <= sys.version_info[:2] <= (3, 13))' 2>/dev/null; then
  echo "gdfe_ros needs Python 3.10 to 3.13, but '$(PYTHON)' is: $$($(PYTHON) --version 2>&1)." >&2
  echo "Install one of these versions and name it: make PYTHON=/path/to/python3.12 $(MAKECMDGOALS)" >&2
  exit 2
fi
if [ "$(FLAVOUR)" = wheels ] && [ "$$(uname -sm)" != "Linux x86_64" ]; then
  echo "ROS 2 comes as Python wheels for Linux x86_64 only; this machine is $$(uname -sm)." >&2
  echo "Install ROS 2 Jazzy with apt (https://docs.ros.org/en/jazzy/Installation.html), then either" >&2
  echo "  source /opt/ros/jazzy/setup.bash && make install" >&2
  echo "or put this directory into the src/ of a workspace and: colcon build --packages-select gdfe_ros" >&2
  exit 2
fi
if [ -n "$(OTHER)" ]; then
  echo "$(VENV) was made for $(patsubst $(VENV)/.installed-%,%,$(OTHER)), this shell asks for $(FLAVOUR)" >&2
  echo "(ROS_DISTRO is '$(ROS_DISTRO)'). Run 'make clean' first, or use the shell that it was made in." >&2
  exit 2
fi
endef
export CHECK_MACHINE

$(STAMP): $(SOURCES)
	@sh -c "$$CHECK_MACHINE"
	@echo "installing into $(VENV) ($(FLAVOUR)) ..."
	@$(PYTHON) -m venv $(VENVFLAGS) $(VENV)
	@$(PIP) --editable .
	@$(BIN)/gdfe compile $(FIRST) & \
	$(PIP) --editable '.[$(EXTRAS)]' && wait $$!
	@touch $@

# Tools for tests, benchmarks and docs: $(VENV)/.extra-test, .extra-bench, .extra-docs
$(VENV)/.extra-%: $(STAMP)
	@echo "installing the extra '$*' ..."
	@$(PIP) --editable '.[$*]'
	@touch $@

# What make run plays; its kernels are compiled while pip fetches the extras. Hands on arms need an extra; the scenes
# pick_ur5e and pick_panda need that of their robot, and are played by a controller.
FIRST := $(if $(filter run,$(MAKECMDGOALS)),$(if $(filter arm_% pick_%,$(SCENE)),bend5,$(SCENE)),bend5)
run: $(STAMP) $(if $(filter arm_%,$(SCENE)),$(VENV)/.extra-arm) $(patsubst pick_%,$(VENV)/.extra-%,$(filter pick_%,$(SCENE)))
	@$(BIN)/gdfe compile $(SCENE)
	@$(BIN)/$(if $(filter pick_%,$(SCENE)),python -m gdfe_ros.examples.pick,gdfe demo) $(SCENE)

live: $(STAMP) $(VENV)/.extra-live
	@$(BIN)/gdfe live $(if $(filter command line environment,$(origin SCENE)),$(SCENE),pneunet)

# The report's test drives a real Chromium. Where it is missing and cannot be installed, that test fails and says so.
browser:
	@if ! command -v chromedriver >/dev/null && [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	  echo "installing Chromium for the report's test ..."; \
	  apt-get -qq update >/dev/null && \
	  apt-get -qq install -y --no-install-recommends chromium chromium-driver >/dev/null || true; \
	fi

test: $(ALL) $(VENV)/.extra-test $(VENV)/.extra-docs browser
	@status=0; \
	$(BIN)/ruff check --no-cache . || status=1; \
	$(BIN)/ruff format --check . || status=1; \
	$(BIN)/python -m pytest $(PARALLEL) || status=1; \
	exit $$status

test-loaded: $(ALL) $(VENV)/.extra-test $(VENV)/.extra-docs browser
	@$(BIN)/python test/loaded.py $(PARALLEL)

# One rounding alone, or each twice: make test-elsewhere ELSEWHERE='--only zen3'
test-elsewhere: $(ALL) $(VENV)/.extra-test browser
	@$(BIN)/python test/elsewhere.py $(ELSEWHERE) -n 2 --dist loadfile --no-loadscope-reorder

# Half an hour, most of it three walks of 100 000 steps; TORTURE_WALK_STEPS=1000 shortens them.
# TORTURE_EXAMPLES=2500 makes the fuzzing of test/torture long: pytest test/torture/test_fuzz_scenes.py
torture: $(ALL) $(VENV)/.extra-test
	@$(BIN)/python -m pytest -n $(JOBS) -m torture test/torture test/node

# A node driven from outside: every transition, wrong commands, late joiners, remaps, bad starts. ROS_DOMAIN_ID=... apart.
# Then hostile scenes, bags, commands, messages, viewers and files; 500 rebuilds and 200 cycles of large scenes. With
# JOBS=1 on a machine with a load of 8: 10, 12 and 34 minutes.
HOSTILE := test/torture/test_fuzz_scenes.py test/torture/test_fuzz_bags.py test/torture/test_fuzz_commands.py \
  test/torture/test_fuzz_files.py test/torture/test_fuzz_bodies.py test/node/test_fuzz_messages.py \
  test/node/test_rebuilds.py test/node/test_soft_entities.py test/node/test_twin.py test/live/test_gate.py \
  test/analysis/test_hostile_bags.py
manners: $(ALL) $(VENV)/.extra-test
	@ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST $(BIN)/python test/manners
	@TORTURE_EXAMPLES=500 $(BIN)/python -m pytest -n $(JOBS) -m 'not torture and not bench' $(HOSTILE)

bench-node: install
	@$(BIN)/python -m benchmarks.node.latency

# Error against processor time on a bar that falls, a measured beam;
# beside MuJoCo (the extra 'bench') and CalculiX (apt-get install calculix-ccx) where they are installed.
bench-motion: install
	@OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m benchmarks.motion

# A cube on a ball beside CalculiX, a grip beside MuJoCo
bench-contact: install
	@OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m benchmarks.contact

# Another commit beside this tree, played in turn: make bench-since COMMIT=main [ONLY="bend5 robots"]
bench-since: install
	@$(BIN)/python -m benchmarks.loop $(COMMIT) --times $(if $(ONLY),--only $(ONLY)) --out runs/bench/since.json

# One table of before and after: times in turn, true errors. make bench-loop [COMMIT=b6cf3c23] [ONLY="cold robots"]
# [LOOP='--this-only --times']; what there is: LOOP=--list
bench-loop: install
	@$(BIN)/python -m benchmarks.loop $(COMMIT) $(if $(ONLY),--only $(ONLY)) $(LOOP)

# Steps a second beside MuJoCo at equal error
bench-streams: $(ALL) $(VENV)/.extra-bench
	@$(BIN)/python -m benchmarks.streams

# First the tests of what takes how long, which ask for a quiet machine.
bench: $(ALL) $(VENV)/.extra-test $(VENV)/.extra-bench
	@$(BIN)/python -m pytest -q -m bench
	@$(BIN)/python -m benchmarks

# 60 to 90 minutes on two quiet cores, table by table into test/data; what is interrupted goes on where it stopped.
# CalculiX is measured where it is installed: apt-get install calculix-ccx
measure: $(ALL) $(VENV)/.extra-test $(VENV)/.extra-bench
	@$(BIN)/python -m benchmarks.measure $(if $(ONLY),--only $(ONLY)) $(if $(AGAIN),--again)

# The first minute on a new machine, in a scratch clone: what is committed, not what is edited. Needs the registry.
first-run:
	@$(PYTHON) benchmarks/first_run.py

bags: install
	@$(BIN)/python bags/record.py

# Tables and references are printed into the pages first, from the code and from the reports in test/data.
docs: $(VENV)/.extra-docs
	@$(BIN)/python -m docs.scripts.generate
	@$(BIN)/mkdocs build --quiet --strict
	@echo "written: build/site/index.html"

clean:
	rm -rf $(VENV) build install log dist *.egg-info .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

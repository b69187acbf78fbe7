# `make demo` and `make test` set everything up by themselves; Python 3.11 to 3.13 is all they need.
PYTHON ?= python3
BIN := .venv/bin
export PYTHONDONTWRITEBYTECODE =

# A sourced Jazzy keeps its own rclpy: then no ROS wheel is installed, and the environment sees the system's packages.
# What lies in a virtual environment that is active is no Jazzy, but wheels that an earlier `make` put there.
SOURCED := $(if $(AMENT_PREFIX_PATH),$(shell $(PYTHON) -c 'import os, rclpy, sys; \
	wheel = sys.prefix != sys.base_prefix and rclpy.__file__.startswith(sys.prefix + os.sep); \
	paths = [path for path in os.environ["AMENT_PREFIX_PATH"].split(":") if path]; \
	print("yes" if not wheel and any(rclpy.__file__.startswith(path + os.sep) for path in paths) else "")' 2>/dev/null))
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --no-deps
LOCKED := $(PIP) --require-hashes
# A worker that crashes ends the run, with the name of its test: xdist's loadgroup would wait for ever for the one that replaces it.
PYTEST := $(BIN)/python -m pytest -n 3 --dist loadgroup --max-worker-restart 0 --timeout 600

.PHONY: demo test soak bench judges audit licences core counts docs install tools clean

# Three environments in one, each with what the one before it has: what the demo runs; all that a user may install; what tests need.
RUN := .venv/.run
READY := .venv/.ready
TEST := .venv/.test

demo: $(RUN)
	$(BIN)/scenario-gen demo --ros --out out/demo

test: $(TEST) tools
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	@$(BIN)/mypy & types=$$!; $(PYTEST) --durations=10; tests=$$?; wait $$types && exit $$tests

# Long tests: `make soak PART=fuzz` runs one part; a part that was stopped goes on where it was. One table at the end.
soak: $(TEST)
	$(BIN)/python test/soak $(PART)

# Peers that are not on this machine give no row.
bench: $(TEST)
	$(LOCKED) -r requirements/bench.lock
	$(BIN)/python -m benchmarks all

# Known vulnerabilities of all that is locked. It fails, too, where a package could not be looked up.
audit: .venv-audit/.ready
	@found=0; for lock in requirements/*.lock; do echo $$lock; \
	.venv-audit/bin/pip-audit --strict --require-hashes --disable-pip --progress-spinner off -r $$lock || found=1; done; exit $$found

.venv-audit/.ready: requirements/audit.lock
	$(PYTHON) -m venv .venv-audit
	.venv-audit/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements/audit.lock
	@touch .venv-audit/.ready

# What is exported, before other people's programs (CommonRoad's, ASAM's), each locked in an environment of its own; CommonRoad's
# planner has wheels for Python 3.11 alone: make judges JUDGE_PYTHON=python3.11.
JUDGE_PYTHON ?= $(PYTHON)
judges: $(TEST) .venv-judges-commonroad/.ready .venv-judges-asam/.ready
	$(BIN)/python -m benchmarks bridges

.venv-judges-%/.ready: requirements/judges-%.lock
	$(JUDGE_PYTHON) -m venv .venv-judges-$*
	.venv-judges-$*/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements/judges-$*.lock
	@touch .venv-judges-$*/.ready

# The core without any extra, in an environment of its own.
core: $(TEST)
	$(BIN)/python test/packaging/core_install.py

# How large the project is, beside its last release.
counts: $(TEST)
	$(BIN)/python test/packaging/counts.py

# The site, in out/docs: built from the sources, which are not imported.
docs: .venv-docs/.ready
	.venv-docs/bin/python -m sphinx -q -W --keep-going -b html docs out/docs
	@echo "out/docs/index.html"

.venv-docs/.ready: requirements/docs.lock
	$(PYTHON) -m venv .venv-docs
	.venv-docs/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements/docs.lock
	@touch .venv-docs/.ready

licences: $(TEST)
	$(BIN)/python test/packaging/licences.py

install: $(READY)
	$(BIN)/python -m scenario_gen.numerics

# The core, and beside it the wheels of ROS, which share no package with it. With the core the kernels that every case calls are compiled,
# once for this user, while pip installs the rest.
STAGES := numerics situation roads method
$(RUN): requirements/core.lock requirements/run.lock requirements/ros.lock pyproject.toml
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; sys.exit(not (3, 11) <= v <= (3, 13) and f"Python {v[0]}.{v[1]} found; 3.11, 3.12 or 3.13 is needed: make PYTHON=python3.12")'
	$(PYTHON) -m venv $(if $(SOURCED),--system-site-packages) .venv
	$(if $(SOURCED),true,$(LOCKED) -r requirements/ros.lock) & ros=$$!; \
	$(LOCKED) -r requirements/core.lock || { wait $$ros; exit 1; }; \
	$(BIN)/python -m scenario_gen.numerics $(STAGES) & kernels=$$!; \
	wait $$ros && $(LOCKED) -r requirements/run.lock && $(PIP) --no-build-isolation --editable .; \
	installed=$$?; wait $$kernels && exit $$installed
	@touch $(RUN)

$(READY): $(RUN) requirements/extras.lock
	$(LOCKED) -r requirements/extras.lock
	@touch $(READY)

$(TEST): $(READY) requirements/test.lock requirements/ros-test.lock
	$(BIN)/python -m scenario_gen.numerics & kernels=$$!; \
	$(LOCKED) -r requirements/test.lock $(if $(SOURCED),,-r requirements/ros-test.lock); \
	installed=$$?; wait $$kernels && exit $$installed
	@touch $(TEST)

# The report's tests drive Chromium, and the package of interfaces is compiled; where what they need is missing and cannot be installed
# here, those tests skip with that reason.
tools:
	@need=""; \
	command -v chromium >/dev/null || command -v chromium-browser >/dev/null || need="chromium"; \
	command -v c++ >/dev/null || need="$$need g++"; \
	[ -z "$$need" ] || { \
	  [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null && \
	  apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq $$need >/dev/null; } || \
	  echo "Not here, and the tests that need it will be skipped: $$need"

clean:
	rm -rf .venv .venv-audit .venv-docs .venv-judges-* build install log out

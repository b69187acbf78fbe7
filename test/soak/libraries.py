# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The short tests on the newest and on the lowest releases that pyproject.toml allows, without the locks."""

from collections.abc import Iterator
import os
from pathlib import Path
import re
import subprocess
import sys

from figures import Figure, ROOT
from licences import extras

LISTS = ("run", "extras", "test", "ros-test")
SHOWN = ("numpy", "scipy", "numba", "rosbags", "mcap", "pandas", "shapely", "pyproj")
PYTEST = ("-n", "2", "--dist", "loadgroup", "--max-worker-restart", "0", "--timeout", "600")
FOR_LOCKS = "test/packaging/test_supply_chain.py"


def lowest_bounds() -> str:
    """Return constraints to the first minor release that each direct requirement allows."""
    wanted = (requirement for known in extras().values() for requirement in known)
    bounds = re.findall(r"^([\w-]+)\S*>=(\d+\.\d+)", "\n".join(map(str, wanted)), re.MULTILINE)
    return "".join(f"{name}=={minor}.*\n" for name, minor in sorted(set(bounds)))


def install(python: Path, *options: object) -> None:
    """Make an environment, or bring it up to date."""
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", python.parents[1]], check=True)
    pip = [python, "-m", "pip", "install", "--quiet"]
    lists = (word for name in LISTS for word in ("-r", ROOT / "requirements" / f"{name}.in"))
    for wanted in ([f"{ROOT}[ros]"], lists):  # at once pip tries releases of test tools for hours
        subprocess.run([*pip, *options, *wanted], check=True)
    subprocess.run([*pip, "--no-deps", "--no-build-isolation", "-e", ROOT], check=True)


def tested(state: Path, releases: str, *options: object) -> Figure:
    """Install releases, and run all tests once; what they say is in `state`."""
    python = (state / releases / "bin" / "python").absolute()
    log_file = state / f"{releases}.log"
    install(python, *options)
    listing = [python, "-m", "pip", "list", "--format", "freeze"]
    frozen = subprocess.run(listing, check=True, stdout=subprocess.PIPE, text=True).stdout
    versions = dict(line.split("==") for line in frozen.splitlines() if "==" in line)
    words = [python, "-m", "pytest", *PYTEST, "--deselect", FOR_LOCKS]
    environment = os.environ | {"PATH": f"{python.parent}{os.pathsep}{os.environ['PATH']}"}
    with log_file.open("w") as log:
        done = subprocess.run(
            words, cwd=ROOT, env=environment, stdout=log, stderr=log, check=False
        )
    summary = re.findall(r"^.*\d+ passed.*$", log_file.read_text(), re.MULTILINE)
    shown = ", ".join(f"{name} {versions[name]}" for name in SHOWN)
    seen = f"{shown}: {summary[-1] if summary else f'see {log_file}'}"
    promise = f"all tests pass on the {releases} releases"
    return Figure(promise, "green", seen, done.returncode == 0)


def run(state: Path) -> Iterator[Figure]:
    """Test with the newest releases, then with the lowest."""
    yield tested(state, "newest", "--upgrade", "--upgrade-strategy", "eager")
    constraints = state / "lowest.txt"
    constraints.write_text(lowest_bounds())
    yield tested(state, "lowest", "-c", constraints)

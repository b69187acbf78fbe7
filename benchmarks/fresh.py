# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A stranger's first hour: `make demo` and `make test` on a clone with nothing beside it, empty caches, by part.

Seconds of the clock say something on an idle machine alone; seconds of the CPU stand beside them. Kernels are compiled while
packages are installed, so they are measured once more by themselves, into a cache of their own.
"""

from collections import Counter
from collections.abc import Sequence
import os
from pathlib import Path
import resource
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ET

from benchmarks._size import sized
from benchmarks.row import Row

ROOT = Path(__file__).resolve().parents[1]
DRY = sized((), quick=("--dry-run",))
LEFT_OUT = (
    "CI",
    "PYTHONPATH",
    "VIRTUAL_ENV",
    "MAKEFLAGS",
    "AMENT_PREFIX_PATH",
    "NUMBA_CACHE_DIR",
    "PYTHONDONTWRITEBYTECODE",
)
PEER = "4ef626c, idle: demo 278 s (321 s of CPU), test 581 s (976 s of CPU, and red), 244 packages, 1,600 MB"


def run() -> list[Row]:
    """Measure."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        clone = place / "clone"
        subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)
        variables = {name: value for name, value in os.environ.items() if name not in LEFT_OUT}
        variables |= {
            "XDG_CACHE_HOME": str(place / "cache"),
            "PIP_NO_CACHE_DIR": "1",
            "SCENARIO_GEN_DATA": str(place / "none"),
        }
        results = place / "tests.xml"

        def step(*command: str, **more: str) -> tuple[float, float]:
            return _measured(command, clone, variables | more)

        def make(target: str, **more: str) -> tuple[float, float]:
            return step("make", *DRY, f"PYTHON={sys.executable}", target, **more)

        parts = {"demo: packages and kernels": make(".venv/.run")}
        installed = [_installed(clone, "after make demo")]
        parts["demo: the demo itself"] = make("demo")
        parts["test: packages and the other kernels"] = make(".venv/.test")
        installed.append(_installed(clone, "after make test"))
        parts["test: ruff, mypy, pytest"] = make("test", PYTEST_ADDOPTS=f"--junitxml={results}")
        alone = sized(("-m", "scenario_gen.numerics"), quick=("--version",))
        python = str(clone / ".venv" / "bin" / "python") if not DRY else sys.executable
        apart = {
            "all kernels, by themselves": step(
                python, *alone, NUMBA_CACHE_DIR=str(place / "kernels")
            )
        }
        totals = {f"make {name}": _sum(parts, name) for name in ("demo", "test")}
        rows = [
            *_rows(totals, {"make demo": (100.0, None), "make test": (240.0, 420.0)}, PEER),
            *_rows(parts | apart, {}, None),
            *(row for rows in installed for row in rows),
        ]
        return rows + _by_folder(results)


def _measured(
    command: Sequence[str], where: Path, variables: dict[str, str]
) -> tuple[float, float]:
    """Seconds of the clock and of the CPU that a command takes; what it says goes to stderr if it fails."""
    before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    done = subprocess.run(
        command, cwd=where, env=variables, capture_output=True, text=True, check=False
    )
    wall, after = time.monotonic() - started, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        print(
            f"{' '.join(command)} ended with {done.returncode}:\n{done.stdout[-5000:]}{done.stderr[-2000:]}",
            file=sys.stderr,
        )
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _sum(parts: dict[str, tuple[float, float]], name: str) -> tuple[float, float]:
    """What the parts of one command take together."""
    walls, used = zip(
        *(figures for part, figures in parts.items() if part.startswith(f"{name}:")), strict=True
    )
    return sum(walls), sum(used)


def _rows(
    parts: dict[str, tuple[float, float]],
    targets: dict[str, tuple[float, float | None]],
    peer: str | None,
) -> list[Row]:
    rows = []
    for name, figures in parts.items():
        for what, value, target in zip(
            ("clock", "CPU"), figures, targets.get(name, (None, None)), strict=True
        ):
            rows.append(Row(f"{name}, {what}", value, "s", "lower", target, peer))
    return rows


def _installed(clone: Path, when: str) -> list[Row]:
    """Packages and megabytes of the environment."""
    packages = list(clone.glob(".venv/lib/*/site-packages/*.dist-info"))
    size = sum(path.lstat().st_size for path in clone.glob(".venv/**/*"))
    return [
        Row(f"packages {when}", float(len(packages)), "", "lower", None, None),
        Row(f"environment {when}", size / 1e6, "MB", "lower", None, None),
    ]


def _by_folder(results: Path) -> list[Row]:
    """Seconds of the clock of the tests, by folder, all workers together; and how many passed, failed and were skipped."""
    if not results.exists():
        return []
    seconds: dict[str, float] = {}
    outcomes: Counter[str] = Counter()
    for case in ET.parse(results).getroot().iter("testcase"):
        parts = case.get("classname", "").split(".")
        folder = parts[1] if len(parts) > 2 else "the top"
        seconds[folder] = seconds.get(folder, 0.0) + float(case.get("time", "0"))
        outcomes[
            next(
                (child.tag for child in case if child.tag in ("failure", "error", "skipped")),
                "passed",
            )
        ] += 1
    rows = []
    for name, count in outcomes.items():
        rows.append(
            Row(
                f"tests: {name}",
                float(count),
                "",
                "higher" if name == "passed" else "lower",
                None,
                None,
            )
        )
    for name, value in sorted(seconds.items(), key=lambda pair: -pair[1]):
        rows.append(Row(f"tests of {name}, clock of the workers", value, "s", "lower", None, None))
    return rows

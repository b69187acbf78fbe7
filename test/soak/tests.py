# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Every test in its long form: all cases, larger counts, every random example."""

from collections.abc import Iterator, Sequence
from concurrent.futures import as_completed, ThreadPoolExecutor
import json
import os
from pathlib import Path
import subprocess
import sys

from figures import Figure, ROOT


def test_files() -> list[str]:
    """Return every file of tests."""
    return sorted(str(path.relative_to(ROOT)) for path in (ROOT / "test").rglob("test_*.py"))


def run_file(state: Path, name: str, *words: str, **variables: str) -> tuple[str, bool, float]:
    """Run one test file, its output into `state`; return its name, whether it passes, and the seconds of CPU it took."""
    with (state / f"{name.replace('/', '.')}.log").open("w") as log:
        environment = os.environ | {"SCENARIO_GEN_TESTS": "long"} | variables
        command = [sys.executable, "-m", "pytest", name, *words]
        process = subprocess.Popen(command, cwd=ROOT, env=environment, stdout=log, stderr=log)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    # 5: nothing of it can run here, as test/launch without `launch`
    return name, process.returncode in (0, 5), used.ru_utime + used.ru_stime


def run_files(
    state: Path, promise: str, files: Sequence[str], *words: str, **variables: str
) -> Figure:
    """Run test files, two at a time; those that have passed are not run again."""
    state.mkdir(parents=True, exist_ok=True)
    kept = state / "passed.json"
    passed: dict[str, float] = json.loads(kept.read_text()) if kept.exists() else {}
    pool = ThreadPoolExecutor(2)
    try:
        left = [
            pool.submit(run_file, state, name, *words, **variables)
            for name in files
            if name not in passed
        ]
        for done in as_completed(left):
            name, good, seconds = done.result()
            if good:
                passed[name] = round(seconds, 1)
                kept.write_text(json.dumps(passed, indent=2) + "\n")
    finally:
        pool.shutdown(cancel_futures=True)  # of a Ctrl-C: the two that run hear it, too
    failed = [name for name in files if name not in passed]
    took = sum(passed.get(name, 0.0) for name in files) / 60
    seen = f"{len(files) - len(failed)} of {len(files)}, {took:.0f} min of CPU"
    return Figure(
        promise,
        f"{len(files)} files",
        seen + (f"; not {', '.join(failed)}: {state}" if failed else ""),
        not failed,
    )


def run(state: Path) -> Iterator[Figure]:
    """Run every test file."""
    yield run_files(state, "every test in its long form passes", test_files())

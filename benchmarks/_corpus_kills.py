# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""SIGKILLs of a batch: of a worker, or of the run with all of its workers, at random; it is started again until it is done."""

import os
from pathlib import Path
import random
import signal
import subprocess
import sys
import time


def killed_batch(
    words: list[str], out: Path, wanted: int, workers_first: float = 0.5
) -> tuple[int, int]:
    """Run a batch to its end through `wanted` SIGKILLs; return how many hit a worker, and how many the run.

    Args:
        words: of the command line.
        out: of the batch; part tables there say how far it is.
        wanted: kills; when the batch ends before, its last tables are removed as if it had not got there.
        workers_first: probability that a worker is hit, not the run.
    """
    lots = random.Random(3)
    hit = [0, 0]
    while True:
        run = subprocess.Popen(
            [sys.executable, "-m", "scenario_gen", *words],
            start_new_session=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            while run.poll() is None:
                if sum(hit) >= wanted:
                    run.wait()
                    break
                begun = time.monotonic()
                while run.poll() is None and time.monotonic() - begun < lots.uniform(0.2, 2.0):
                    time.sleep(0.05)
                workers = [pid for pid in _session(run.pid) if pid != run.pid and _is_worker(pid)]
                if not workers or run.poll() is not None:
                    continue
                if lots.random() < workers_first:
                    os.kill(lots.choice(workers), signal.SIGKILL)
                    hit[0] += 1
                else:
                    os.killpg(run.pid, signal.SIGKILL)
                    run.wait()
                    hit[1] += 1
        finally:
            if run.poll() is None:
                os.killpg(run.pid, signal.SIGKILL)
                run.wait()
        if run.returncode == 0:
            if sum(hit) >= wanted:
                return hit[0], hit[1]
            done = sorted((out / "cases").rglob("*.parquet"))
            for table in done[: max(len(done) // 2, 1)]:
                table.unlink()


def _session(leader: int) -> list[int]:
    """Processes of a session."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                if os.getsid(int(entry.name)) == leader:
                    found.append(int(entry.name))
            except OSError:
                continue
    return found


def _is_worker(pid: int) -> bool:
    try:
        return b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return False

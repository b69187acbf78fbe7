# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Many workers: what a Dask scheduler of its own process spends on a task, and how long real worker processes wait for work.

The work is fake: tasks sleep for 5 to 6 s. Scheduler, workers and client are processes of this machine, whose few cores serve
them all. What 1,000 workers would need is extrapolated from the scheduler's own CPU time for a task, and from that at rest by
the number of heartbeats, which Dask makes rarer the more workers there are.
"""

from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
import json
import os
from pathlib import Path
import pickle
import subprocess
import sys
import tempfile
import time

import numpy as np

from benchmarks._size import sized
from benchmarks._workers_fake import FakeTask, sleep
from benchmarks.row import Row
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.tasks import spread, Workers
from scenario_gen.pipeline import PipelineConfig

COUNT = sized(64, quick=2)
EACH = sized(20, quick=2)
SECONDS = sized((5.0, 6.0), quick=(0.05, 0.1))
RESTS = sized(20.0, quick=0.2)  # s
MANY = 1000  # workers
SETTINGS = {  # of the cluster's processes; docs/corpus.md names them
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "false",
    "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "500ms",
    "DASK_DISTRIBUTED__SCHEDULER__WORKER_SATURATION": "1.0",
    "DASK_DISTRIBUTED__NANNY__PRE_SPAWN_ENVIRON": "{}",
}


def run() -> list[Row]:
    """Measure."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        rng = np.random.default_rng(0)
        config = (PipelineConfig(), CorpusConfig())
        tasks = [
            FakeTask(
                f"task {k}",
                config,
                folder / f"{k % 100:02}" / f"{k}.json",
                float(rng.uniform(*SECONDS)),
            )
            for k in range(COUNT * EACH)
        ]
        with _cluster(folder) as (address, scheduler):
            resting = -_cpu(scheduler)
            time.sleep(RESTS)
            before = _cpu(scheduler)
            resting = (resting + before) / RESTS
            with spread(Workers(COUNT, address)) as each:
                failed = each(sleep, tasks)
            spent, most = _cpu(scheduler) - before, _peak(scheduler)
        done = [json.loads(task.target.read_text()) for task in tasks]
    assert not failed and all(one["known"] for one in done), failed[:3]
    busy = sum(one["ended"] - one["begun"] for one in done)
    whole = max(one["ended"] for one in done) - min(one["begun"] for one in done)
    a_task = 1e3 * (spent - resting * whole) / len(tasks)
    waits = _between(done)
    load = a_task * MANY / (1e3 * sum(SECONDS) / 2.0) + resting * _heartbeats(MANY) / _heartbeats(
        COUNT
    )
    return [
        Row(
            "share of their time that workers wait",
            100.0 * (1.0 - busy / (COUNT * whole)),
            "%",
            "lower",
            5.0,
            f"{COUNT} workers",
        ),
        Row("wait between two tasks, median", 1e3 * float(np.median(waits)), "ms", "lower"),
        Row(
            "scheduler's CPU for a task",
            a_task,
            "ms",
            "lower",
            1.0,
            f"{len(tasks)} tasks, without what it spends at rest",
        ),
        Row(
            "scheduler's CPU at rest",
            100.0 * resting,
            "%",
            "lower",
            None,
            f"{COUNT} workers that only say that they live",
        ),
        Row("scheduler's peak memory", most, "MiB", "lower", 2048.0),
        Row(
            f"{MANY} workers: the scheduler's load",
            100.0 * load,
            "%",
            "lower",
            100.0,
            "extrapolated",
        ),
        Row(
            "a task as it is sent",
            len(pickle.dumps(FakeTask("task 1", None, tasks[1].target, 5.0))),
            "bytes",
            "lower",
            500.0,
        ),
    ]


@contextmanager
def _cluster(folder: Path) -> Iterator[tuple[str, int]]:
    """A scheduler and workers, each in a process of its own: the scheduler's address and process."""
    known = folder / "scheduler.json"
    command = [
        sys.executable,
        "-m",
        "distributed.cli.dask_scheduler",
        "--port",
        "0",
        "--no-dashboard",
        "--scheduler-file",
    ]
    command += [str(known)]
    workers = [
        sys.executable,
        "-m",
        "distributed.cli.dask_worker",
        "--scheduler-file",
        str(known),
        "--nworkers",
        str(COUNT),
    ]
    workers += [
        "--nthreads",
        "1",
        "--no-dashboard",
        "--memory-limit",
        "0",
        "--local-directory",
        str(folder),
    ]
    with subprocess.Popen(
        command,
        env={**os.environ, **SETTINGS},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as scheduler:
        try:
            while not known.exists():
                time.sleep(0.1)
            with subprocess.Popen(
                workers,
                env={**os.environ, **SETTINGS},
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            ) as nannies:
                try:
                    address = json.loads(known.read_text())["address"]
                    _wait_for_all(address)
                    yield address, scheduler.pid
                finally:
                    nannies.terminate()
                    nannies.wait(60)
        finally:
            scheduler.terminate()


def _heartbeats(workers: int) -> float:
    """Heartbeats of all workers in a second."""
    from distributed.scheduler import heartbeat_interval

    return workers / float(heartbeat_interval(workers))


def _wait_for_all(address: str) -> None:
    from distributed import Client

    with Client(address) as client:
        client.wait_for_workers(COUNT, timeout=600)


def _cpu(process: int) -> float:
    """CPU seconds of a process so far."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / 100.0


def _peak(process: int) -> float:
    """MiB that a process held at most."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024.0


def _between(done: list[dict[str, float]]) -> list[float]:
    """Seconds between two tasks of each worker."""
    of: defaultdict[float, list[tuple[float, float]]] = defaultdict(list)
    for one in done:
        of[one["worker"]].append((one["begun"], one["ended"]))
    return [b[0] - a[1] for own in map(sorted, of.values()) for a, b in pairwise(own)]

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""SIGKILLs of a `mine` from a store into a store, by a Dask scheduler and two workers: are the tables those of a run in a folder?

When a random share of the objects is there, the client is killed (each third time its scheduler changes, too), or a worker (each
third time with its nanny), or the scheduler, whose place a new one with new workers takes, or the way to the store: a TCP
forwarder before moto's server, which breaks all connections and is back after 1 to 5 s. The server itself, which holds objects in
memory, lives. Then the same command is run until it ends with 0.
"""

from dataclasses import dataclass, field
from importlib.util import find_spec
import os
from pathlib import Path
import random
import signal
import subprocess
import sys
import tempfile
import time
from typing import Any

from benchmarks._archive import write_archive
from benchmarks._kills_processes import BUCKET, end, Process, Processes, worker_of
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row

KILLS = sized(15, quick=1)  # of each victim
VICTIMS = ("client", "worker", "scheduler", "store")
ARCHIVE = {"rows": sized(160_000, quick=40_000), "hours": 6.0, "encounters": 20, "outside": 10}
SETTINGS = ["--set", "range_size=1", "--set", "task_rows=10000", "--set", "task_encounters=2"]
PATIENCE = 240.0  # s after which a run counts as one that hangs
PAUSE = 0.3  # s, at most, from the object at which a kill comes
RUNS = 6  # of one sequence, at most
LEFT = ".scenario_gen"  # with which names of intermediate files begin
STAGES = ("found", "encounters")  # whose tables are compared
Tables = dict[str, bytes]


@dataclass
class Seen:
    """What was seen of the kills of one victim."""

    kills: int = 0
    same: int = 0
    left: int = 0
    hung: int = 0
    tracebacks: int = 0
    runs: int = 0
    lines: int = 0
    moments: list[float] = field(default_factory=list)


def run(part: str = "all") -> list[Row]:
    """Measure; `part` is client, worker, scheduler or store. No rows where moto is not installed."""
    if find_spec("moto") is None:
        return []
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        archive = write_archive(folder / "archive", 5, **ARCHIVE)
        words = [sys.executable, "-m", "scenario_gen", "mine", str(archive), *SETTINGS]
        words += ["--out", str(folder / "whole")]
        subprocess.run(words, check=True, capture_output=True)
        whole = {
            f"{path.parent.name}/{path.name}": path.read_bytes()
            for path in _tables_in(folder / "whole")
        }
        processes = Processes(folder)
        try:
            processes.start()
            store = processes.store()
            store.create_bucket(Bucket=BUCKET)
            for path in archive.glob("*.csv"):
                store.upload_file(str(path), BUCKET, f"archive/{path.name}")
            rows = []
            for victim in VICTIMS if part == "all" else [part]:
                seen = _killed(victim, processes, whole)
                rows += _rows(victim, seen)
                print(victim, seen, file=sys.stderr)
            return rows
        finally:
            processes.close()


def _rows(victim: str, seen: Seen) -> list[Row]:
    shares = ", ".join(f"{100.0 * moment:.0f}" for moment in sorted(seen.moments))
    what = f"{seen.runs} runs, {seen.lines} lines on the terminal at most; killed at {shares} % of the objects"
    return [
        higher(f"{victim}: kills during the work", seen.kills, "", KILLS, what),
        higher(f"{victim}: the same bytes", seen.same, "", KILLS),
        lower(f"{victim}: temporary objects and files left", seen.left, "", 0.0),
        lower(
            f"{victim}: runs that hang or print a traceback", seen.hung + seen.tracebacks, "", 0.0
        ),
    ]


def _tables_in(out: Path) -> list[Path]:
    return sorted(path for stage in STAGES for path in (out / stage).glob("*.parquet"))


def _killed(victim: str, processes: Processes, whole: Tables) -> Seen:
    """Run sequences until so many kills have hit during the work."""
    seen, number = Seen(), 0
    names = _names(processes, f"{victim}-whole")
    while seen.kills < KILLS and number < 3 * KILLS:
        number += 1
        chance = random.Random(f"{victim} {number}")
        out, log = f"{victim}-{number}", processes.folder / f"{victim}-{number}.txt"
        client = processes.start_client(_words(out), log)
        least = chance.randrange(1, len(names))
        while client.poll() is None and len(_listed(processes, out)) < least:
            time.sleep(0.02)
        time.sleep(chance.uniform(0.0, PAUSE))
        share = len(_listed(processes, out)) / len(names)
        if client.poll() is not None or share == 1.0:
            end(client)
            continue  # all was done before
        seen.moments.append(share)
        _kill(victim, processes, client, chance, number)
        seen.kills += 1
        _go_on(processes, client, out, log, seen)
        _judge(processes, out, log, whole, names, seen)
    return seen


def _words(out: str) -> list[str]:
    return ["mine", f"s3://{BUCKET}/archive", "--out", f"s3://{BUCKET}/{out}", *SETTINGS]


def _names(processes: Processes, out: str) -> set[str]:
    """Return the names of the objects of an undisturbed run."""
    log = processes.folder / f"{out}.txt"
    assert processes.start_client(_words(out), log).wait() == 0, log.read_text()
    return set(_listed(processes, out))


def _listed(processes: Processes, out: str) -> list[str]:
    """Names of the objects of a run."""
    pages = (
        processes.store()
        .get_paginator("list_objects_v2")
        .paginate(Bucket=BUCKET, Prefix=f"{out}/")
    )
    return [
        one["Key"].removeprefix(f"{out}/") for page in pages for one in page.get("Contents", ())
    ]


def _kill(
    victim: str, processes: Processes, client: Process, chance: random.Random, number: int
) -> None:
    """Kill the victim, and start what takes its place."""
    third = number % 3 == 0
    if victim == "client":
        end(client)
        if third:
            processes.end_cluster()
            processes.start_cluster()
    elif victim == "worker":
        which = chance.randrange(2)
        worker = 0
        while not worker:
            worker = worker_of(processes.nannies[which])
        if third:
            end(processes.nannies[which])
            processes.nannies[which] = processes.start_worker()
        else:
            os.kill(worker, signal.SIGKILL)
    elif victim == "scheduler":
        end(processes.scheduler)
        for nanny in processes.nannies:
            end(nanny)
        processes.start_cluster()
    else:
        end(processes.forwarder)
        time.sleep(chance.uniform(1.0, 5.0))
        processes.start_forwarder()


def _go_on(processes: Processes, client: Process, out: str, log: Path, seen: Seen) -> None:
    """Run the command until it ends with 0."""
    for _ in range(RUNS):
        seen.runs += 1
        try:
            if client.wait(PATIENCE) == 0:
                return
        except subprocess.TimeoutExpired:
            seen.hung += 1
            end(client)
        client = processes.start_client(_words(out), log)
    end(client)


def _judge(
    processes: Processes, out: str, log: Path, whole: Tables, names: set[str], seen: Seen
) -> None:
    """Compare what is there with an undisturbed run, and count what is left."""
    store: Any = processes.store()
    there = _listed(processes, out)
    wanted = [name for name in there if name.startswith(tuple(f"{stage}/" for stage in STAGES))]
    tables = {
        name: store.get_object(Bucket=BUCKET, Key=f"{out}/{name}")["Body"].read()
        for name in wanted
    }
    same = tables == whole
    seen.same += same
    extra = set(there) - names
    uploads = store.list_multipart_uploads(Bucket=BUCKET).get("Uploads", [])
    left = [path for path in processes.temporary.rglob("*") if path.name.startswith(LEFT)]
    seen.left += len(extra) + len(uploads) + len(left)
    text = log.read_text()
    seen.tracebacks += "Traceback" in text
    seen.lines = max(seen.lines, len(text.splitlines()))
    if not same or extra or uploads or left or "Traceback" in text:
        print(out, same, extra, uploads, left, text[-3000:], file=sys.stderr)

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Corpus: recall and cost of mining a synthetic archive, and batches by one and two processes.

DuckDB's own copy of the same text to Parquet is the peer, measured in the same run.
"""

from collections.abc import Iterable
import json
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time
from typing import Any

import numpy as np

from benchmarks._archive import Planted, read_planted
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.base.folders import sha256_of
from scenario_gen.corpus.grouping import grouped
from scenario_gen.corpus.mine import mine
from scenario_gen.corpus.schedule import meetings_of
from scenario_gen.corpus.tables import rows_of
from scenario_gen.logs import LogConfig
from scenario_gen.logs.text import SPMD_COLUMNS

ROWS_COUNT = sized(10_000_000, quick=40_000)
ARCHIVES = {
    "dense": {"rows": ROWS_COUNT, "hours": 6.0, "encounters": sized(1000, quick=6)},
    "sparse": {"rows": 5 * ROWS_COUNT, "hours": 30.0, "encounters": sized(537, quick=6)},
}
"""The sparse one has as many encounters per row as the Safety Pilot's archive."""
TEMPLATES_COUNT, SCENARIO_COUNT = sized((200, 50), quick=(2, 2))
ROADS = ("corridor", "t_intersection")
FIRST_PLANTED_COUNT = 1 << 40
"""Device numbers of planted vehicles are above this."""


def run(part: str = "all") -> list[Row]:
    """Measure; `part` is mine or batch."""
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        for name, function in PARTS.items():
            if part in ("all", name):
                rows += function(Path(folder))
    return rows


def _stage(name: str, archive: Path, rest: str) -> dict[str, Any]:
    """Run a stage in its own process; return CPU seconds of its tasks and the peak in MiB."""
    command = [sys.executable, "-m", "benchmarks._corpus_stage", name, str(archive), rest]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1]) if done.stdout else {}
    return found


def _write(
    archive: Path, rows: int, encounters: int, outside: int = 0, hours: float = 1.0
) -> Path:
    settings = {"rows": rows, "hours": hours, "encounters": encounters, "outside": outside}
    _stage("write", archive, json.dumps(settings))
    return archive


def _scores(planted: list[Planted], out: Path) -> tuple[float, float]:
    """Return recall and precision; an encounter has a kind once it is cleaned."""
    hours = sorted((out / "hours").iterdir(), key=lambda hour: int(hour.name.partition("-")[0]))
    rows = list(grouped(meetings_of(hours), LogConfig()))
    found = {frozenset(device % FIRST_PLANTED_COUNT for device in row.devices) for row in rows}
    truth = {frozenset(one.devices) for one in planted if one.inside}
    hits = found & truth
    return len(hits) / len(truth), len(hits) / max(len(rows), 1)


def _duckdb_seconds(archive: Path, place: Path) -> float:
    """Return CPU seconds of DuckDB's copy of the numbers to Parquet, one thread, no checks."""
    import duckdb

    wanted = {"TxDevice", "Gentime", "DSecond", "Latitude", "Longitude", "Speed", "Heading"}
    types = {name: "DOUBLE" if name in wanted else "VARCHAR" for name in SPMD_COLUMNS}
    source = f"read_csv('{archive}/*.csv', header=false, auto_detect=false, columns={types}, "
    query = f"SELECT {', '.join(sorted(wanted))} FROM {source} ignore_errors=true)"
    with duckdb.connect() as database:
        database.execute("SET threads = 1")
        begun = time.process_time()
        database.execute(
            f"COPY ({query}) TO '{place / 'peer.parquet'}' (FORMAT parquet, COMPRESSION zstd)"
        )
        return time.process_time() - begun


def _size(files: Iterable[Path]) -> int:
    return sum(path.stat().st_size for path in files)


def mining(place: Path) -> list[Row]:
    """Mine two archives with planted encounters."""
    return [row for name in ARCHIVES for row in _mining(name, place)]


def _mining(name: str, place: Path) -> list[Row]:
    settings = ARCHIVES[name]
    archive, out = place / f"{name}-archive", place / name
    _stage("write", archive, json.dumps(settings | {"outside": settings["encounters"] // 2}))
    stages = {stage: _stage(stage, archive, str(out)) for stage in ("parse", "search")}
    seconds = {stage: float(np.sum(found["tasks"])) for stage, found in stages.items()}
    memory = {stage: found["mebibytes"] for stage, found in stages.items()}
    slowest = max(float(np.max(found["tasks"])) for found in stages.values())
    recall, precision = _scores(read_planted(archive), out)
    rows = json.loads((archive / "synthetic.json").read_text())["rows"]
    text, total = _size(archive.glob("*.csv")), sum(seconds.values())
    stored = {stage: _size((out / stage).rglob("*.parquet")) for stage in ("messages", "hours")}
    peer = f"DuckDB's copy to Parquet {rows / _duckdb_seconds(archive, place) / 1e6:.2f}"
    label = f"{rows / 1e6:.1f} M rows, {name}"
    from_text, from_parquet = rows / total / 1e6, rows / (total - seconds["parse"]) / 1e6
    peaks = ", ".join(f"{stage} {size:.0f}" for stage, size in memory.items())
    return [
        higher(f"{label}: recall", recall, "", 0.99),
        higher(f"{label}: precision", precision, "", 0.99),
        higher(f"{label}: from text to encounters", from_text, "M rows/CPU s", 0.6, peer),
        higher(f"{label}: from Parquet to encounters", from_parquet, "M rows/CPU s", 2.5),
        lower(f"{label}: slowest task", slowest, "CPU s", 5.0),
        lower(f"{label}: peak memory", max(memory.values()), "MiB", 1024.0, peaks),
        *(
            lower(f"{label}: {stage}, share of text", 100.0 * size / text, "%", 5.0)
            for stage, size in stored.items()
        ),
    ]


def spent(words: list[str]) -> float:
    """Return CPU seconds of a Python command and of the processes that it waits for."""
    before = os.times()
    subprocess.run([sys.executable, *words], check=True, capture_output=True)
    after = os.times()
    return (
        after.children_user + after.children_system - before.children_user - before.children_system
    )


def _digests(out: Path) -> dict[str, str]:
    """Return the SHA-256 of each table and bag."""
    found = (path for path in out.rglob("*") if path.suffix in (".parquet", ".mcap", ".yaml"))
    return {str(path.relative_to(out)): sha256_of(path) for path in found}


def batch(place: Path) -> list[Row]:
    """Run 200 templates × 2 roads × 50 scenarios by one process and by two."""
    corpus, cpu = place / "templates", {}
    archive = _write(place / "templates-archive", 1500 * TEMPLATES_COUNT + 5000, TEMPLATES_COUNT)
    mine([archive], corpus)
    counts = ["--count", str(SCENARIO_COUNT), "--templates", str(TEMPLATES_COUNT)]
    words = ["-m", "scenario_gen", "batch", str(corpus), "--roads", ",".join(ROADS), *counts]
    for workers in (1, 2):
        out = place / f"batch-{workers}"
        cpu[workers] = spent([*words, "--out", str(out), "--workers", str(workers)])
    cases = list(rows_of(sorted((place / "batch-1" / "cases").rglob("*.parquet"))))
    scenarios = sum(int(case["published"]) for case in cases)
    same = _digests(place / "batch-1") == _digests(place / "batch-2")
    label = f"{TEMPLATES_COUNT} templates × {len(ROADS)} roads × {SCENARIO_COUNT}"
    return [
        lower(f"{label}: CPU with two processes over one", cpu[2] / cpu[1], "", 1.15),
        higher(f"{label}: the same bytes", same, "", 1.0, f"{os.cpu_count()} cores"),
        higher(f"{label}: scenarios", scenarios),
        lower("CPU of a template on a road", cpu[1] / len(cases), "s"),
        lower("CPU of a scenario", cpu[1] / max(scenarios, 1), "s"),
    ]


PARTS = {"mine": mining, "batch": batch}

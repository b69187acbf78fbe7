# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Corpus: what mining finds, what it costs, batches by one and two processes.

Everything is synthetic but the full recordings. CPU seconds depend on what else the machine does; DuckDB's own copy of the same
text to Parquet stands beside them, from the same run.
"""

from collections import Counter
from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
import json
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile
import time

import numpy as np

from benchmarks._archive import Planted, read_planted
from benchmarks._corpus_peers import costs, missing
from benchmarks._corpus_store import bucket_with, spent, START
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.base.errors import RefusedError
from scenario_gen.base.folders import sha256_of
from scenario_gen.corpus.batch import seed_of
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.encounters import encounter_of, tables_of
from scenario_gen.corpus.mine import mine
from scenario_gen.corpus.tables import rows_of
from scenario_gen.logs.tables import SPMD_COLUMNS

DATA = Path(
    os.environ.get("SCENARIO_GEN_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")
)
ROWS = sized(10_000_000, quick=40_000)
DENSE = {
    "rows": ROWS,
    "hours": 6.0,
    "encounters": sized(1000, quick=6),
    "outside": sized(500, quick=6),
}
SPARSE = {
    "rows": 5 * ROWS,
    "hours": 30.0,
    "encounters": sized(537, quick=6),
    "outside": sized(268, quick=6),
}
"""As many encounters in a row as the Safety Pilot's archive has: 462,161 in 43 · 10⁹."""
ARCHIVES = {"dense": DENSE, "sparse": SPARSE}
CLEANED = sized(300, quick=10)
TEMPLATES, COUNT = sized((200, 50), quick=(2, 2))
ROADS = ("corridor", "t_intersection")
PEERS = sized(3, quick=1)
STORED, ROUNDS = sized((4_000_000, 3), quick=(80_000, 1))
TRUE = 1 << 40


def run(part: str = "all") -> list[Row]:
    """Measure; `part` is mine, memory, store, recorded, batch or peers."""
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        for name, function in PARTS.items():
            if part in ("all", name):
                rows += function(place)
    return rows


def _stage(name: str, archive: Path, rest: str) -> dict[str, list[float] | float]:
    """Run a stage in a process of its own; return CPU seconds of its tasks, and MiB at its peak."""
    words = [sys.executable, "-m", "benchmarks._corpus_stage", name, str(archive), rest]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    found: dict[str, list[float] | float] = (
        json.loads(done.stdout.splitlines()[-1]) if done.stdout else {}
    )
    return found


@cache
def _mined(place: Path, name: str) -> tuple[dict[str, float], dict[str, float], Path, Path]:
    """Write an archive and mine it up to the table of encounters; return CPU s and MiB by stage, archive and corpus."""
    archive, out = place / f"{name}-archive", place / name
    _stage("write", archive, json.dumps(ARCHIVES[name]))
    seconds, memory = {}, {}
    for stage in ("parse", "search", "group"):
        found = _stage(stage, archive, str(out))
        tasks = found["tasks"]
        assert isinstance(tasks, list) and isinstance(found["mebibytes"], float)
        seconds[stage], memory[stage] = float(np.sum(tasks)), found["mebibytes"]
        seconds[f"{stage}, a task"] = float(np.median(tasks))
    return seconds, memory, archive, out


def _scores(planted: list[Planted], out: Path) -> tuple[float, float, float]:
    """Recall, precision and share of right kinds of the table of encounters."""
    from pyarrow import parquet

    rows = parquet.read_table(out / "found").to_pylist()
    found = {frozenset(device % TRUE for device in row["devices"]): row["kind"] for row in rows}
    true = {frozenset(one.devices): one.kind for one in planted if one.inside}
    hit = found.keys() & true.keys()
    return (
        len(hit) / len(true),
        len(hit) / max(len(rows), 1),
        float(np.mean([found[who] == true[who] for who in hit])),
    )


def _peer(archive: Path, place: Path) -> float:
    """CPU seconds of DuckDB's own copy of the archive's numbers to Parquet, in one thread, with nothing counted or checked."""
    import duckdb

    wanted = {"TxDevice", "Gentime", "DSecond", "Latitude", "Longitude", "Speed", "Heading"}
    columns = ", ".join(
        f"'{name}': '{'DOUBLE' if name in wanted else 'VARCHAR'}'" for name in SPMD_COLUMNS
    )
    with duckdb.connect() as base:
        base.execute("SET threads = 1")
        begun = time.process_time()
        base.execute(
            f"COPY (SELECT {', '.join(sorted(wanted))} FROM read_csv('{archive}/*.csv', header=false, auto_detect=false, "
            f"columns={{{columns}}}, ignore_errors=true)) TO '{place / 'peer.parquet'}' (FORMAT parquet, COMPRESSION zstd)"
        )
        return time.process_time() - begun


def _bytes(files: Iterable[Path]) -> int:
    return sum(path.stat().st_size for path in files)


def mining(place: Path) -> list[Row]:
    """Encounters planted among 10⁷ rows, ten times as densely as in the Safety Pilot's archive: found, and at what cost."""
    seconds, memory, archive, out = _mined(place, "dense")
    recall, precision, kinds = _scores(read_planted(archive), out)
    rows = json.loads((archive / "synthetic.json").read_text())["rows"]
    accounts = [json.loads(path.read_text()) for path in (out / "messages").glob("*.json")]
    kept = sum(int(count) for account in accounts for count in account["hours"].values())
    all_of_it = seconds["parse"] + seconds["search"] + seconds["group"]
    peer = f"DuckDB's copy of the text to Parquet alone: {rows / _peer(archive, place) / 1e6:.2f}"
    what = f"{rows / 1e6:.1f} M rows, {DENSE['encounters']} encounters and {DENSE['outside']} just outside"
    text = _bytes(archive.glob("*.csv"))
    stored = {stage: _bytes((out / stage).iterdir()) for stage in ("messages", "hours", "found")}
    cleaned = _cleaning(archive, place)
    return [
        higher(f"recall, {what}", recall, "", 0.99),
        higher("precision", precision, "", 0.99),
        higher("kinds", kinds, "", 0.95),
        higher(
            "from text to the table of encounters",
            rows / all_of_it / 1e6,
            "M rows/CPU s",
            0.6,
            peer,
        ),
        higher(
            "from Parquet to the table of encounters",
            kept / (all_of_it - seconds["parse"]) / 1e6,
            "M rows/CPU s",
            2.5,
        ),
        higher("text to Parquet", rows / seconds["parse"] / 1e6, "M rows/CPU s", None, peer),
        lower("cleaning of found encounters", cleaned, "CPU s each"),
        lower("text", text / rows, "bytes/row"),
        *(lower(f"files of {stage}", size / rows, "bytes/row") for stage, size in stored.items()),
        *(
            lower(f"files of {stage}, share of text", 100.0 * size / text, "%", 5.0)
            for stage, size in stored.items()
        ),
        *(
            higher(f"a task of {stage}", seconds[f"{stage}, a task"], "CPU s")
            for stage in ("parse", "search")
        ),
        *(lower(f"peak memory of {stage}", memory[stage], "MiB", 1024.0) for stage in memory),
    ]


def _cleaning(archive: Path, place: Path) -> float:
    """CPU seconds for each of some encounters of an archive with as many as are to be cleaned."""
    settings = {"rows": 1000 * CLEANED + 5000, "hours": 1.0, "encounters": CLEANED, "outside": 0}
    small, out = place / "small-archive", place / "small"
    _stage("write", small, json.dumps(settings))
    for stage in ("parse", "search", "group"):
        _stage(stage, small, str(out))
    found = _stage("clean", small, str(out))["tasks"]
    assert isinstance(found, list)
    return float(np.sum(found)) / CLEANED


def memory_of(place: Path) -> list[Row]:
    """Five times the rows at the density of the Safety Pilot's archive: memory, and rates."""
    few = _mined(place, "dense")[1]
    seconds, memory, archive, out = _mined(place, "sparse")
    recall, precision, kinds = _scores(read_planted(archive), out)
    rows = json.loads((archive / "synthetic.json").read_text())["rows"]
    searching = seconds["search"] + seconds["group"]
    what = f"{rows / 1e6:.0f} M rows, {SPARSE['encounters']} encounters"
    return [
        higher(f"{what}: recall", recall, "", 0.99),
        higher(f"{what}: precision", precision, "", 0.99),
        higher(f"{what}: kinds", kinds, "", 0.95),
        higher(
            f"{what}: from text", rows / (seconds["parse"] + searching) / 1e6, "M rows/CPU s", 0.6
        ),
        higher(f"{what}: from Parquet", rows / searching / 1e6, "M rows/CPU s", 2.5),
        lower(f"{what}: peak memory", max(memory.values()), "MiB", 1024.0),
        lower(
            f"{what}: peak memory by that of {ROWS / 1e6:.0f} M",
            max(memory.values()) / max(few.values()),
            "",
            1.2,
        ),
    ]


def store(place: Path) -> list[Row]:
    """An archive in an object store mined to the store, against the same in folders; no row without moto's server."""
    if find_spec("moto") is None or find_spec("flask") is None:
        return []
    archive = place / "stored-archive"
    _stage(
        "write",
        archive,
        json.dumps({"rows": STORED, "hours": 6.0, "encounters": 40, "outside": 20}),
    )
    mined = ["-m", "scenario_gen", "mine", "--workers", "1"]
    cpu: dict[str, list[float]] = {"store": [], "local": [], "start": [], "start local": []}
    with bucket_with(archive) as (url, environment):
        for k in range(ROUNDS):
            cpu["local"].append(
                spent([*mined, str(archive), "--out", str(place / f"stored-{k}")], {})
            )
            cpu["store"].append(
                spent([*mined, f"{url}/archive", "--out", f"{url}/out-{k}"], environment)
            )
            cpu["start local"].append(spent(["-c", START, str(place)], {}))
            cpu["start"].append(spent(["-c", START, url], environment))
    of = {name: float(np.median(values)) for name, values in cpu.items()}
    loaded = of["start"] - of["start local"]
    what = f"{_bytes(archive.glob('*.csv')) / 1e6:.0f} MB of text, in and to s3"
    parts = f"{of['store']:.1f} and {of['local']:.1f} s, of which the libraries of the store take {loaded:.1f} s to load"
    return [
        lower(f"{what}: CPU over that of folders", of["store"] / of["local"], "×", 1.2, parts),
        lower(
            f"{what}: the same without loading the libraries",
            (of["store"] - loaded) / of["local"],
            "×",
        ),
    ]


RECORDED = {  # what is known of the full recordings: how they are read, and at least how many encounters they hold
    "cats_av_lane_change": (
        (
            "cats_vehicle1_full.csv",
            "cats_vehicle2_full.csv",
            "cats_vehicle3_full.csv",
            "cats_vehicle4_full.csv",
        ),
        10,
    ),
    "psu_2obu": (("psu_meet_full.csv",), 1),
    "openacc_zalazone": (("openacc_no_ACC_handling_part22_first150s.csv",), 1),
    "ngsim_commonroad": (("USA_Lanker-2_13_T-1_all_vehicles.csv",), 1),
}


def recorded(place: Path) -> list[Row]:
    """The full recordings, each its own corpus."""
    rows = []
    for folder, (files, least) in RECORDED.items():
        if not (DATA / "trajectories" / folder).is_dir():
            continue
        source = place / "recorded" / folder
        source.mkdir(parents=True)
        for file in files:
            shutil.copy(DATA / "trajectories" / folder / file, source)
        mined = mine([source], place / "recorded" / f"{folder}-corpus", CorpusConfig())
        kinds = ", ".join(f"{n} {kind}" for kind, n in sorted(mined.kinds.items()))
        rows.append(higher(f"encounters in {folder} ({kinds})", mined.encounters, "", least))
    return rows


def _corpus(place: Path) -> Path:
    """A corpus of as many synthetic templates as a batch takes."""
    out = place / "templates"
    if not out.exists():
        settings = {
            "rows": 1500 * TEMPLATES + 5000,
            "hours": 1.0,
            "encounters": TEMPLATES,
            "outside": 0,
        }
        _stage("write", place / "templates-archive", json.dumps(settings))
        mine([place / "templates-archive"], out)
    return out


def _words(corpus: Path, out: Path, workers: int, count: int, templates: int) -> list[str]:
    words = [
        "batch",
        str(corpus),
        "--out",
        str(out),
        "--roads",
        ",".join(ROADS),
        "--workers",
        str(workers),
    ]
    return [*words, "--count", str(count), "--templates", str(templates)]


def _digests(out: Path) -> dict[str, str]:
    """SHA-256 of each table and bag."""
    found = (path for path in out.rglob("*") if path.suffix in (".parquet", ".mcap", ".yaml"))
    return {str(path.relative_to(out)): sha256_of(path) for path in found}


def batch(place: Path) -> list[Row]:
    """200 templates × 2 roads × 50 scenarios, by one process and by two."""
    corpus = _corpus(place)
    cpu, wall = {}, {}
    for workers in (1, 2):
        begun, before = time.monotonic(), os.times()
        out = place / f"batch-{workers}"
        subprocess.run(
            [
                sys.executable,
                "-m",
                "scenario_gen",
                *_words(corpus, out, workers, COUNT, TEMPLATES),
            ],
            check=True,
            capture_output=True,
        )
        after = os.times()
        cpu[workers] = (
            after.children_user
            + after.children_system
            - before.children_user
            - before.children_system
        )
        wall[workers] = time.monotonic() - begun
    cases = list(rows_of(sorted((place / "batch-1" / "cases").rglob("*.parquet"))))
    scenarios = sum(int(case["published"]) for case in cases)
    what = f"{TEMPLATES} templates × {len(ROADS)} roads × {COUNT}"
    causes = Counter(case["cause"] for case in cases if not case["published"])
    without = "; ".join(f"{n} × {cause}" for cause, n in causes.most_common(3))
    return [
        lower(f"{what}: CPU with two processes by that with one", cpu[2] / cpu[1], "", 1.15),
        higher(
            f"{what}: the same bytes",
            float(_digests(place / "batch-1") == _digests(place / "batch-2")),
            "",
            1.0,
        ),
        higher(f"{what}: scenarios (cases without any: {without})", scenarios, ""),
        lower("CPU of a template on a road", cpu[1] / len(cases), "s"),
        lower("CPU of a scenario", cpu[1] / max(scenarios, 1), "s"),
        *(lower(f"time with {n} processes", wall[n], "s") for n in (1, 2)),
    ]


def peers(place: Path) -> list[Row]:
    """A few templates on the roads of a batch by a chain of peers; no row where one is not installed (`make bench`)."""
    if missing():
        return []
    rows = list(rows_of(tables_of(_corpus(place))))[: PEERS + 1]
    spent: list[dict[str, float]] = []
    for row in rows:
        for road in ROADS:
            with suppress(RefusedError):
                spent.append(costs(encounter_of(row), road, COUNT, seed_of(0, row["name"], road)))
    spent = spent[len(ROADS) :] or spent  # those of the first template load and compile
    chain = [sum(one.values()) - one["ours"] for one in spent]
    parts = ", ".join(
        f"{name} {np.median([one[name] for one in spent]):.2f}"
        for name in spent[0]
        if name != "ours"
    )
    times = [theirs / one["ours"] for theirs, one in zip(chain, spent, strict=True)]
    what = f"{len(spent)} templates on roads × {COUNT}, median"
    return [
        lower(f"{what}: CPU of ours", float(np.median([one["ours"] for one in spent])), "s"),
        lower(f"{what}: CPU of the chain of peers", float(np.median(chain)), "s", None, parts),
        higher(
            f"{what}: chain by ours",
            float(np.median(times)),
            "×",
            20.0,
            f"{min(times):.1f} to {max(times):.1f}",
        ),
    ]


PARTS = {
    "mine": mining,
    "memory": memory_of,
    "store": store,
    "recorded": recorded,
    "batch": batch,
    "peers": peers,
}

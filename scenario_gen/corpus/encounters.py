# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Encounters kept by the thousand: tables in which each is a row, with its tracks as the bytes that a bag would hold.

The messages of those who meet are cleaned and smoothed by `logs`, as a log's are; a log of another format is read whole.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
import json
from pathlib import Path
from typing import Any

import numpy as np

from scenario_gen.bags.recordings.tracks import tracks_bytes, tracks_of
from scenario_gen.base.documents import parse_json, shown
from scenario_gen.base.errors import guarded, InputError
from scenario_gen.base.stores import fetched, Place
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.grouping import Found, label, part_of, read_found
from scenario_gen.corpus.messages import DEGREE
from scenario_gen.corpus.tables import write_table
from scenario_gen.logs import (
    encounters_of,
    NoEncounterError,
    Observations,
    RawLog,
    read_log,
    Segment,
    space_time_gap,
    UnknownFormatError,
)
from scenario_gen.logs.tables import SPMD_EPOCH_NS
from scenario_gen.method.evaluation import criticality, EvaluationConfig
from scenario_gen.situation import Situation
from scenario_gen.types import Encounter

ROW = {  # what is read of a row, and of which kinds it is
    **dict.fromkeys(("name", "kind"), str),
    "count": int,
    "tracks": bytes,
    **dict.fromkeys(("lat", "lon"), float | None),
}
COLUMNS = {  # of a table
    **dict.fromkeys(("name", "source", "kind", "kinds", "reactions"), "string"),
    "vehicles": "string[]",
    **dict.fromkeys(("count", "start_ns"), "int64"),
    **dict.fromkeys(("seconds", "gap", "distance", "lat", "lon", "ttc", "pet", "speed"), "double"),
    "tracks": "binary",
}
MARGIN = 2_000_000  # µs of messages before and after an encounter, for smoothing


@dataclass(frozen=True)
class CleanTask:
    """Encounters to clean: `found` are (partition, first row, row after the last), `hours` those of their messages.

    A corpus has thousands of these tasks, each of which passes through the scheduler: it holds numbers, no tables or paths.
    """

    name: str
    corpus: Place
    number: int
    found: tuple[tuple[int, int, int], ...]
    hours: tuple[int, ...]
    config: CorpusConfig

    @property
    def target(self) -> Place:
        """The table to write."""
        return self.corpus / "encounters" / f"found-{self.number:06}.parquet"


@dataclass(frozen=True)
class LogTask:
    """A log to read, of any format that `read_log` knows, and the table to write."""

    name: str
    paths: tuple[Place, ...]
    target: Place
    config: CorpusConfig


def clean_found(task: CleanTask) -> None:
    """Write the table of a task: a row for each encounter that is whole after cleaning, and why others are not."""
    from pyarrow import parquet

    parts = [part_of(task.corpus, number) for number, _, _ in task.found]
    with fetched(
        [*parts, *(task.corpus / "hours" / f"hour-{hour}.rows.parquet" for hour in task.hours)]
    ) as here:
        listed = [
            one
            for path, (_, *rows) in zip(here, task.found, strict=False)
            for one in read_found(path, *rows)
        ]
        first, last = (
            min(one.start for one in listed) - MARGIN,
            max(one.end for one in listed) + MARGIN,
        )
        wanted = sorted({device for one in listed for device in one.devices})
        filters = [("t", ">=", first), ("t", "<=", last), ("device", "in", wanted)]
        tables = [
            parquet.read_table(path, filters=filters).to_pandas() for path in here[len(parts) :]
        ]
    import pandas as pd

    messages = (
        pd.concat(tables)
        .drop_duplicates()
        .sort_values(["device", "t", "lat", "lon"], kind="stable")
    )
    by_device = dict(tuple(messages.groupby("device")))
    rows, refused = [], []
    for found in listed:
        try:
            encounters = encounters_of(_raw(found, by_device), task.config.log).encounters
        except InputError as error:
            refused.append({"name": found.name, "why": str(error)})
            continue
        rows += [row_of(encounter, "messages", task.config) for encounter in encounters]
    write_encounters(task.target, rows, {"refused": refused, "quality": []})


def _raw(found: Found, by_device: Mapping[int, Any]) -> RawLog:
    """The messages of an encounter as a log."""
    vehicles, begin = [], 0
    for device in found.devices:
        own = by_device[device]
        own = own[(own["t"] >= found.start - MARGIN) & (own["t"] <= found.end + MARGIN)]
        stamps = own["t"].to_numpy(np.int64) * 1000 + SPMD_EPOCH_NS
        numbers = np.arange(begin, begin + len(own))
        speed = own["speed"].to_numpy(np.float64)
        heading = np.pi / 2.0 - own["heading"].to_numpy(np.float64) * (np.pi / 180.0)
        vehicles.append(
            Observations(
                label(device),
                stamps,
                own[["lat", "lon"]].to_numpy() / DEGREE,
                numbers,
                heading,
                stamps,
                speed,
                numbers,
            )
        )
        begin += len(own)
    return RawLog(
        found.name, True, tuple(vehicles), begin, (Segment(0, found.name, "message", 1),)
    )


def read_one_log(task: LogTask) -> None:
    """Write the table of a log's encounters; it is bounded as every log is (`LogConfig`).

    Raises:
        InputError: the log cannot be used; the message names file and row.
    """
    try:
        with fetched(task.paths) as here:
            result = read_log(here, task.config.log)
    except (NoEncounterError, UnknownFormatError) as error:  # a result: the log is not read again
        write_encounters(
            task.target, [], {"refused": [{"name": task.name, "why": str(error)}], "quality": []}
        )
        return
    source = ", ".join(path.name for path in task.paths)
    rows = [row_of(encounter, source, task.config) for encounter in result.encounters]
    write_encounters(task.target, rows, {"refused": [], "quality": list(result.quality.lines())})


def row_of(encounter: Encounter, source: str, config: CorpusConfig) -> dict[str, Any]:
    """Return an encounter's row: its kind is that of the two vehicles that have most to do with each other."""
    situation, pairs = Situation.of(encounter), []
    for i, j in combinations(range(len(encounter.vehicles)), 2):
        both = np.flatnonzero(encounter.is_present[i] & encounter.is_present[j])
        if len(both) < 2:
            continue
        apart = np.linalg.norm(encounter.position[i, both] - encounter.position[j, both], axis=1)
        near = both[apart < config.log.proximity]
        rows = near if len(near) > 1 else both
        gap, _, _ = space_time_gap(
            encounter.position[i, rows], encounter.position[j, rows], encounter.dt
        )
        pairs.append((gap, i, j, situation.kind(i, j)))
    pairs.sort()
    measures = criticality(encounter, EvaluationConfig().ttc_horizon)
    latitude, longitude = encounter.origin or (None, None)
    return {
        "name": encounter.name,
        "source": source,
        "kind": pairs[0][3],
        "reactions": json.dumps(situation.reactions.document(encounter.vehicles)),
        "kinds": json.dumps(
            {
                f"{encounter.vehicles[i].id} {encounter.vehicles[j].id}": kind
                for _, i, j, kind in pairs
            }
        ),
        "vehicles": [vehicle.id for vehicle in encounter.vehicles],
        "count": len(encounter.vehicles),
        "start_ns": encounter.start_ns,
        "seconds": encounter.duration,
        "gap": pairs[0][0],
        "distance": measures.min_distance,
        "lat": latitude,
        "lon": longitude,
        "ttc": measures.min_ttc,
        "pet": measures.pet,
        "speed": float((encounter.speed * encounter.is_present).max()),
        "tracks": tracks_bytes(encounter),
    }


def write_encounters(
    target: Place, rows: Sequence[Mapping[str, Any]], account: Mapping[str, Any]
) -> None:
    """Write a table of encounters; the account stands in its metadata."""
    write_table(target, rows, COLUMNS, account=account)


def tables_of(corpus: Place) -> list[Place]:
    """Return the tables of a corpus that `mine` wrote, sorted.

    Raises:
        InputError: there is none.
    """
    found: list[Place] = sorted((corpus / "encounters").glob("*.parquet"), key=str)
    if not found:
        raise InputError(
            f"{corpus} holds no encounters/*.parquet; write it with `scenario-gen mine ARCHIVE --out {corpus}`"
        )
    return found


def account_of(table: Path, name: Place) -> dict[str, Any]:
    """Return what a table says of the encounters that are not in it, and of its log's quality; `name` is for messages.

    Raises:
        InputError: the table is damaged.
    """
    from pyarrow import parquet

    with guarded(f"{name} cannot be read as a table"):
        text = (parquet.read_schema(table).metadata or {}).get(b"account", b"{}").decode()
    account: dict[str, Any] = parse_json(text, f"{name}: account", {"type": "object"})
    return account


def encounter_of(row: Mapping[str, Any], table: object = "an encounter's row") -> Encounter:
    """Return a row's encounter.

    Args:
        row: of a table that `mine` wrote.
        table: names it in messages.

    Raises:
        InputError: the row lacks a value, or its bytes are damaged.
    """
    for name, kind in ROW.items():
        if name not in row or not isinstance(row[name], kind):
            raise InputError(
                f"{table}: column {name} holds {shown(row.get(name))}; `mine` writes it anew"
            )
    origin = None if row["lat"] is None or row["lon"] is None else (row["lat"], row["lon"])
    try:
        return replace(tracks_of(row["tracks"], row["name"], origin), name=row["name"])
    except InputError as error:
        raise InputError(f"{table}: {error}") from error

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tables of encounters: each row has the facts and the tracks, with the bytes of a bag.

Messages of vehicles that meet are cleaned and smoothed by `logs`, as those of a log; logs in other
formats are read whole.
"""

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from itertools import combinations
import json
from pathlib import Path
from typing import Any

import numpy as np

from scenario_gen.bags.vehicles import decode_tracks, encode_tracks
from scenario_gen.base.documents import parse_json, shown
from scenario_gen.base.errors import guarded, InputError, UnforeseenError
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.grouping import FoundEncounter, label
from scenario_gen.corpus.meetings import MESSAGES_AFTER_US, MESSAGES_BEFORE_US, ROWS
from scenario_gen.corpus.messages import database, digest_of, tables, UNITS_PER_DEGREE
from scenario_gen.corpus.tables import write_table
from scenario_gen.corpus.tracks import runs_of
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
from scenario_gen.logs.quality import DoubtError
from scenario_gen.logs.tables import SPMD_EPOCH_NS
from scenario_gen.method.evaluation import criticality, EvaluationConfig
from scenario_gen.situation import Situation
from scenario_gen.types import Encounter

ROW = {  # columns that are read, and their types
    **dict.fromkeys(("name", "kind"), str),
    "count": int,
    "tracks": bytes,
    **dict.fromkeys(("lat", "lon"), float | None),
}
COLUMNS = {  # of a table
    **dict.fromkeys(("name", "source", "kind", "kinds", "reactions"), "string"),
    **dict.fromkeys(("vehicles",), "string[]"),
    **dict.fromkeys(("count", "start_ns"), "int64"),
    **dict.fromkeys(("seconds", "gap", "distance", "lat", "lon", "ttc", "pet", "speed"), "double"),
    "tracks": "binary",
}
QUALITY = "quality of logs"
NOTES = {  # of a table: what was left out, and remarks
    "type": "array",
    "items": {
        "type": "object",
        "required": ["name", "cause", "why"],
        "additionalProperties": {"type": "string"},
    },
}
UNREAD_LOGS: tuple[str, str] = ("not in a known format", "cannot be read")  # causes
MEETING_MARGIN_US = 2_000_000  # smooth vehicles meet a little earlier or later than raw ones


@dataclass(frozen=True)
class CleanTask:
    """Encounters to clean.

    Attributes:
        name: of the task; begins with the time of the first encounter.
        corpus: of the encounters.
        encounters: the ones to clean.
        hours: the folders of the hours with their messages.
        config: the parameters.
    """

    name: str
    corpus: Path
    encounters: tuple[FoundEncounter, ...]
    hours: tuple[Path, ...]
    config: CorpusConfig

    @property
    def target(self) -> Path:
        """The table to write."""
        hours = [hour.name for hour in self.hours]
        digest = digest_of([astuple(entry) for entry in self.encounters], hours)
        return self.corpus / "encounters" / f"found-{self.name}-{digest}.parquet"


@dataclass(frozen=True)
class LogTask:
    """A log in any format that `read_log` reads, and the table to write."""

    name: str
    paths: tuple[Path, ...]
    target: Path
    config: CorpusConfig


def clean_found(task: CleanTask) -> None:
    """Write a row for each encounter that survives cleaning, and why others do not."""
    by_device = _by_device(task)
    rows: list[dict[str, Any]] = []
    refused = []
    for entry in task.encounters:
        try:
            log = _raw_log(entry, by_device)
            encounters = encounters_of(log, task.config.log, _met_ns(entry)).encounters
        except InputError as error:
            refused.append(_refusal(entry.name, error, "not usable"))
            continue
        rows += [row_of(encounter, "messages", task.config) for encounter in encounters]
    write_encounters(task.target, rows, refused)


def _by_device(task: CleanTask) -> dict[int, dict[str, Any]]:
    """Return the columns of messages by vehicle, ordered by time, without repeated ones."""
    begin = min(entry.start for entry in task.encounters) - MESSAGES_BEFORE_US
    end = max(entry.end for entry in task.encounters) + MESSAGES_AFTER_US
    devices = {str(device) for entry in task.encounters for device in entry.devices}
    with database(task.corpus, task.config.memory, f"{task.name} of {task.corpus}") as base:
        columns = base.execute(f"""
            SELECT DISTINCT device, t, lat, lon, speed, heading
            FROM {tables([hour / ROWS for hour in task.hours])}
            WHERE t BETWEEN {begin} AND {end} AND device IN ({", ".join(devices)})
            ORDER BY ALL""").fetchnumpy()
    return {
        int(columns["device"][first]): {
            name: np.asarray(values[first:last]) for name, values in columns.items()
        }
        for first, last in runs_of(columns["device"])
    }


def _raw_log(entry: FoundEncounter, by_device: Mapping[int, Mapping[str, Any]]) -> RawLog:
    """Return the messages of an encounter as a log."""
    vehicles, count = [], 0
    window = [entry.start - MESSAGES_BEFORE_US, entry.end + MESSAGES_AFTER_US + 1]
    for device in entry.devices:
        messages = by_device[device]
        rows = slice(*np.searchsorted(messages["t"], window))
        states = [messages[name][rows] for name in ("lat", "lon", "heading", "speed")]
        states[0] = states[0] / UNITS_PER_DEGREE
        states[1] = states[1] / UNITS_PER_DEGREE
        states[2] = np.pi / 2.0 - states[2].astype(np.float64) * (np.pi / 180.0)
        stamps = messages["t"][rows] * 1000 + SPMD_EPOCH_NS
        numbers = np.arange(count, count + len(stamps))
        unknown = (np.nan, np.nan)
        vehicles.append(
            Observations.of_rows(label(device), stamps, np.stack(states, 1), numbers, unknown)
        )
        count += len(stamps)
    segment = Segment(0, entry.name, "message", 1)
    return RawLog(entry.name, True, tuple(vehicles), count, (segment,))


def _met_ns(entry: FoundEncounter) -> tuple[int, int]:
    """Return the stamps [ns] between which the vehicles of an encounter meet."""
    begin = 1000 * (entry.start - MEETING_MARGIN_US) + SPMD_EPOCH_NS
    return begin, 1000 * (entry.end + MEETING_MARGIN_US) + SPMD_EPOCH_NS


def read_one_log(task: LogTask) -> None:
    """Write the encounters of a log; it has the bounds of every log (`LogConfig`).

    Raises:
        InputError: a reader has a bug.
    """
    try:
        result = read_log(task.paths, task.config.log)
    except InputError as error:
        if isinstance(error, UnforeseenError) or isinstance(error.__cause__, PermissionError):
            raise
        # The log is finished until its files change.
        write_encounters(task.target, [], [_refusal(str(task.paths[0]), error, UNREAD_LOGS[1])])
        return
    source = ", ".join(path.name for path in task.paths)
    rows = [row_of(encounter, source, task.config) for encounter in result.encounters]
    lines = "\n".join(result.quality.lines())
    write_encounters(
        task.target, rows, [{"name": str(task.paths[0]), "cause": QUALITY, "why": lines}]
    )


def _refusal(name: str, error: InputError, otherwise: str) -> dict[str, str]:
    """Return the name of what is left out, the group of the cause, and the reason."""
    causes: dict[type[InputError], str] = {
        NoEncounterError: "no encounter",
        UnknownFormatError: UNREAD_LOGS[0],
        DoubtError: "in doubt",
    }
    return {"name": name, "cause": causes.get(type(error), otherwise), "why": str(error)}


def row_of(encounter: Encounter, source: str, config: CorpusConfig) -> dict[str, Any]:
    """Return the row of an encounter; its kind is that of the two vehicles that are nearest."""
    situation = Situation.of(encounter)
    gaps = _space_time_gaps(encounter, config.log.proximity)
    kinds = {pair: situation.kind(*pair) for _, pair in gaps}
    nearest_gap, nearest = gaps[0]
    ids = encounter.ids
    measures = criticality(encounter, EvaluationConfig().ttc_horizon)
    latitude, longitude = encounter.origin or (None, None)
    return {
        "name": encounter.name,
        "source": source,
        "kind": kinds[nearest],
        "reactions": json.dumps(situation.reactions.document(encounter.vehicles)),
        "kinds": json.dumps({f"{ids[i]} {ids[j]}": kind for (i, j), kind in kinds.items()}),
        "vehicles": ids,
        "count": len(ids),
        "start_ns": encounter.start_ns,
        "seconds": encounter.duration,
        "gap": nearest_gap,
        "distance": measures.min_distance,
        "lat": latitude,
        "lon": longitude,
        "ttc": measures.min_ttc,
        "pet": measures.pet,
        "speed": float((encounter.speed * encounter.is_present).max()),
        "tracks": encode_tracks(encounter),
    }


def _space_time_gaps(
    encounter: Encounter, proximity: float
) -> list[tuple[float, tuple[int, int]]]:
    """Return the space-time gap [m] of each pair while it is within `proximity` [m], ascending."""
    gaps = []
    for i, j in combinations(range(len(encounter.vehicles)), 2):
        both = np.flatnonzero(encounter.is_present[i] & encounter.is_present[j])
        if len(both) < 2:
            continue
        first, second = encounter.position[i, both], encounter.position[j, both]
        near = np.linalg.norm(first - second, axis=1) < proximity
        if near.sum() > 1:
            first, second = first[near], second[near]
        gap, _, _ = space_time_gap(first, second, encounter.dt)
        gaps.append((gap, (i, j)))
    return sorted(gaps)


def write_encounters(
    target: Path, rows: Sequence[Mapping[str, Any]], notes: Sequence[Mapping[str, str]] = ()
) -> None:
    """Write a table of encounters, with notes in its metadata."""
    write_table(target, rows, COLUMNS, account=list(notes))


def tables_of(corpus: Path) -> list[Path]:
    """Return the tables of a corpus that `mine` wrote, sorted.

    Raises:
        InputError: there is none.
    """
    tables = sorted((corpus / "encounters").glob("*.parquet"))
    if not tables:
        raise InputError(
            f"{corpus} holds no encounters/*.parquet;"
            f" write it with `scenario-gen mine ARCHIVE --out {corpus}`"
        )
    return tables


def account_of(table: Path) -> list[dict[str, str]]:
    """Return a table's notes: name, cause and why of what is left out, and the quality of its log.

    Raises:
        InputError: the table is damaged.
    """
    from pyarrow import parquet

    with guarded(f"{table} cannot be read as a table"):
        text = (parquet.read_schema(table).metadata or {}).get(b"account", b"[]").decode()
    account: list[dict[str, str]] = parse_json(text, f"{table}: account", NOTES)
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
        return replace(decode_tracks(row["tracks"], row["name"]), origin=origin)
    except InputError as error:
        raise InputError(f"{table}: {error}") from error

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Basic safety messages (SAE J2735) in JSON, as the ODE of the US DOT and the pilots of Wyoming, Tampa and New York publish them.

| quantity | Wyoming, ODE | Tampa, newer ODE | New York (events) |
|---|---|---|---|
| time | metadata.recordGeneratedAt; coreData.secMark, ms of the minute | likewise | T_s, s from the event |
| vehicle | coreData.id | likewise | likewise |
| position | position.latitude, longitude, degrees | lat, long, 1e-7 degrees | X_m east, Y_m north |
| speed | speed, m/s | speed, 0.02 m/s; 8191: unknown | speed_mps |
| heading, clockwise from north | heading, degrees | heading, 0.0125 degrees; 28800: unknown | heading_deg |
| length, width | size, cm | likewise | likewise |

The tables of Wyoming and Tampa on data.transportation.gov have the same values, in columns such as coreData_position_lat.
Source: the samples and data dictionaries of the ITS JPO's sandbox. Messages stand one a line, in a list, or one after the other;
each event of New York has a clock and a frame of its own, and is read as `EVENT_S` later than the one before.
"""

from collections.abc import Iterator, Sequence
import csv
import json
import math
from pathlib import Path
import re
from typing import Any

import numpy as np
import pandas as pd

from scenario_gen.base.errors import guarded, InputError
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import check_size, RawLog, Segment
from scenario_gen.logs.tables import from_frame, LATEST_S

EVENT_S = 100.0  # from the beginning of an event of New York to that of the next
MINUTE_MS = 60_000
Row = dict[str, Any]


def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read files of messages that share a clock.

    Raises:
        InputError: a file is broken or too large, or a message lacks what is needed; names file and message.
    """
    rows: list[Row] = []
    segments = []
    for path in paths:
        check_size(str(path), path.stat().st_size, len(rows), config)
        segments.append(Segment(len(rows), str(path), "message", 1))
        for number, record in enumerate(_records(path)):
            with guarded(
                f"{path}, record {number + 1} is no basic safety message that is known",
                KeyError,
                TypeError,
                ValueError,
            ):
                rows += _rows_of(record, number)
            check_size(str(path), 0, len(rows), config)
    if not rows:
        raise InputError(f"{paths[0]} holds no messages")
    frame = pd.DataFrame(rows)
    if {"lat", "x"} <= set(frame.columns):
        raise InputError(f"{paths[0]} mixes latitude/longitude and x/y; read the files one by one")
    return from_frame(frame, paths, tuple(segments), config)


def _records(path: Path) -> Iterator[Any]:
    """Yield the documents of a file: one, several one after the other, or the entries of a list; or the rows of a table."""
    if path.suffix.lower() == ".csv":
        with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
            yield from map(_of_table, csv.DictReader(file))
        return
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    decoder, at = json.JSONDecoder(), 0
    while match := re.compile(r"[^\s,]").search(text, at):
        try:
            found, at = decoder.raw_decode(text, match.start())
        except (ValueError, RecursionError) as error:
            raise InputError(f"{path} is no JSON: {str(error)[:200]}; copy it again") from None
        yield from found if isinstance(found, list) else [found]


def _of_table(row: dict[str, str]) -> Row:
    """Return a row of a table as the document that it was made of."""
    found = {
        name.strip().lower(): text or None for name, text in row.items() if isinstance(name, str)
    }
    core: Row = {name: found.get(f"coredata_{name}") for name in ("id", "speed", "heading")}
    size, mark = found.get("coredata_size"), found.get("coredata_secmark")
    core |= {
        "size": json.loads(size) if size else {},
        "secMark": None if mark is None else float(mark),
    }
    lat, long = (
        float(found.get(f"coredata_position_{name}") or math.nan) for name in ("lat", "long")
    )
    if abs(lat) > 90.0:  # in the units of the messages
        core |= {
            "lat": lat,
            "long": long,
            "speed": core["speed"] or 8191,
            "heading": core["heading"] or 28800,
        }
    else:
        core["position"] = {"latitude": lat, "longitude": long}
    return {
        "metadata": {"recordGeneratedAt": found["metadata_generatedat"]},
        "payload": {"data": {"coreData": core}},
    }


def _rows_of(record: Any, number: int) -> list[Row]:
    """Return the rows of a document: a message, or the messages of an event."""
    if "bsmList" in record:
        cores = [entry["bsmRecord"]["bsmMsg"]["coreData"] for entry in record["bsmList"]]
        return [
            _row(
                core,
                core["T_s"] + number * EVENT_S,
                {"x": core["X_m"], "y": core["Y_m"]},
                core["speed_mps"],
                core["heading_deg"],
            )
            for core in cores
        ]
    data = record["payload"]["data"]
    core = (data.get("value", {}).get("BasicSafetyMessage") or data)["coreData"]
    seconds = _seconds(str(record["metadata"]["recordGeneratedAt"]), core.get("secMark"))
    if "lat" in core:
        speed, heading = float(core["speed"]), float(core["heading"])
        place = {"lat": float(core["lat"]) * 1e-7, "lon": float(core["long"]) * 1e-7}
        speed, heading = (
            math.nan if speed == 8191 else speed * 0.02,
            math.nan if heading == 28800 else heading * 0.0125,
        )
        return [_row(core, seconds, place, speed, heading)]
    place = {"lat": core["position"]["latitude"], "lon": core["position"]["longitude"]}
    return [_row(core, seconds, place, core.get("speed"), core.get("heading"))]


def _row(core: Any, seconds: float, place: Row, speed: Any, heading: Any) -> Row:
    size = core.get("size") or {}
    values = {
        **place,
        "speed": speed,
        "heading": heading,
        "length": size.get("length"),
        "width": size.get("width"),
    }
    row: Row = {
        name: math.nan if value is None else float(value) for name, value in values.items()
    }
    row["heading"] = math.pi / 2.0 - math.radians(row["heading"])
    row |= {name: row[name] * 0.01 or math.nan for name in ("length", "width")}  # 0: unknown
    known = math.isfinite(seconds) and abs(seconds) < LATEST_S
    return row | {
        "time": np.int64(round(seconds * 1e9)) if known else np.int64(0),
        "time_ok": known,
        "vehicle": str(core["id"]),
    }


def _seconds(generated: str, mark: Any) -> float:
    """Return the stamp [s since 1970] of a message whose record bears a date, perhaps of another zone, and ms of the minute."""
    date = pd.to_datetime(re.sub(r"\s*\[.*", "", generated), utc=True, errors="coerce")
    if pd.isna(date):
        return math.nan
    milliseconds = int(date.value) // 1_000_000
    if mark is not None and 0 <= int(mark) < 61_000:
        off = (int(mark) - milliseconds) % MINUTE_MS
        milliseconds += off - MINUTE_MS * (off > MINUTE_MS / 2)
    return milliseconds / 1000.0

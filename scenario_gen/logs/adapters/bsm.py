# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Basic safety messages (SAE J2735) in JSON, as published by the US DOT's ODE and pilots.

| quantity | Wyoming, ODE | Tampa, newer ODE | New York (events) |
|---|---|---|---|
| time | metadata.recordGeneratedAt; coreData.secMark, ms of the minute | the same | T_s, s |
| vehicle | coreData.id | the same | the same |
| position | position.latitude, longitude, degrees | lat, long, 1e-7 degrees | X_m, Y_m |
| speed | speed, m/s | speed, 0.02 m/s; 8191: unknown | speed_mps |
| heading | heading, degrees | heading, 0.0125 degrees; 28800: unknown | heading_deg |
| length, width | size, cm | the same | the same |

Headings are clockwise from north. If recordGeneratedAt is empty, odeReceivedAt has the date. The
tables of Wyoming and Tampa on data.transportation.gov have the same values, in columns such as
coreData_position_lat. A file has one message a line, a list, or messages one after the other. Each
event of New York has its own clock and frame, and is read 100 s later than the previous one.

Source: the samples and data dictionaries of the ITS JPO's sandbox.
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
from scenario_gen.logs.stamps import MAX_DATE_LENGTH_COUNT, MAX_STAMP_S
from scenario_gen.logs.tables import from_frame

_MINUTE_MS = 60_000
_MAX_SECOND_MARK_MS = 61_000  # a leap second
_NEXT_DOCUMENT = re.compile(r"[^\s,]")
_UNKNOWN_SPEED_CODE = 8191
_UNKNOWN_HEADING_CODE = 28800

Row = dict[str, Any]


def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read files of messages that share a clock.

    Raises:
        InputError: a file is damaged or too large, or a message is incomplete; names the message.
    """
    rows: list[Row] = []
    segments = []
    for path in paths:
        check_size(str(path), path.stat().st_size, len(rows), config)
        segments.append(Segment(len(rows), str(path), "message", 1))
        for number, record in enumerate(_records(path)):
            place = f"{path}, record {number + 1}"
            problem = f"{place} is not a known basic safety message"
            with guarded(problem, KeyError, TypeError, ValueError):
                rows += _rows_of(record, number)
            check_size(str(path), 0, len(rows), config)
    if not rows:
        raise InputError(f"{paths[0]} has no basic safety messages")
    frame = pd.DataFrame(rows)
    if {"lat", "x"} <= set(frame.columns):
        raise InputError(f"{paths[0]} mixes latitude/longitude and x/y; read the files separately")
    return from_frame(frame, paths, tuple(segments), config)


def _records(path: Path) -> Iterator[Any]:
    """Yield the documents in a file, or the rows of a table as documents."""
    if path.suffix.lower() == ".csv":
        with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
            yield from map(_document, csv.DictReader(file))
        return
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    decoder = json.JSONDecoder()
    match = _NEXT_DOCUMENT.search(text)
    while match:
        try:
            document, end = decoder.raw_decode(text, match.start())
        except (ValueError, RecursionError) as error:
            raise InputError(f"{path} is not JSON: {str(error)[:200]}; copy it again") from None
        yield from document if isinstance(document, list) else [document]
        match = _NEXT_DOCUMENT.search(text, end)


def _document(row: dict[str, str]) -> Row:
    """Return a row of a table as the message from which it was made."""
    fields = {
        name.strip().lower(): text or None for name, text in row.items() if isinstance(name, str)
    }
    size = fields.get("coredata_size")
    mark = fields.get("coredata_secmark")
    latitude = float(fields.get("coredata_position_lat") or math.nan)
    longitude = float(fields.get("coredata_position_long") or math.nan)
    core: Row = {
        "id": fields.get("coredata_id"),
        "speed": fields.get("coredata_speed"),
        "heading": fields.get("coredata_heading"),
        "size": json.loads(size) if size else {},
        "secMark": None if mark is None else float(mark),
    }
    if abs(latitude) > 90.0:  # in the units of the messages
        core["lat"] = latitude
        core["long"] = longitude
        core["speed"] = core["speed"] or _UNKNOWN_SPEED_CODE
        core["heading"] = core["heading"] or _UNKNOWN_HEADING_CODE
    else:
        core["position"] = {"latitude": latitude, "longitude": longitude}
    return {
        "metadata": {"recordGeneratedAt": fields["metadata_generatedat"]},
        "payload": {"data": {"coreData": core}},
    }


def _rows_of(record: Any, number: int) -> list[Row]:
    """Return the rows of a message, or of all messages of an event."""
    if "bsmList" in record:
        cores = [entry["bsmRecord"]["bsmMsg"]["coreData"] for entry in record["bsmList"]]
        return [_event_row(core, number) for core in cores]
    data = record["payload"]["data"]
    core = (data.get("value", {}).get("BasicSafetyMessage") or data)["coreData"]
    seconds = _stamp(record, core.get("secMark"))
    if "lat" in core:
        speed = float(core["speed"])
        heading = float(core["heading"])
        row = {
            "lat": float(core["lat"]) * 1e-7,
            "lon": float(core["long"]) * 1e-7,
            "speed": None if speed == _UNKNOWN_SPEED_CODE else speed * 0.02,  # m/s
            "heading": None if heading == _UNKNOWN_HEADING_CODE else heading * 0.0125,  # degrees
        }
    else:
        position = core["position"]
        row = {"lat": position["latitude"], "lon": position["longitude"]}
        row |= {"speed": core.get("speed"), "heading": core.get("heading")}
    return [_row(core, seconds, row)]


def _event_row(core: Any, number: int) -> Row:
    """Return the row of a message in an event of New York."""
    row = {
        "x": core["X_m"],
        "y": core["Y_m"],
        "speed": core["speed_mps"],
        "heading": core["heading_deg"],
    }
    seconds = core["T_s"] + number * 100.0  # events of New York start 100 s apart
    return _row(core, seconds, row)


def _row(core: Any, seconds: float, state: Row) -> Row:
    """Return the row of a message in our units; None and a size of 0 become NaN."""
    size = core.get("size") or {}
    row: Row = {name: math.nan if value is None else float(value) for name, value in state.items()}
    row["heading"] = math.pi / 2.0 - math.radians(row["heading"])
    for name in ("length", "width"):
        row[name] = float(size.get(name) or math.nan) * 0.01
    is_valid = math.isfinite(seconds) and abs(seconds) < MAX_STAMP_S
    row["time"] = np.int64(round(seconds * 1e9) if is_valid else 0)
    row["time_ok"] = is_valid
    row["vehicle"] = str(core["id"])
    return row


def _stamp(record: Any, second_mark: Any) -> float:
    """Return the stamp [s since 1970] by a record's date and the milliseconds of the minute."""
    metadata = record["metadata"]
    generated = str(metadata.get("recordGeneratedAt") or metadata["odeReceivedAt"])
    text = re.sub(r"\s*\[.*", "", generated[:MAX_DATE_LENGTH_COUNT])
    date = pd.to_datetime(text, utc=True, errors="coerce")
    if pd.isna(date):
        return math.nan
    milliseconds = int(date.value) // 1_000_000
    if second_mark is not None and 0 <= int(second_mark) < _MAX_SECOND_MARK_MS:
        half_minute = _MINUTE_MS // 2
        lead = (int(second_mark) - milliseconds + half_minute) % _MINUTE_MS - half_minute
        milliseconds += lead
    return milliseconds / 1000.0

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Trajectories of one vehicle a file: TUM, GPX and NMEA; the file names the vehicle.

| format | time | position | further |
|---|---|---|---|
| TUM | s | tx, ty [m] | a quaternion, from which the heading follows |
| GPX | `<time>` | lat, lon [degrees] of `<trkpt>` | several tracks are several vehicles |
| NMEA | RMC: hhmmss.ss and ddmmyy | degrees and minutes | speed in knots, course from north |

Sources: the TUM RGB-D benchmark's file formats; GPX 1.1; NMEA 0183, sentence RMC.
"""

from collections.abc import Iterator, Sequence
import math
from pathlib import Path

import numpy as np
import pandas as pd

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import read_xml
from scenario_gen.logs.column import Column
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.file_names import file_names
from scenario_gen.logs.raw import check_size, RawLog, Segment
from scenario_gen.logs.stamps import read_stamps, reals
from scenario_gen.logs.tables import from_frame, read_text, to_numbers

_TUM_COLUMNS = ["t", "x", "y", "z", "qx", "qy", "qz", "qw"]
_RMC_FIELDS_COUNT = 10  # to the date
_NMEA_QUANTITIES = {
    "time": Column("t", unit="hhmmss"),
    "date": Column("date"),
    "lat": Column("lat", minutes=True, unit="ddmm"),
    "lon": Column("lon", minutes=True, unit="ddmm"),
    "speed": Column("speed", 1852 / 3600, unit="kn"),
    "heading": Column("heading", math.pi / 180.0, clockwise=True, unit="north_deg"),
}


def read(paths: Sequence[Path], config: LogConfig, *, kind: str) -> RawLog:
    """Read files that share a clock.

    Args:
        paths: one or more files.
        config: bounds sizes.
        kind: tum, gpx or nmea.

    Raises:
        InputError: a file is damaged or too large, or has no trajectory.
    """
    readers = {"tum": _read_tum, "gpx": _read_gpx, "nmea": _read_nmea}
    frames: list[pd.DataFrame] = []
    segments = []
    n_rows = 0
    for path, name in zip(paths, file_names(paths), strict=True):
        check_size(str(path), path.stat().st_size, n_rows, config)
        frame = readers[kind](path, name, n_rows, config)
        if frame.empty:
            raise InputError(f"{path} has no trajectory in the format {kind}")
        frame["row"] = np.arange(n_rows, n_rows + len(frame))
        frames.append(frame)
        segments.append(Segment(n_rows, str(path), "position", 1))
        n_rows += len(frame)
        check_size(str(path), 0, n_rows, config)
    return from_frame(pd.concat(frames, ignore_index=True), paths, tuple(segments), config)


def _read_tum(path: Path, name: str, rows_before: int, config: LogConfig) -> pd.DataFrame:
    """Return positions and headings of a file with eight numbers a line."""
    options = {"sep": r"\s+", "header": None, "names": _TUM_COLUMNS, "comment": "#"}
    table = read_text(path, rows_before, config, **options)
    columns = {"time": Column("t", unit="s"), "x": Column("x"), "y": Column("y")}
    frame = to_numbers(table, columns, path)
    qx, qy, qz, qw = (reals(table[part]) for part in _TUM_COLUMNS[4:])
    frame["heading"] = np.arctan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy**2 + qz**2))
    return frame.assign(vehicle=name)


def _read_gpx(path: Path, name: str, _: int, __: LogConfig) -> pd.DataFrame:
    """Return the points of all tracks of a file."""
    tracks = read_xml(path, str(path)).findall("trk")
    rows = []
    for number, track in enumerate(tracks, 1):
        vehicle = name if len(tracks) == 1 else f"{name}_{number}"
        for point in track.findall("trkseg/trkpt"):
            time = point.find("time")
            text = "" if time is None else time.content
            rows.append((vehicle, point.number("lat"), point.number("lon"), text))
    frame = pd.DataFrame(rows, columns=pd.Index(["vehicle", "lat", "lon", "t"]))
    if not frame.empty:
        place = f"{path}, <time> of its points"
        frame["time"], frame["time_ok"] = read_stamps(frame.pop("t"), Column("time"), None, place)
    return frame


def _read_nmea(path: Path, name: str, _: int, __: LogConfig) -> pd.DataFrame:
    """Return the valid fixes of the RMC sentences of a file."""
    fields = ["t", "lat", "ns", "lon", "ew", "speed", "heading", "date"]
    table = pd.DataFrame(_sentences(path), columns=pd.Index(fields))
    if table.empty:
        return table
    frame = to_numbers(table.apply(_numbers), _NMEA_QUANTITIES, path)
    frame["lat"] *= np.where(table["ns"] == "S", -1.0, 1.0)
    frame["lon"] *= np.where(table["ew"] == "W", -1.0, 1.0)
    return frame.assign(vehicle=name)


def _numbers(column: "pd.Series[str]") -> "pd.Series[float] | pd.Series[str]":
    return column if column.name == "date" else pd.to_numeric(column, errors="coerce")


def _sentences(path: Path) -> Iterator[list[str]]:
    """Yield time, position, speed, course and date of the valid RMC sentences of a file."""
    with path.open(encoding="ascii", errors="replace") as file:
        for line in file:
            fields = line.partition("$")[2].partition("*")[0].split(",")
            is_valid = len(fields) >= _RMC_FIELDS_COUNT and fields[2] == "A"
            if is_valid and fields[0].endswith("RMC"):
                yield [fields[1], *fields[3:10]]

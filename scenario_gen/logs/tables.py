# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tables: CSV or Parquet with named columns, and headerless SPMD files.

SPMD is the Safety Pilot Model Deployment.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
import math
from pathlib import Path
import re
from typing import Any

import numpy as np
import pandas as pd

from scenario_gen.base.errors import guarded, InputError, needs
from scenario_gen.logs.column import Column, normalized
from scenario_gen.logs.columns import (
    column_notes,
    find_columns,
    MAX_LISTED_COUNT,
    point_of,
)
from scenario_gen.logs.config import LogConfig, POINTS
from scenario_gen.logs.kinds import MAX_LENGTH_M
from scenario_gen.logs.raw import (
    check_size,
    check_vehicles,
    Observations,
    RawLog,
    Segment,
    UnknownFormatError,
)
from scenario_gen.logs.signals import RawSignal, signals_of_table
from scenario_gen.logs.stamps import read_stamps, reals
from scenario_gen.logs.table_parts import (
    apart_by_scene,
    named_by_file,
    tracks_of,
    with_hemispheres,
)
from scenario_gen.logs.text import Layout, layout_of, READ_OPTIONS
from scenario_gen.numerics import Floats

SPMD_EPOCH_NS = 1_072_915_200 * 10**9
"""2004-01-01 UTC in Unix time, from which Gentime of SPMD counts microseconds."""

_PARQUET_SUFFIXES = (".parquet", ".pq")
_FEW_ROW_COUNT = 10  # each of them may belong to another vehicle
_NO_TRAILER = frozenset(("", "0", "False", "false", "no", "none"))
_SECONDS = re.compile(r"(.*?)secs?", re.IGNORECASE)
_NANOSECONDS = re.compile(r".*n(?:ano)?_?secs?", re.IGNORECASE)
_NOT_VALID = frozenset(
    ("false", "no", "invalid", "lost", "bad", "error", "none", "void", "v", "n")
)  # V is void, as of NMEA


@dataclass(frozen=True, eq=False)
class Table:
    """A table in our units.

    Attributes:
        path: its file.
        frame: its rows.
        columns: by quantity.
        header_lines: number of lines above its first row.
        separators: further columns that tell apart rows of one vehicle with the same stamp.
    """

    path: Path
    frame: pd.DataFrame
    columns: dict[str, Column]
    header_lines: int
    separators: list[str]


def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read tables that share a clock as one log: CSV (also with tabs or semicolons) or Parquet.

    Args:
        paths: one or more files.
        config: names columns, and bounds sizes.

    Raises:
        InputError: a file is damaged or too large, or a column is missing or unsuitable.
    """
    notes: list[str] = []
    tables = list(_read_tables(paths, config, notes))
    frames = [table.frame for table in tables]
    if len({"lat" in frame for frame in frames}) > 1:
        raise InputError(
            f"{paths[0]} and the other files mix latitude/longitude and x/y; read them separately"
        )
    columns = tables[-1].columns
    if columns["time"].is_gentime:
        columns = {}  # units are those of SPMD
    else:
        notes += named_by_file(frames, [table.path for table in tables])
    segments = [segment_of(t.path, int(t.frame["row"].iloc[0]), t.header_lines) for t in tables]
    log = from_frame(pd.concat(frames, ignore_index=True), paths, tuple(segments), config)
    point = point_of(columns)
    if point and "point=" not in config.columns:
        vehicles = (replace(vehicle, ahead=POINTS[point]) for vehicle in log.vehicles)
        log = replace(log, vehicles=tuple(vehicles))
        notes.append(f"positions are those of the point {point}, by the names of their columns")
    separators = dict.fromkeys(name for table in tables for name in table.separators)
    notes = [*dict.fromkeys(notes), *log.notes]
    return replace(log, notes=tuple(notes), columns=columns, separators=tuple(separators))


def _read_tables(paths: Sequence[Path], config: LogConfig, notes: list[str]) -> Iterator[Table]:
    """Yield the tables; notes, also on files that are no tables, are appended.

    Raises:
        InputError: as `read`.
    """
    n_bytes = n_rows = 0
    for path in paths:
        n_bytes += path.stat().st_size
        check_size(str(path), n_bytes, n_rows, config)
        try:
            table = read_table(path, n_rows, config, notes)
        except UnknownFormatError as error:
            if path == paths[-1] and not n_rows:
                raise
            notes.append(f"not read: {error}")
            continue
        n_rows += len(table.frame)
        yield table


def read_table(path: Path, rows_before: int, config: LogConfig, notes: list[str]) -> Table:
    """Read the needed columns of one table in our units.

    Args:
        path: the table.
        rows_before: number of rows from other files.
        config: names columns, and bounds sizes.
        notes: notes on the table are appended.

    Raises:
        InputError: as `read`, or stamps repeat and no column names the vehicle.
    """
    layout = Layout()
    if path.suffix.lower() in _PARQUET_SUFFIXES:
        needs("parquet", "pyarrow")
        from scenario_gen.logs import parquet

        frame, columns, header = parquet.read_columns(path, rows_before, config)
    else:
        layout = layout_of(path)
        notes += layout.notes
        frame, columns, header = _read_text_columns(path, layout, rows_before, config)
    _ignore_unknown_numbers(frame, columns, notes)
    if layout.above >= 0:
        notes += column_notes(columns, config.columns, header)
    numbers = to_numbers(frame, columns, path)
    if columns["time"].is_gentime:
        numbers["time"] += SPMD_EPOCH_NS
    if "vehicle=none" not in config.columns.replace(" ", ""):
        _check_vehicle_column(frame, columns, numbers, path)
    separators = _separating_columns(frame, columns, numbers)
    if "vehicle" not in numbers:
        numbers["vehicle"] = path.stem
    numbers["row"] = rows_before + np.arange(len(numbers))
    return Table(path, numbers, columns, layout.above + 1, separators)


def _read_text_columns(
    path: Path, layout: Layout, rows_before: int, config: LogConfig
) -> tuple[pd.DataFrame, dict[str, Column], list[str]]:
    """Return a text table, its columns by quantity, and its header."""
    options: dict[str, Any] = {
        "encoding": layout.encoding,
        "sep": layout.separator,
        "decimal": layout.decimal,
        "skiprows": layout.above,
    }
    if layout.names:
        options |= {"skiprows": layout.above + 1, "names": list(layout.names), "header": None}
    header = [str(name) for name in read_text(path, rows_before, config, **options, nrows=0)]
    seconds = _seconds_and_nanoseconds(header)
    is_split = bool(seconds) and "time=" not in config.columns
    option = f"{config.columns},time={seconds[0]}:ns" if is_split else config.columns
    columns = find_columns(header, path, option)
    # Numbers of 64 bits, or in hexadecimal, are not float64.
    texts = ("vehicle", "kind", "subkind", "trailer", "scene", "date", "signal", "signal_id")
    names = [columns[quantity].name for quantity in texts if quantity in columns]
    options["dtype"] = dict.fromkeys(names, object)
    frame = read_text(path, rows_before, config, **options)
    if is_split:
        whole, part = (frame[name] for name in seconds)
        frame[seconds[0]] = whole * 10**9 + part
    return with_hemispheres(frame, columns), columns, header


def _seconds_and_nanoseconds(header: Sequence[str]) -> list[str]:
    """Return the columns of a stamp's seconds and nanoseconds, as bags write them, or none."""
    for name in header:
        match = _SECONDS.fullmatch(name)
        rest = [other for other in header if match and other.startswith(match[1])]
        nanoseconds = [other for other in rest if _NANOSECONDS.fullmatch(other)]
        if nanoseconds:
            return [name, nanoseconds[0]]
    return []


def _ignore_unknown_numbers(
    frame: pd.DataFrame, columns: dict[str, Column], notes: list[str]
) -> None:
    """Remove the column of kinds if it has numbers of unknown meaning, with a note."""
    if "kind" not in columns or columns["kind"].types:
        return
    name = columns["kind"].name
    kinds = sorted(reals(frame[name]).dropna().unique())
    if kinds:
        del columns["kind"]
        examples = ", ".join(f"{kind:g}" for kind in kinds[:MAX_LISTED_COUNT])
        notes.append(
            f"column {name} has numbers ({examples}) of unknown meaning: types are guessed from "
            f"the sizes; name them with, say, --set log.columns=kind={name}:car1+truck2"
        )


def _check_vehicle_column(
    frame: pd.DataFrame, columns: dict[str, Column], numbers: pd.DataFrame, path: Path
) -> None:
    """Check that the column for the vehicle does not number the rows, and is not missing.

    Raises:
        InputError: most stamps repeat, or each row has another vehicle; names possible columns.
    """
    time = numbers["time"]
    if "vehicle" not in columns:
        is_plausible = time.nunique() > len(time) / 2 + 1
        fault = "several rows have the same time, and no column names the vehicle"
    else:
        is_plausible = len(time) < _FEW_ROW_COUNT or numbers["vehicle"].nunique() < len(time)
        name = columns["vehicle"].name
        fault = f"column {name!r} differs in each row, so it does not name the vehicle"
    if is_plausible:
        return
    used = {column.name for column in columns.values()}
    candidates = [
        str(name)
        for name in frame.columns
        if name not in used and _may_name_vehicles(frame[name], time)
    ]
    remedy = "add a column `id`"
    if candidates:
        remedy = (
            f"it could be {' or '.join(candidates)}: --set log.columns=vehicle={candidates[0]}"
        )
    raise InputError(f"{path}: {fault}; {remedy}")


def _separating_columns(
    frame: pd.DataFrame, columns: dict[str, Column], numbers: pd.DataFrame
) -> list[str]:
    """Return the unused columns that tell apart rows of one vehicle with the same stamp."""
    if "vehicle" not in numbers or not numbers.duplicated(["time", "vehicle"]).any():
        return []
    used = {column.name for column in columns.values()}
    return [
        str(name)
        for name in frame.columns
        if name not in used
        and 2 <= frame[name].nunique() <= len(frame) / _FEW_ROW_COUNT
        and not numbers.assign(part=frame[name]).duplicated(["time", "vehicle", "part"]).any()
    ]


def _may_name_vehicles(values: "pd.Series[Any]", time: "pd.Series[int]") -> bool:
    """Return whether values repeat, but never twice at one time."""
    if not 2 <= values.nunique() <= len(values) / 2:
        return False
    return not pd.DataFrame({"time": time, "vehicle": values}).duplicated().any()


def segment_of(path: Path, first_row: int, header_lines: int = 1) -> Segment:
    """Return the place of a file's rows, the first of which is `first_row` of the log."""
    if path.suffix.lower() in _PARQUET_SUFFIXES:
        return Segment(first_row, str(path), "row", 1)
    return Segment(first_row, str(path), "line", 1 + header_lines)


def read_text(path: Path, rows_before: int, config: LogConfig, **options: Any) -> pd.DataFrame:
    """Read a text table with pandas.

    Args:
        path: the table.
        rows_before: number of rows from other files.
        config: bounds the number of rows.
        options: those of `pandas.read_csv`.

    Raises:
        InputError: it is not a table, or too large.
    """
    options = {"encoding": "utf-8-sig", "nrows": config.row_limit - rows_before + 1, **options}
    with guarded(f"{path} cannot be read as a table"):
        try:
            frame = pd.read_csv(path, **READ_OPTIONS, **options)
        except UnicodeDecodeError as error:
            raise InputError(
                f"{path} is not UTF-8 text (byte {error.start}); save it as UTF-8"
            ) from error
    check_size(str(path), 0, rows_before + len(frame), config)
    if frame.empty and options["nrows"]:
        raise InputError(f"{path} has a header but no rows")
    if not isinstance(frame.index, pd.RangeIndex):
        raise InputError(
            f"{path}: the rows have more fields than the header; name every column, and write "
            "0.5, not 0,5"
        )
    return frame


def to_numbers(frame: pd.DataFrame, columns: dict[str, Column], path: Path) -> pd.DataFrame:
    """Return the columns in our units, stamps in nanoseconds; texts that are not numbers are NaN.

    Raises:
        InputError: a column does not suit its quantity.
    """
    numbers = pd.DataFrame(index=frame.index)
    for quantity, column in columns.items():
        values = frame[column.name]
        place = f"{path}, column {column.name!r} ({quantity})"
        if isinstance(values, pd.DataFrame):
            raise InputError(f"{path} has several columns {column.name!r}; rename all but one")
        if quantity in ("vehicle", "scene", "trailer"):
            numbers[quantity] = vehicle_names(values)
        elif quantity == "valid":
            numbers[quantity] = _are_valid(values, column)
        elif quantity in ("kind", "subkind", "signal", "signal_id"):
            numbers[quantity] = _words(values, column)
        elif pd.api.types.is_bool_dtype(values):
            raise InputError(f"{place}: true or false is not a {quantity}; name another column")
        elif quantity == "time":
            dates = frame[columns["date"].name] if "date" in columns else None
            numbers["time"], numbers["time_ok"] = read_stamps(values, column, dates, place)
        elif quantity != "date":
            numbers[quantity] = _in_our_unit(reals(values), column)
    return _with_directions(numbers)


def _with_directions(numbers: pd.DataFrame) -> pd.DataFrame:
    """Return a table with the directions of its velocities, and their speeds if it has none."""
    if not {"vx", "vy"} <= set(numbers):
        return numbers
    speed = np.hypot(numbers["vx"], numbers["vy"])
    course = np.arctan2(numbers["vy"], numbers["vx"]).where(speed > 0.0)
    return numbers.assign(course=course, speed=numbers.get("speed", speed))


def _are_valid(values: "pd.Series[Any]", column: Column) -> "pd.Series[bool]":
    """Return which rows count: not those that are marked as false, void or without a fix."""
    words = values.astype(str).str.strip().str.lower()
    numbers = reals(words)
    limit = 0.0 if normalized(column.name) == "status" else 1.0  # NavSatStatus: -1 is no fix
    return ~(words.isin(_NOT_VALID) | (numbers < limit)).astype(bool)


def _words(values: "pd.Series[Any]", column: Column) -> "pd.Series[Any]":
    """Return what a table calls the types of its road users, or its lights and their states."""
    words = values.astype(str).where(values.notna(), "")
    if not column.types:
        return words
    return reals(values).map(dict(column.types)).fillna("unnamed " + words)


def _in_our_unit(values: "pd.Series[float]", column: Column) -> "pd.Series[float]":
    """Return values in metres, m/s, degrees (lat, lon), or radians counter-clockwise from east."""
    if column.minutes:
        degrees = np.trunc(values / 100.0)
        values = degrees + (values - 100.0 * degrees) / 60.0
    values = values * abs(column.factor)
    if column.clockwise:
        values = math.pi / 2.0 - values
    return math.copysign(1.0, column.factor) * values


def vehicle_name(value: Any) -> str:
    """Return a vehicle's name as text: 17, 17.0 and "17" are the same vehicle."""
    if pd.isna(value):
        return ""
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return str(value).strip()


def vehicle_names(values: "pd.Series[Any]") -> "pd.Series[Any]":
    """Return vehicles' names as categories; if all are whole numbers, 017 and 17.0 are 17, too."""
    codes, different = pd.factorize(values)  # the code -1, of missing names, is that of the last
    unique = pd.Series([*map(vehicle_name, different), ""], dtype=object)
    if (unique.str.fullmatch(r"\d{1,300}(\.0*)?") | (unique == "")).all():
        unique = unique.map(lambda name: name and str(int(name.partition(".")[0])))
    code_of_unique, names = pd.factorize(unique)
    return pd.Series(pd.Categorical.from_codes(code_of_unique[codes], names), index=values.index)


def from_frame(
    frame: pd.DataFrame, paths: Sequence[Path], segments: tuple[Segment, ...], config: LogConfig
) -> RawLog:
    """Return a table in our units as a log, grouped by vehicle.

    Raises:
        InputError: there are too many vehicles.
    """
    check_vehicles(str(paths[0]), frame["vehicle"].nunique(), config)
    if "row" not in frame:
        frame = frame.assign(row=np.arange(len(frame)))
    is_valid = frame.get("valid", True)
    is_usable = frame["time_ok"] & (frame["vehicle"] != "") & is_valid
    unusable = frame[~is_usable]
    position = ("lat", "lon") if "lat" in frame else ("x", "y")
    usable, notes = apart_by_scene(frame if unusable.empty else frame[is_usable])
    keys = ["scene", "vehicle"] if "scene" in usable else ["vehicle"]
    vehicles = tuple(
        _observations(str(names[-1]), track, position)
        for names, group in usable.groupby(keys, sort=False)
        for track in tracks_of(group)
    )
    signals: list[RawSignal] = []
    if "signal" in usable and config.signals == "recorded":
        signals, signal_notes = signals_of_table(usable, segments[0].label)
        notes = [*notes, *signal_notes]
    return RawLog(
        name=paths[0].stem if len(paths) == 1 else paths[0].resolve().parent.name,
        geographic="lat" in frame,
        vehicles=vehicles,
        rows=len(frame),
        segments=segments,
        notes=tuple(notes),
        signals=tuple(signals),
        dropped=tuple(
            (_why_unusable(name, is_ok), int(row))
            for name, is_ok, row in zip(
                unusable["vehicle"], unusable["time_ok"], unusable["row"], strict=True
            )
        ),
    )


def _why_unusable(vehicle: str, is_timed: bool) -> str:
    """Return why a row is left out."""
    if not is_timed:
        return "stamp is not a number"
    return "marked as not valid" if vehicle else "no vehicle"


def _observations(name: str, group: pd.DataFrame, position: tuple[str, str]) -> Observations:
    """Return the rows of one vehicle as observations."""

    def column(quantity: str) -> Floats:
        if quantity not in group:
            return np.full(len(group), np.nan)
        values: Floats = group[quantity].to_numpy(float)
        return values

    observed = Observations.of_rows(
        name,
        group["time"].to_numpy(np.int64),
        np.column_stack([column(quantity) for quantity in (*position, "heading", "speed")]),
        group["row"].to_numpy(np.int64),
        (_typical_size(column("length")), _typical_size(column("width"))),
        kind=str(group["kind"].fillna("").mode().iloc[0]) if "kind" in group else "",
        measured="speed" in group,
    )
    if "height" in group:
        observed = replace(observed, height=column("height"))
    if "course" in group:
        observed = replace(observed, course=column("course"))
    if "ego_x" in group:
        pose = np.column_stack([column(f"ego_{axis}") for axis in ("x", "y", "heading")])
        observed = replace(observed, ego=pose)
    trailers = set(group["trailer"]) - _NO_TRAILER if "trailer" in group else set()
    return replace(observed, trailer_name=str(min(trailers, default="")))


def _typical_size(values: Floats) -> float:
    """Return the median of possible sizes [m], or of all if none is possible, or NaN."""
    values = values[np.isfinite(values)]
    possible = values[(values > 0.0) & (values < MAX_LENGTH_M)]
    if len(possible):
        return float(np.median(possible))
    return float(np.median(values)) if len(values) else math.nan

# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Plain tables: CSV or Parquet with named columns, units by their suffix."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from pathlib import Path

import numpy as np
import pandas as pd

from scenario_gen.arrays import Floats, Ints
from scenario_gen.errors import InputError
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import Observations, RawLog, Segment

# Names a quantity goes by, the preferred one first; a clock that all files share is preferred to one that starts with the file.
NAMES: dict[str, tuple[str, ...]] = {
    "time": ("utc", "stamp", "unix", "gentime", "clock", "t", "time", "timestamp", "global_time"),
    "vehicle": ("vehicle", "vehicle_id", "vehicle_name", "txdevice", "track_id", "id", "name", "agent_id", "object_id"),
    "lat": ("lat", "latitude"),
    "lon": ("lon", "lng", "longitude"),
    "x": ("x", "e", "east", "easting", "pos_x", "position_x"),
    "y": ("y", "n", "north", "northing", "pos_y", "position_y"),
    "speed": ("speed", "v", "velocity", "vel"),
    "heading": ("heading", "yaw", "theta", "course", "bearing"),
    "length": ("length", "len", "vehicle_length"),
    "width": ("width", "vehicle_width"),
}
# Factor to seconds, metres, m/s, radians or degrees (positions); a name without a suffix has the first unit.
UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "sec": 1.0, "ns": 1e-9, "us": 1e-6, "ms": 1e-3},
    "vehicle": {},
    "lat": {"deg": 1.0, "rad": math.degrees(1.0)},
    "lon": {"deg": 1.0, "rad": math.degrees(1.0)},
    "x": {"m": 1.0, "km": 1e3, "ft": 0.3048, "cm": 0.01},
    "y": {"m": 1.0, "km": 1e3, "ft": 0.3048, "cm": 0.01},
    "speed": {
        "mps": 1.0,
        "ms": 1.0,
        "m_s": 1.0,
        "kmh": 1 / 3.6,
        "kph": 1 / 3.6,
        "mph": 0.44704,
        "kn": 1852 / 3600,
        "fps": 0.3048,
    },
    "heading": {"rad": 1.0, "deg": math.pi / 180.0, "north_deg": math.nan, "cw_deg": math.nan},
    "length": {"m": 1.0, "ft": 0.3048, "cm": 0.01, "mm": 0.001},
    "width": {"m": 1.0, "ft": 0.3048, "cm": 0.01, "mm": 0.001},
}
CLOCKWISE = ("course", "bearing")  # by convention degrees clockwise from north


@dataclass(frozen=True)
class Column:
    """A column of the table, the factor to our unit, and whether it is a heading clockwise from north."""

    name: str
    factor: float
    clockwise: bool = False


def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read tables that share a clock as one log: CSV (also with tabs or semicolons) or Parquet, with a header."""
    frames, segments, row = [], [], 0
    for path in paths:
        frame = read_frame(path)
        columns = find_columns(frame, path, config.columns)
        frames.append(to_numbers(frame, columns))
        parquet = path.suffix.lower() in (".parquet", ".pq")
        segments.append(Segment(row, str(path), "row" if parquet else "line", 1 if parquet else 2))
        row += len(frame)
    if len({"lat" in frame for frame in frames}) > 1:
        raise InputError(f"{paths[0]} and the files beside it mix latitude/longitude and x/y; read them one by one")
    return from_frame(pd.concat(frames, ignore_index=True), paths, tuple(segments))


def read_frame(path: Path) -> pd.DataFrame:
    """Read a table with pandas; its errors become ours."""
    try:
        if path.suffix.lower() in (".parquet", ".pq"):
            frame = pd.read_parquet(path)
        else:
            with path.open(encoding="utf-8-sig") as file:
                header = file.readline()
            separator = max(",;\t", key=header.count)
            frame = pd.read_csv(path, sep=separator, skipinitialspace=True, encoding="utf-8-sig", skip_blank_lines=False)
    except pd.errors.EmptyDataError as error:
        raise InputError(f"{path} is empty; a table needs a header line and rows") from error
    except pd.errors.ParserError as error:
        raise InputError(f"{path} is not a well-formed table: {str(error).strip()}") from error
    except (OSError, ValueError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read as a table: {str(error).strip()}") from error
    if frame.empty:
        raise InputError(f"{path} has a header but no rows")
    return frame


def find_columns(frame: pd.DataFrame, path: Path, option: str) -> dict[str, Column]:
    """Return which column holds which quantity, by option first and by name otherwise.

    Raises:
        InputError: a needed column is missing, or the option names one that is not there.
    """
    names = {str(name).strip().lower(): str(name) for name in frame.columns}
    found: dict[str, Column] = {}
    without: set[str] = set()
    for part in filter(None, (p.strip() for p in option.split(","))):
        quantity, _, name = (p.strip() for p in part.partition("="))
        if quantity not in NAMES:
            raise InputError(f"parameter columns: {quantity!r} is none of {', '.join(NAMES)} (write quantity=column, …)")
        if name == "none":
            without.add(quantity)
            continue
        name, _, unit = (name, "", "") if name.lower() in names else name.rpartition(":")
        if name.lower() not in names:
            asked = part.partition("=")[2].strip()
            raise InputError(f"{path} has no column {asked!r} (asked for as {quantity}); it has {', '.join(names.values())}")
        if unit and unit not in UNITS[quantity]:
            raise InputError(f"parameter columns: {quantity} has no unit {unit!r}; choose one of {', '.join(UNITS[quantity])}")
        found[quantity] = as_column(quantity, names[name.lower()], unit)
    for quantity, aliases in NAMES.items():
        if quantity not in found and quantity not in without:
            candidates = [
                candidate for alias in aliases for candidate in (alias, *(f"{alias}_{unit}" for unit in UNITS[quantity]))
            ]
            match = next((names[candidate] for candidate in candidates if candidate in names), None)
            if match is not None:
                found[quantity] = as_column(quantity, match)
    if (
        found.get("time", Column("", 1.0)).name.strip().lower() == "gentime" and "heading" in found
    ):  # basic safety messages with a header
        found["heading"] = Column(found["heading"].name, math.pi / 180.0, clockwise=True)
    return complete(found, without, path, names)


def complete(found: dict[str, Column], without: set[str], path: Path, names: dict[str, str]) -> dict[str, Column]:
    """Check that all needed columns are there; latitude and longitude win over x and y."""
    if "lat" in found and "lon" in found:
        found = {quantity: column for quantity, column in found.items() if quantity not in ("x", "y")}
    elif "x" in found and "y" in found:
        found = {quantity: column for quantity, column in found.items() if quantity not in ("lat", "lon")}
    else:
        raise InputError(missing("position (lat and lon, or x and y)", "x=…,y=…", path, names))
    for quantity in ("time", "speed"):
        if quantity not in found and quantity not in without:
            hint = f"{quantity}=…" + (" or speed=none to take it from the positions" if quantity == "speed" else "")
            raise InputError(missing(quantity, hint, path, names))
    return found


def missing(quantity: str, hint: str, path: Path, names: dict[str, str]) -> str:
    """Say which column is missing and what to do."""
    return f"{path} has no column for {quantity}; it has {', '.join(names.values())}. Name it with the parameter columns, {hint}"


def as_column(quantity: str, name: str, unit: str = "") -> Column:
    """Return the column with the unit given, or else the one that its suffix says."""
    lower = name.strip().lower()
    unit = unit or max((unit for unit in UNITS[quantity] if lower.endswith("_" + unit)), key=len, default="")
    if quantity == "heading":
        base = lower.removesuffix("_" + unit)
        if unit in ("north_deg", "cw_deg") or base in CLOCKWISE:
            return Column(name, 1.0 if unit == "rad" else math.pi / 180.0, clockwise=True)
        return Column(name, UNITS["heading"].get(unit, 1.0))
    if quantity == "time" and not unit and lower == "gentime":
        return Column(name, 1e-6)
    return Column(name, UNITS[quantity].get(unit, 1.0))


def to_numbers(frame: pd.DataFrame, columns: dict[str, Column]) -> pd.DataFrame:
    """Return the needed columns in our units; what is not a number becomes NaN. Stamps become integer nanoseconds."""
    out = pd.DataFrame(index=frame.index)
    for quantity, column in columns.items():
        values = frame[column.name]
        if quantity == "vehicle":
            out["vehicle"] = values.map(vehicle_name)
        elif quantity == "time":
            out["time"], out["time_ok"] = nanoseconds(values, column.factor)
        else:
            numbers = pd.to_numeric(values, errors="coerce").astype(float) * column.factor
            out[quantity] = (math.pi / 2.0 - numbers) if column.clockwise else numbers
    if "vehicle" not in out:
        out["vehicle"] = "0"
    return out


def vehicle_name(value: object) -> str:
    """A vehicle's name as text: 17, 17.0 and "17" are the same vehicle."""
    if isinstance(value, float):
        if math.isnan(value):
            return ""
        if value.is_integer():
            return str(int(value))
    return str(value).strip()


def nanoseconds(values: "pd.Series[object]", factor: float) -> tuple["pd.Series[int]", "pd.Series[bool]"]:
    """Stamps as integer nanoseconds, and which of them are numbers (or dates)."""
    if pd.api.types.is_integer_dtype(values):
        return values.astype(np.int64) * round(factor * 1e9), pd.Series(True, index=values.index)
    if pd.api.types.is_datetime64_any_dtype(values):
        return values.astype("datetime64[ns]").astype(np.int64), values.notna()
    numbers = pd.to_numeric(values, errors="coerce")
    if numbers.isna().all():
        dates = pd.to_datetime(values, errors="coerce", utc=True, format="ISO8601")
        known = dates.notna()
        return dates.fillna(pd.Timestamp(0, tz="UTC")).astype("datetime64[ns, UTC]").astype(np.int64), known
    known = numbers.notna() & np.isfinite(numbers) & (numbers.abs() * factor < 9e9)
    return (numbers.where(known, 0.0) * (factor * 1e9)).round().astype(np.int64), known


def from_frame(frame: pd.DataFrame, paths: Sequence[Path], segments: tuple[Segment, ...]) -> RawLog:
    """Group a table in our units by vehicle."""
    geographic = "lat" in frame
    usable = frame["time_ok"].to_numpy() & (frame["vehicle"] != "").to_numpy()
    rows = np.arange(len(frame))
    reason = np.where(frame["time_ok"].to_numpy(), "no vehicle", "stamp is not a number")
    dropped = tuple((str(why), int(row)) for why, row in zip(reason[~usable], rows[~usable], strict=True))
    position = ("lat", "lon") if geographic else ("x", "y")
    vehicles = []
    frame = frame.assign(row=rows)[usable]
    for name, group in frame.groupby("vehicle", sort=False):
        vehicles.append(observations(str(name), group, position))
    name = paths[0].stem if len(paths) == 1 else paths[0].parent.name
    return RawLog(name, geographic, tuple(vehicles), len(rows), segments, dropped=dropped)


def observations(name: str, group: pd.DataFrame, position: tuple[str, str]) -> Observations:
    """One vehicle's rows as observations; a row is both a fix and a speed."""

    def column(quantity: str) -> Floats:
        return group[quantity].to_numpy(float) if quantity in group else np.full(len(group), np.nan)

    def median(quantity: str) -> float:
        values = column(quantity)
        values = values[np.isfinite(values) & (values > 0.0)]
        return float(np.median(values)) if len(values) else math.nan

    stamps: Ints = group["time"].to_numpy(np.int64)
    rows: Ints = group["row"].to_numpy(np.int64)
    measured = slice(None) if "speed" in group else slice(0, 0)
    return Observations(
        id=name,
        fix_ns=stamps,
        fix=np.column_stack([column(position[0]), column(position[1])]),
        fix_row=rows,
        heading=column("heading"),
        speed_ns=stamps[measured],
        speed=column("speed")[measured],
        speed_row=rows[measured],
        length=median("length"),
        width=median("width"),
    )

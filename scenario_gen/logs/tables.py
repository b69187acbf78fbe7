# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tables: CSV or Parquet with named columns, and the headerless files of the Safety Pilot Model Deployment (SPMD)."""

from collections.abc import Sequence
from dataclasses import replace
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from scenario_gen.base.documents import shown
from scenario_gen.base.errors import guarded, InputError, needs
from scenario_gen.logs.cleaning import CLEANING
from scenario_gen.logs.columns import Column, find_columns, notes_on, SHOWN, UNITS
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import check_size, check_vehicles, Observations, RawLog, Segment
from scenario_gen.logs.text import layout_of
from scenario_gen.numerics import Floats, Ints

PARQUET = (".parquet", ".pq")
LATEST_S = 9e9  # s from 1970 that a stamp in 64 bits of nanoseconds can be
NOW = 3e8, 4e9  # s since 1970: from 1979 to 2096
FEW_ROWS = 10  # of which each may be of a vehicle of its own
STILL_M = 0.05  # that no vehicle of an encounter drives
LONGEST_NUMBER = 300  # characters
EPOCH_NS = (
    1_072_915_200 * 10**9
)  # 2004-01-01 UTC in Unix time; Gentime of SPMD counts microseconds from there
COLUMNS = (  # of a basic safety message in the files of the Safety Pilot Model Deployment
    *(
        "RxDevice",
        "FileId",
        "TxDevice",
        "Gentime",
        "TxRandom",
        "MsgCount",
        "DSecond",
        "Latitude",
        "Longitude",
        "Elevation",
    ),
    *("Speed", "Heading", "Ax", "Ay", "Az", "Yawrate", "PathCount", "RadiusOfCurve", "Confidence"),
)
QUANTITIES = {
    "vehicle": Column("TxDevice"),
    "lat": Column("Latitude"),
    "lon": Column("Longitude"),
    "speed": Column("Speed"),
    "heading": Column("Heading", math.pi / 180.0, clockwise=True),
}


def read(paths: Sequence[Path], config: LogConfig, *, spmd: bool = False) -> RawLog:
    """Read tables that share a clock as one log: CSV (also with tabs or semicolons) or Parquet.

    Args:
        paths: one or more files.
        config: names columns, and bounds sizes.
        spmd: they are SPMD files, without a header; otherwise the header, or `config`, names the columns.

    Raises:
        InputError: a file is damaged or too large, or a column is missing or of no kind that its quantity can have.
    """
    frames, segments, row, size = [], [], 0, 0
    notes: list[str] = []
    for path in paths:
        size += path.stat().st_size
        check_size(str(path), size, row, config)
        frames.append(
            read_messages(path, row, config) if spmd else read_columns(path, row, config, notes)
        )
        if "vehicle" not in frames[-1]:
            frames[-1]["vehicle"] = "0" if len(paths) == 1 else path.stem
        segments.append(
            segment_of(path, row, header=0 if spmd else 1 + frames[-1].attrs.get("above", 0))
        )
        row += len(frames[-1])
    if len({"lat" in frame for frame in frames}) > 1:
        raise InputError(
            f"{paths[0]} and the files beside it mix latitude/longitude and x/y; read them one by one"
        )
    log = from_frame(pd.concat(frames, ignore_index=True), paths, tuple(segments), config)
    return replace(log, notes=(*dict.fromkeys(notes), *log.notes))


def read_columns(path: Path, before: int, config: LogConfig, notes: list[str]) -> pd.DataFrame:
    """Read the needed columns of one table in our units.

    Args:
        path: the table.
        before: rows that were read from other files.
        config: as of `read`.
        notes: how the table was read is added here.

    Raises:
        InputError: as `read`, or stamps repeat and no column says which vehicle a row is of.
    """
    if path.suffix.lower() in PARQUET:
        needs("parquet", "pyarrow")
        from scenario_gen.logs import parquet

        above = 0
        frame, columns, header = parquet.read_columns(path, before, config)
    else:
        layout = layout_of(path)
        notes += layout.notes
        form = {
            "encoding": layout.encoding,
            "sep": layout.separator,
            "decimal": layout.decimal,
            "skiprows": layout.above,
        }
        header = [str(name) for name in read_text(path, before, config, **form, nrows=0).columns]
        columns = find_columns(header, path, config.columns)
        texts = {
            columns[quantity].name: object
            for quantity in ("vehicle", "kind")
            if quantity in columns
        }
        frame = read_text(
            path, before, config, **form, dtype=texts
        )  # a number of 64 bits, or in hexadecimal, is no float64
        above = layout.above
    if (
        "kind" in columns
        and not columns["kind"].types
        and len(kinds := reals(frame[columns["kind"].name]).dropna().unique())
    ):
        name, some = (
            columns.pop("kind").name,
            ", ".join(f"{kind:g}" for kind in sorted(kinds)[:SHOWN]),
        )
        notes.append(
            f"column {name} has numbers ({some}), whose meaning is not known: all are read by their sizes; name it with, say, "
            f"--set log.columns=kind={name}:car1+truck2"
        )
    notes += notes_on(columns, config.columns, header)
    numbers = to_numbers(frame, columns, path)
    if "vehicle=none" not in config.columns.replace(" ", ""):
        check_ids(frame, columns, numbers, path)
    check_degrees(numbers, columns, path)
    numbers.attrs["above"] = above
    return numbers


def check_ids(
    frame: pd.DataFrame, columns: dict[str, Column], numbers: pd.DataFrame, path: Path
) -> None:
    """Check that a table without a column for the vehicle is of one vehicle, and that such a column does not number the rows.

    Raises:
        InputError: most stamps are there more than once, or each row is another vehicle's; names the columns that could be meant.
    """
    time = numbers["time"]
    if "vehicle" not in columns:
        sound, fault = (
            time.nunique() > len(time) / 2 + 1,
            "several rows have the same time, and no column names the vehicle",
        )
    else:
        sound = len(time) < FEW_ROWS or numbers["vehicle"].nunique() < len(time)
        fault = (
            f"the column {columns['vehicle'].name!r} is another one in each row, and so no vehicle"
        )
    if sound:
        return
    unused = [
        name for name in frame.columns if name not in {column.name for column in columns.values()}
    ]
    could = [
        str(name)
        for name in unused
        if 2 <= frame[name].nunique() <= len(frame) / 2
        and not pd.DataFrame({"t": time, "v": frame[name]}).duplicated().any()
    ]
    remedy = (
        f"it could be {' or '.join(could)}: --set log.columns=vehicle={could[0]}"
        if could
        else "add a column `id`"
    )
    raise InputError(f"{path}: {fault}; {remedy}")


def segment_of(path: Path, row: int, *, header: int = 1) -> Segment:
    """Return the place of a file's rows, the first of which is `row` of the log, after so many lines of text."""
    return (
        Segment(row, str(path), "row", 1)
        if path.suffix.lower() in PARQUET
        else Segment(row, str(path), "line", 1 + header)
    )


def read_text(path: Path, before: int, config: LogConfig, **options: Any) -> pd.DataFrame:
    """Read a table in text with pandas, whose options say how it is written; `before` rows were read from other files.

    Raises:
        InputError: it is no table, or too large.
    """
    options = {"encoding": "utf-8-sig"} | options
    with guarded(f"{path} cannot be read as a table"):
        try:
            frame = pd.read_csv(
                path,
                skipinitialspace=True,
                skip_blank_lines=False,
                compression=None,
                **{"nrows": config.row_limit - before + 1} | options,
            )
        except UnicodeDecodeError as error:
            raise InputError(
                f"{path} is not UTF-8 text (byte {error.start}); save it as UTF-8"
            ) from error
    check_size(str(path), 0, before + len(frame), config)
    if frame.empty and options.get("nrows") != 0:
        raise InputError(f"{path} has a header but no rows")
    if not isinstance(frame.index, pd.RangeIndex):
        raise InputError(
            f"{path}: the rows have more fields than the header; name every column, and write 0.5, not 0,5"
        )
    return frame


def to_numbers(frame: pd.DataFrame, columns: dict[str, Column], path: Path) -> pd.DataFrame:
    """Return the needed columns in our units; texts that are no numbers become NaN. Stamps become integer nanoseconds.

    Raises:
        InputError: a column is of no kind that the quantity can have.
    """
    out = pd.DataFrame(index=frame.index)
    for quantity, column in columns.items():
        values = frame[column.name]
        if isinstance(values, pd.DataFrame):
            raise InputError(
                f"{path} has more than one column {column.name!r}; rename all but one"
            )
        if quantity == "vehicle":
            out["vehicle"] = vehicle_names(values)
        elif quantity == "kind":
            words = values.astype(str)
            out["kind"] = (
                reals(values).map(dict(column.types)).fillna("unnamed " + words)
                if column.types
                else words
            )
        elif pd.api.types.is_bool_dtype(values):
            raise InputError(
                f"{path}, column {column.name!r} ({quantity}): true or false is no {quantity}; name another column"
            )
        elif quantity == "time":
            out["time"], out["time_ok"] = nanoseconds(values, column.factor)
            check_stamps(values, out["time"], out["time_ok"], column, path)
        else:
            numbers = reals(values)
            if column.minutes:
                degrees = np.trunc(numbers / 100.0)
                numbers = degrees + (numbers - 100.0 * degrees) / 60.0
            numbers = numbers * abs(column.factor)
            out[quantity] = math.copysign(1.0, column.factor) * (
                (math.pi / 2.0 - numbers) if column.clockwise else numbers
            )
    return out


def reals(values: "pd.Series[Any]") -> "pd.Series[float]":
    """Return numbers, or texts that are numbers, as float64; NaN where they are none."""
    if not pd.api.types.is_numeric_dtype(values):
        values = values.where(
            values.astype(str).str.len() < LONGEST_NUMBER
        )  # pandas fails on a number beyond float64
    return pd.to_numeric(values, errors="coerce").astype(float)


def vehicle_name(value: Any) -> str:
    """Return a vehicle's name as text: 17, 17.0 and "17" are the same vehicle."""
    if pd.isna(value):
        return ""
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return str(value).strip()


def vehicle_names(values: "pd.Series[Any]") -> "pd.Series[Any]":
    """Return vehicles' names; in a column of texts that are all whole numbers, 017 and 17.0 are 17 too."""
    names = values.map(vehicle_name).astype(object)
    known = pd.Series(names.unique(), dtype=object)
    whole = known.str.fullmatch(r"\d{1,300}(\.0*)?") | (known == "")
    return (
        names.map({name: name and str(int(name.partition(".")[0])) for name in known})
        if whole.all()
        else names
    )


def check_stamps(
    values: "pd.Series[Any]",
    time: "pd.Series[int]",
    known: "pd.Series[bool]",
    column: Column,
    path: Path,
) -> None:
    """Refuse a column of which no value is a stamp, or most are beyond all times: it is in another unit.

    Raises:
        InputError: the message shows a value, and says what it looks like.
    """
    first = shown(next(iter(values.dropna()), ""))
    place = f"{path}, column {column.name!r} (time)"
    if not known.any():
        raise InputError(
            f"{place}: a stamp is not a number, nor a date such as 2022-08-31T12:00:00.5, but {first!r}"
        )
    if (time.abs() >= round(LATEST_S * 1e9)).mean() > 0.5:
        middle = float(reals(values).abs().median())
        since = [
            unit
            for unit, factor in (("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9))
            if NOW[0] < middle * factor < NOW[1]
        ]
        if since and column.factor == 1.0:
            raise InputError(
                f"{place}: {first} looks like {since[0]} since 1970: --set log.columns=time={column.name}:{since[0]}"
            )


def check_degrees(frame: pd.DataFrame, columns: dict[str, Column], path: Path) -> None:
    """Refuse x and y that are degrees: no vehicle moves in them, were they metres, although its speeds say so or it has digits.

    Raises:
        InputError: they are.
    """
    if "x" not in frame or not (
        frame["x"].abs().max() <= 180.0 and frame["y"].abs().max() <= 90.0
    ):
        return
    spread = float(
        frame.groupby("vehicle" if "vehicle" in frame else frame.index * 0)[["x", "y"]]
        .agg(np.ptp)
        .max()
        .max()
    )
    if (
        0.0 < spread < STILL_M
        and frame[["x", "y"]].abs().max().max() > 1.0
        and not ("speed" in frame and frame["speed"].max() < 1.0)
    ):
        x, y = columns["x"].name, columns["y"].name
        raise InputError(
            f"{path}: no vehicle drives farther than {spread:.2g} m by its x and y; they look like degrees of longitude and "
            f"latitude: --set log.columns=lon={x},lat={y}"
        )


def nanoseconds(
    values: "pd.Series[Any]", factor: float
) -> tuple["pd.Series[int]", "pd.Series[bool]"]:
    """Return stamps as integer nanoseconds, `LONGEST` where they are beyond it, and which of them are numbers (or dates) at all.

    Args:
        values: numbers, or texts that are numbers or dates.
        factor: of their unit to seconds.
    """
    if pd.api.types.is_integer_dtype(values):
        inside = (values.astype(float).abs() * factor < LATEST_S).astype(bool)
        return values.where(inside, int(LATEST_S / factor)).astype(np.int64) * round(
            factor * 1e9
        ), values.notna().astype(bool)
    numbers = reals(values)
    if numbers.isna().all():
        dates = pd.to_datetime(values, errors="coerce", utc=True, format="ISO8601")
        ticks = dates.fillna(pd.Timestamp(0, tz="UTC")).astype(np.int64)
        return nanoseconds(ticks, UNITS["time"][dates.dt.unit])[0], dates.notna()
    inside = numbers.abs() * factor < LATEST_S
    return (numbers.where(inside, LATEST_S / factor) * (factor * 1e9)).round().astype(
        np.int64
    ), numbers.notna()


def from_frame(
    frame: pd.DataFrame, paths: Sequence[Path], segments: tuple[Segment, ...], config: LogConfig
) -> RawLog:
    """Group a table in our units by vehicle.

    Raises:
        InputError: there are too many vehicles.
    """
    check_vehicles(str(paths[0]), frame["vehicle"].nunique(), config)
    geographic = "lat" in frame
    usable = frame["time_ok"].to_numpy() & (frame["vehicle"] != "").to_numpy()
    rows = frame["row"].to_numpy() if "row" in frame else np.arange(len(frame))
    reason = np.where(frame["time_ok"].to_numpy(), "no vehicle", "stamp is not a number")
    dropped = tuple(
        (str(why), int(row)) for why, row in zip(reason[~usable], rows[~usable], strict=True)
    )
    position = ("lat", "lon") if geographic else ("x", "y")
    vehicles = []
    frame = frame.assign(row=rows)[usable]
    for name, group in frame.groupby("vehicle", sort=False):
        vehicles.append(observations(str(name), group, position))
    name = paths[0].stem if len(paths) == 1 else paths[0].parent.name
    return RawLog(name, geographic, tuple(vehicles), len(rows), segments, (), dropped)


def observations(name: str, group: pd.DataFrame, position: tuple[str, str]) -> Observations:
    """Return one vehicle's rows as observations; a row is both a fix and a speed."""

    def column(quantity: str) -> Floats:
        return (
            group[quantity].to_numpy(float) if quantity in group else np.full(len(group), np.nan)
        )

    def median(quantity: str) -> float:
        values = column(quantity)
        values = values[np.isfinite(values)]
        usual = values[(values > 0.0) & (values < CLEANING.max_length_m)]
        values = usual if len(usual) else values  # what is no size is replaced later, and said
        return float(np.median(values)) if len(values) else math.nan

    states = np.column_stack([column(quantity) for quantity in (*position, "heading", "speed")])
    stamps: Ints = group["time"].to_numpy(np.int64)
    rows: Ints = group["row"].to_numpy(np.int64)
    size = median("length"), median("width")
    kind = str(group["kind"].mode().iloc[0]) if "kind" in group else ""
    return Observations.of_rows(
        name, stamps, states, rows, size, kind=kind, measured="speed" in group
    )


def read_messages(path: Path, before: int, config: LogConfig) -> pd.DataFrame:
    """Read one file into the columns of the table reader: time [ns], vehicle, lat, lon, speed, heading (ours).

    Raises:
        InputError: the file is empty or a line has not 19 fields.
    """
    raw = read_text(path, before, config, sep=",", header=None, dtype=str)
    if raw.shape[1] != len(COLUMNS):
        raise InputError(
            f"{path} has {raw.shape[1]} columns on line 1; basic safety messages have {len(COLUMNS)}: {', '.join(COLUMNS)}"
        )
    raw.columns = pd.Index(COLUMNS)
    raw["TxDevice"] = reals(raw["TxDevice"])
    frame = to_numbers(raw, QUANTITIES, path)
    stamps = reals(raw["Gentime"])  # microseconds stay exact in float64 until the year 2289
    frame["time_ok"] = stamps.notna() & (stamps.abs() < 8e15)
    frame["time"] = stamps.where(frame["time_ok"], 0.0).round().astype(np.int64) * 1000 + EPOCH_NS
    return frame

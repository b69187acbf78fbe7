# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tables of public data sets (`formats`) to observations."""

from collections import Counter
from collections.abc import Sequence
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from scenario_gen.base.errors import guarded, InputError, needs
from scenario_gen.logs.adapters.formats import Format, FORMATS
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import check_size, RawLog, Segment
from scenario_gen.logs.tables import from_frame, nanoseconds, read_text, reals, vehicle_name
from scenario_gen.numerics import exact


def read(paths: Sequence[Path], config: LogConfig, *, name: str) -> RawLog:
    """Read one recording of a data set.

    Args:
        paths: its file, or the folder's files, of which one holds the tracks.
        config: bounds sizes.
        name: of the format, a key of `FORMATS`.

    Raises:
        InputError: a file is damaged or missing, has not the format's columns, or there are several recordings.
    """
    known = FORMATS[name]
    tracks = [path for path in paths if not _is_companion(path, known)]
    main = [path for path in tracks if not path.name.startswith("pedestrian")]
    if len(main) != 1:
        names = ", ".join(path.name for path in main) or "none"
        raise InputError(
            f"{paths[0]}: one recording of {known.title} has one file of tracks, here are {names}; give one at a time"
        )
    frames, segments, row, notes = [], [], 0, []
    left_out: Counter[str] = Counter()
    for path in tracks:
        table = _table(path, known, row, config)
        if len(table) and path not in main:  # pedestrians have files of their own
            walkers = table.groupby(table["kind"].astype(str))["vehicle"].nunique() if "kind" in table else {"pedestrian": 1}
            left_out.update({str(kind): int(count) for kind, count in walkers.items()})
            continue
        kinds = _kinds(path, known, table)
        keep = kinds.isin(known.kinds).to_numpy()
        left_out.update(
            {str(kind): int(count) for kind, count in table[~keep].groupby(kinds[~keep])["vehicle"].nunique().items()}
        )
        frames.append(_ours(table, path, known, config))
        frames[-1] = frames[-1].assign(row=np.arange(row, row + len(table)))[keep]
        segments.append(
            Segment(row, str(path), "row" if path.suffix == ".parquet" else "line", 1 if path.suffix == ".parquet" else 2)
        )
        row += len(table)
    if left_out:
        counted = ", ".join(f"{count} × {kind or 'unknown'}" for kind, count in sorted(left_out.items()))
        notes.append(f"who is no car, van, truck or bus was left out: {counted}")
    notes.insert(0, f"read as {known.title}")
    log = from_frame(pd.concat(frames, ignore_index=True), [main[0]], tuple(segments), config)
    return RawLog(main[0].stem, log.geographic, log.vehicles, row, log.segments, (*notes, *log.notes), dropped=log.dropped)


def recognised(path: Path) -> str:
    """Return the name of the format that a file's header is of, "" if of none; of a companion, that of its tracks."""
    if path.suffix.lower() not in (".csv", ".parquet"):
        return ""
    if path.suffix.lower() == ".parquet":
        needs("parquet", "pyarrow")
        from pyarrow import parquet

        try:
            names = set(parquet.read_schema(path).names)
        except Exception:  # the reader of tables says what is wrong with it
            return ""
    else:
        for known in FORMATS.values():
            if _is_companion(path, known):
                main = (
                    path.with_name(path.name.removesuffix(_ending(path, known)) + known.companion[0]) if known.companion else path
                )
                return recognised(main) if main.is_file() and main != path else ""
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            names = {field.strip() for field in file.readline().split(",")}
        if path.name.startswith("pedestrian_tracks") and {"track_id", "timestamp_ms", "agent_type"} <= names:
            return "interaction"
    return next((known.name for known in FORMATS.values() if known.needed <= names), "")


def _ending(path: Path, known: Format) -> str:
    return next((ending for ending in (known.companion or ())[1:] if path.name.endswith(ending)), "")


def _is_companion(path: Path, known: Format) -> bool:
    return bool(_ending(path, known))


def _table(path: Path, known: Format, before: int, config: LogConfig) -> pd.DataFrame:
    """The columns of a file by quantity, as they stand."""
    check_size(str(path), path.stat().st_size, before, config)
    if path.suffix.lower() == ".parquet":
        needs("parquet", "pyarrow")
        from scenario_gen.logs.parquet import read_table

        raw = read_table(path, sorted(known.needed), before, config)
    else:
        raw = read_text(path, before, config, sep=",")
    raw.columns = pd.Index([str(column).strip() for column in raw.columns])
    pedestrians = path.name.startswith("pedestrian")
    missing = sorted(known.needed - set(raw.columns)) if not pedestrians else []
    if missing:
        raise InputError(f"{path} lacks columns of {known.title}: {', '.join(missing)}; it has {', '.join(raw.columns)}")
    return pd.DataFrame({q: raw[column.column] for q, column in known.columns.items() if column.column in raw.columns})


def _beside(path: Path, known: Format, which: int, columns: tuple[str, ...]) -> pd.DataFrame:
    """A companion of a file of tracks.

    Raises:
        InputError: it is not there, or lacks a column.
    """
    assert known.companion is not None
    ending = known.companion[0]
    file = path.with_name(path.name.removesuffix(ending) + known.companion[which])
    if not path.name.endswith(ending) or not file.is_file():
        raise InputError(f"{path}: {known.title} has {file.name} beside it, which is not there; put it there under its own name")
    with guarded(f"{file} cannot be read as a table"):
        frame = pd.read_csv(file, nrows=1_000_000)
    missing = [column for column in columns if column not in frame.columns]
    if missing or frame.empty:
        raise InputError(f"{file} lacks {', '.join(missing) or 'rows'}; it has {', '.join(map(str, frame.columns))}")
    return frame


def _kinds(path: Path, known: Format, table: pd.DataFrame) -> "pd.Series[Any]":
    """The class of every row, in small letters."""
    if "kind" in table:
        return table["kind"].astype(str).str.strip().str.lower()
    column = known.columns["vehicle"].column
    meta = _beside(path, known, 1, (column, "class"))
    classes = dict(zip(meta[column].map(vehicle_name), meta["class"].astype(str).str.strip().str.lower(), strict=True))
    return table["vehicle"].map(vehicle_name).map(lambda name: classes.get(name, "without a class"))


def _ours(table: pd.DataFrame, path: Path, known: Format, config: LogConfig) -> pd.DataFrame:
    """The table in our quantities and units."""
    factor = known.columns["time"].factor
    if known.companion:
        rates = reals(_beside(path, known, 2, ("frameRate",))["frameRate"])
        rate = float(rates.iloc[0])
        if not 0.1 <= rate <= 1000.0:
            raise InputError(f"{path}: the recordingMeta beside it says {rate:g} frames per second; 0.1 to 1000 are read")
        factor = 1.0 / rate
    value = {
        q: reals(table[q]) * c.factor for q, c in known.columns.items() if q not in ("vehicle", "time", "kind") and q in table
    }
    out = pd.DataFrame({"vehicle": table["vehicle"].map(vehicle_name).astype(object)})
    out["time"], out["time_ok"] = nanoseconds(table["time"], factor)
    vx, vy = value["vx"].to_numpy(float), value["vy"].to_numpy(float)
    x, y = value["x"].to_numpy(float), value["y"].to_numpy(float)
    if known.image:
        x, y, vy = x + value["length"].to_numpy(float) / 2.0, -(y + value["width"].to_numpy(float) / 2.0), -vy
    out["x"], out["y"] = x, y
    out["speed"] = exact.hypot(vx, vy)
    out["heading"] = value["heading"] if "heading" in value else np.where(out["speed"] > 0.1, exact.arctan2(vy, vx), math.nan)
    for size in ("length", "width"):
        if size in value:
            out[size] = value[size]
    return out

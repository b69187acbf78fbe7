# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Tables of public data sets (`data_sets`) to observations."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pandas as pd

from scenario_gen.base.errors import guarded, InputError
from scenario_gen.logs.adapters.data_sets import (
    column_name,
    companion,
    DATA_SETS,
    DataSet,
    has_pedestrians,
    header_of,
    is_companion,
)
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import check_size, RawLog
from scenario_gen.logs.stamps import reals
from scenario_gen.logs.tables import from_frame, read_table, segment_of, vehicle_name

_MIN_HEADING_MPS = 0.1  # a slower vehicle has no direction of travel


def read(paths: Sequence[Path], config: LogConfig, *, name: str) -> RawLog:
    """Read one recording of a data set.

    Args:
        paths: its files, one of which has the tracks.
        config: bounds sizes.
        name: key of `DATA_SETS`.

    Raises:
        InputError: a file is damaged or missing, lacks a column, or there are several recordings.
    """
    data_set = DATA_SETS[name]
    companions = data_set.companions
    tracks = [path for path in paths if not companions or not is_companion(path, companions)]
    pedestrians = [path for path in tracks if has_pedestrians(path, name)]
    main = [path for path in tracks if path not in pedestrians]
    if len(main) != 1:
        names = ", ".join(path.name for path in main) or "none"
        raise InputError(
            f"{paths[0]}: a recording of {data_set.title} has one file of tracks, found: {names}; "
            "read one recording at a time"
        )
    frames = []
    segments = []
    n_rows = 0
    for path in (*main, *pedestrians):
        check_size(str(path), path.stat().st_size, n_rows, config)
        columns = replace(config, columns=_option(path, data_set))
        frame = _completed(read_table(path, n_rows, columns, []).frame, path, data_set)
        frames.append(frame)
        segments.append(segment_of(path, n_rows))
        n_rows += len(frame)
    frame = pd.concat(frames, ignore_index=True)
    notes = [f"read as {data_set.title}"]
    if "speed" not in frame:
        notes.append("no speeds: they are derived from the positions")
    log = from_frame(frame, main, tuple(segments), config)
    return replace(log, notes=tuple(notes))


def _option(path: Path, data_set: DataSet) -> str:
    """Return the columns of a file as in the parameter `columns`.

    Raises:
        InputError: a needed column is missing.
    """
    header = header_of(path)
    missing = sorted(data_set.needed - header)
    is_interaction = data_set is DATA_SETS["interaction"]
    if missing and not (is_interaction and has_pedestrians(path, "interaction")):
        raise InputError(
            f"{path} lacks columns of {data_set.title}: {', '.join(missing)}; "
            f"it has {', '.join(sorted(header))}"
        )
    columns = {
        quantity: text
        for quantity, text in data_set.columns.items()
        if column_name(text) in header
    }
    if data_set.companions:
        columns["time"] += f":{_frame_rate(path, data_set)}fps"
    return ",".join(f"{quantity}={text}" for quantity, text in columns.items())


def _read_companion(
    path: Path, data_set: DataSet, suffix: str, columns: Sequence[str]
) -> pd.DataFrame:
    """Return another file of the recording of a file of tracks.

    Raises:
        InputError: it does not exist, or lacks a column.
    """
    assert data_set.companions is not None
    file = companion(path, data_set.companions, suffix)
    if not path.name.endswith(data_set.companions.tracks) or not file.is_file():
        raise InputError(
            f"{path}: {data_set.title} also needs {file.name} in the same folder; copy it there"
        )
    with guarded(f"{file} cannot be read as a table"):
        frame = pd.read_csv(file, nrows=1_000_000)
    missing = [column for column in columns if column not in frame.columns]
    if missing or frame.empty:
        raise InputError(
            f"{file} lacks {', '.join(missing) or 'rows'}; "
            f"it has {', '.join(map(str, frame.columns))}"
        )
    return frame


def _completed(frame: pd.DataFrame, path: Path, data_set: DataSet) -> pd.DataFrame:
    """Return rows with positions of centres, types, and headings."""
    if data_set.is_image_frame:
        frame["x"] += frame["length"] / 2.0
        frame["y"] = -(frame["y"] + frame["width"] / 2.0)
        frame["course"] = -frame["course"]
    if data_set.companions:
        column = column_name(data_set.columns["vehicle"])
        classes = _read_companion(path, data_set, data_set.companions.classes, (column, "class"))
        by_vehicle = dict(zip(classes[column].map(vehicle_name), classes["class"], strict=True))
        kinds = frame["vehicle"].astype(object).map(by_vehicle)
        frame["kind"] = kinds.fillna("without a class").astype(str).str.strip().str.lower()
    elif "kind" not in frame:
        frame["kind"] = "pedestrian"
    elif "subkind" in frame:
        subkind = frame["subkind"]
        subkind = subkind.where(~subkind.str.startswith("unnamed"), "vehicle")
        frame["kind"] = frame["kind"].where(frame["kind"] != "vehicle", subkind)
    if "heading" not in frame and "course" in frame:
        frame["heading"] = frame["course"].where(frame["speed"] > _MIN_HEADING_MPS)
    return frame


def _frame_rate(path: Path, data_set: DataSet) -> float:
    """Return the frames per second of a recording.

    Raises:
        InputError: its frame rate is missing or implausible.
    """
    assert data_set.companions is not None
    meta = _read_companion(path, data_set, data_set.companions.frame_rate, ("frameRate",))
    frame_rate = float(reals(meta["frameRate"]).iloc[0])
    if not 0.1 <= frame_rate <= 1000.0:
        raise InputError(
            f"{path}: its recordingMeta has {frame_rate:g} frames per second; 0.1 to 1000 can be "
            "read"
        )
    return frame_rate

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The parts of tables: scenes, files and tracks in which the same id means another vehicle."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from scenario_gen.logs.clock import in_turn
from scenario_gen.logs.column import Column
from scenario_gen.logs.columns import MAX_LISTED_COUNT
from scenario_gen.logs.file_names import file_names

_MIN_SCENE_GAP_NS = 60_000_000_000  # more than any gap that is bridged
_MIN_SCENE_GAP_ROWS_COUNT = 200  # periods of a vehicle, in whatever unit the time is
_MIN_SHARED_SCENE_SHARE = 0.5  # of the scenes; in fewer with two vehicles, a scene is a trip
_TRACK_GAP_NS = 10_000_000_000  # after a longer gap, an id may be given to another vehicle
_TRACK_GAP_ROWS_COUNT = 20  # the same in periods of the vehicle
_SAME_PLACE_M = 2.0  # nearer positions at one time are those of one vehicle
_SAME_PLACE_DEG = 2e-5
_HEMISPHERES = {"lat": ("N", "S"), "lon": ("E", "W")}
_MAX_DEGREES = {"lat": 90.0, "lon": 180.0}


def with_hemispheres(frame: pd.DataFrame, columns: dict[str, Column]) -> pd.DataFrame:
    """Return a table with signed latitudes and longitudes, if columns have N, S, E and W.

    Unsigned values above 180 are degrees and minutes, as receivers write them: their unit is set
    in `columns`.
    """
    for name in frame.columns[[not pd.api.types.is_numeric_dtype(kind) for kind in frame.dtypes]]:
        letters = {str(letter).strip().upper() for letter in frame[name].dropna().unique()}
        for quantity, (positive, negative) in _HEMISPHERES.items():
            if quantity not in columns or not letters or letters - {positive, negative}:
                continue
            column = columns[quantity]
            degrees = pd.to_numeric(frame[column.name], errors="coerce").abs()
            is_positive = frame[name].astype(str).str.strip().str.upper() == positive
            frame = frame.assign(**{column.name: degrees.where(is_positive, -degrees)})
            if not column.unit and degrees.median() > _MAX_DEGREES[quantity]:
                columns[quantity] = replace(column, minutes=True, unit="ddmm")
    return frame


def named_by_file(frames: list[pd.DataFrame], paths: Sequence[Path]) -> list[str]:
    """Tell apart, in place, vehicles whose id is in several files at one time in different places.

    A file with one vehicle names it. Files with several vehicles are scenes.

    Returns:
        A note on the ids.
    """
    shared = {
        name
        for k, frame in enumerate(frames)
        for name in frame["vehicle"].unique()
        for other in frames[:k]
        if name and _are_different(_rows_of(frame, name), _rows_of(other, name))
    }
    if not shared:
        return []
    listed = ", ".join(sorted(map(str, shared))[:MAX_LISTED_COUNT])
    are_scenes = any(frame["vehicle"].nunique() > 1 for frame in frames)
    for frame, file in zip(frames, file_names(paths), strict=True):
        if are_scenes:
            frame["scene"] = (
                f"{file}/" + frame["scene"].astype(object) if "scene" in frame else file
            )
        else:
            frame["vehicle"] = file
    if are_scenes:
        return [f"several files have the same ids at one time ({listed}): each file is a scene"]
    return [f"ids that several files have at one time ({listed}) are named by their files"]


def _rows_of(frame: pd.DataFrame, name: str) -> pd.DataFrame:
    return frame[(frame["vehicle"] == name) & frame["time_ok"]]


def _are_different(rows: pd.DataFrame, others: pd.DataFrame) -> bool:
    """Return whether rows of one id in two files are at one time in different places."""
    if len(rows) < 2 or len(others) < 2:
        return False
    is_common = rows["time"].between(others["time"].min(), others["time"].max())
    if is_common.sum() < 2:
        return False
    others = others.sort_values("time", kind="stable")
    common = rows[is_common]
    axes, limit = (
        (("lat", "lon"), _SAME_PLACE_DEG) if "lat" in rows else (("x", "y"), _SAME_PLACE_M)
    )
    start = int(others["time"].iloc[0])
    seconds = (others["time"] - start).to_numpy(float)
    wanted = (common["time"] - start).to_numpy(float)
    offsets = [common[axis] - np.interp(wanted, seconds, others[axis]) for axis in axes]
    return bool(np.nanmedian(np.hypot(*offsets)) > limit)


def apart_by_scene(frame: pd.DataFrame) -> tuple[pd.DataFrame, list[str]]:
    """Return a table whose scenes follow each other in time, and a note.

    Scenes that do not overlap in time, or that have one vehicle each, remain unchanged.
    """
    if "scene" not in frame:
        return frame, []
    scenes = frame.groupby("scene", sort=False)
    spans = scenes["time"].agg(["min", "max"])
    by_start = spans.sort_values("min", kind="stable")
    overlaps = by_start["min"].to_numpy()[1:] <= by_start["max"].cummax().to_numpy()[:-1]
    n_vehicles = scenes["vehicle"].nunique()
    if not overlaps.any() or (n_vehicles > 1).mean() < _MIN_SHARED_SCENE_SHARE:
        return frame.drop(columns="scene"), []
    steps = frame.groupby(["scene", "vehicle"], sort=False)["time"].diff()
    usual = float(steps[steps > 0].median()) if (steps > 0).any() else 0.0
    gap = max(_MIN_SCENE_GAP_NS, round(_MIN_SCENE_GAP_ROWS_COUNT * usual))
    shifts = pd.Series(in_turn(spans.to_numpy().tolist(), gap), index=spans.index)
    shifted = frame["time"] + frame["scene"].map(shifts).astype(np.int64)
    note = f"{len(spans)} scenes that overlap in time are read one after the other"
    return frame.assign(time=shifted), [note]


def tracks_of(group: pd.DataFrame) -> Iterator[pd.DataFrame]:
    """Yield the rows of one id, in parts between long gaps if its sizes or types differ."""
    labels = [name for name in ("length", "width", "kind") if name in group]
    if not any(group[name].nunique() > 1 for name in labels):
        yield group
        return
    steps = np.abs(np.diff(group["time"].to_numpy(np.int64)))
    is_start = steps > max(_TRACK_GAP_NS, _TRACK_GAP_ROWS_COUNT * np.median(steps))
    for rows in np.split(np.arange(len(group)), np.flatnonzero(is_start) + 1):
        yield group.iloc[rows]

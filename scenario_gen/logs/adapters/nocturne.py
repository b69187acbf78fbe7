# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scenarios of the Waymo Open Motion Dataset for Nocturne and GPUDrive (JSON).

| quantity | key of an object | unit |
|---|---|---|
| vehicle | id, or else its index in the list | |
| class | type: vehicle, pedestrian, cyclist | |
| length, width | length, width | m |
| time | index in the lists, times 0.1 s | |
| presence | valid | |
| position | position: x, y; the centre of the footprint | m |
| heading | heading, counter-clockwise from +x | degrees (Nocturne) or rad (GPUDrive) |
| speed | velocity: x, y | m/s |

| quantity | key of an entry of `tl_states`, which is named after its lane | unit |
|---|---|---|
| state | state: stop, caution, go, with arrow_ or flashing_ before it | |
| time | time_index, times 0.1 s | |
| place | x, y: where the lane's traffic stops | m |

Headings above a turn of 2π are degrees. The direction of a stop line is that of
the lane in `roads` at its place.

Source: the documentation of Nocturne's and of GPUDrive's scenes.
"""

from collections.abc import Mapping, Sequence
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from scenario_gen.base.errors import guarded, InputError
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import (
    check_size,
    check_vehicles,
    Observations,
    only_file,
    RawLog,
    Segment,
)
from scenario_gen.logs.signals import line_across, RawSignal, sampled_schedule, state_of
from scenario_gen.numerics import Floats
from scenario_gen.types import SignalState

_MAX_HEADING_RAD = 2.0 * math.pi  # larger values are degrees


def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read the vehicles of one scenario.

    Raises:
        InputError: the file is damaged, has no objects, or an object lacks a key; names the
            object.
    """
    path = only_file(paths, config)
    scene = _scene(path)
    objects = _objects(path, scene)
    check_vehicles(str(path), len(objects), config)
    names = [str(item.get("id", k)) for k, item in enumerate(objects)]
    if len(set(names)) < len(names):
        names = [str(k) for k in range(len(objects))]
    states = []
    n_rows = 0
    for k, item in enumerate(objects):
        states.append(_states(f"{path}, object {k + 1}", item))
        n_rows += len(states[-1])
        check_size(str(path), 0, n_rows, config)

    rows = np.concatenate(states)
    are_degrees = bool((np.abs(rows[rows[:, 5] > 0.0, 2]) > _MAX_HEADING_RAD).any())
    vehicles = []
    first_row = 0
    for name, item, state in zip(names, objects, states, strict=True):
        vehicles.append(_observations(name, item, state, first_row, are_degrees))
        first_row += len(state)
    unit = "degrees" if are_degrees else "rad"
    notes = [f"read as a scene of Nocturne or GPUDrive, headings in {unit}"]
    signals = _signals(path, scene, notes) if config.signals == "recorded" else []
    segment = Segment(0, str(path), "state", 1)
    return RawLog(
        path.stem,
        False,
        tuple(vehicles),
        n_rows,
        (segment,),
        tuple(notes),
        signals=tuple(signals),
    )


def _scene(path: Path) -> Any:
    """Return the document of a scene.

    Raises:
        InputError: the file is not JSON.
    """
    try:
        return json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is not JSON: {str(error)[:200]}; copy it again") from None


def _signals(path: Path, scene: Mapping[str, Any], notes: list[str]) -> list[RawSignal]:
    """Return the lights of a scene; a note on those without a lane is appended.

    Raises:
        InputError: an entry is damaged, or a state is not known.
    """
    entries = scene.get("tl_states") or {}
    if not isinstance(entries, Mapping):
        raise InputError(f"{path}: `tl_states` is not an object with an entry for each lane")
    edges = _lane_edges(path, scene) if entries else np.zeros((0, 4))
    signals = {name: _signal(path, name, entry, edges) for name, entry in entries.items()}
    without_lane = [name for name, signal in signals.items() if signal is None]
    if without_lane:
        notes.append(f"traffic lights without a lane are left out: {', '.join(without_lane)}")
    return [signal for signal in signals.values() if signal is not None]


def _signal(path: Path, name: str, entry: Any, edges: Floats) -> RawSignal | None:
    """Return the light of a lane; None if no edge of a lane (K, 4) is near its place.

    Raises:
        InputError: the entry is damaged, or a state is not known.
    """
    place = f"{path}: traffic light {name}"
    with guarded(place, LookupError, TypeError, ValueError, OverflowError):
        where = entry.get("position", entry)
        points = np.column_stack([where["x"], where["y"]]).astype(float)
        times = [0.1 * int(step) for step in entry["time_index"]]
        words = [str(word).removeprefix("arrow_") for word in entry["state"]]
    if not len(times) == len(points) == len(words) > 0:
        raise InputError(f"{place}: state, x, y and time_index differ in length, or are empty")
    yaw = _lane_yaw(points[0], edges)
    if math.isnan(yaw):
        return None
    states = [
        SignalState.OFF if word.startswith("flashing") else state_of(word, place) for word in words
    ]
    line = line_across(points[0], yaw)
    return RawSignal(name, sampled_schedule(times, states, place), str(path), line, (name,))


def _lane_yaw(point: Floats, edges: Floats) -> float:
    """Return the direction [rad] of the lane at a point (2,); NaN if there is none near it."""
    start = edges[:, :2]
    edge = edges[:, 2:]
    length = np.maximum(np.hypot(*edge.T), 1e-6)
    share = np.clip(((point - start) * edge).sum(axis=1) / length**2, 0.0, 1.0)
    distance = np.hypot(*(start + share[:, None] * edge - point).T)
    if not len(edges) or distance.min() > 5.0:  # m
        return math.nan
    nearest = edge[np.argmin(distance)]
    return float(np.arctan2(nearest[1], nearest[0]))


def _lane_edges(path: Path, scene: Mapping[str, Any]) -> Floats:
    """Return the first point and the vector of each edge of the lanes (K, 4) [m]."""
    edges = [np.zeros((0, 4))]
    for road in scene.get("roads", ()):
        if isinstance(road, Mapping) and road.get("type") == "lane":
            with guarded(f"{path}: a lane", LookupError, TypeError, ValueError, OverflowError):
                points = _vectors(road["geometry"])
            edges.append(np.column_stack([points[:-1], np.diff(points, axis=0)]))
    return np.concatenate(edges)


def _objects(path: Path, scene: Any) -> list[dict[str, Any]]:
    """Return the objects of a scene.

    Raises:
        InputError: it has no objects.
    """
    objects = scene.get("objects") if isinstance(scene, dict) else None
    if not isinstance(objects, list) or not all(isinstance(item, dict) for item in objects):
        raise InputError(f"{path}: `objects` is not a list of objects")
    if not objects:
        raise InputError(f"{path}: it has no object")
    return objects


def _observations(
    name: str, item: Mapping[str, Any], states: Floats, first_row: int, are_degrees: bool
) -> Observations:
    """Return the states of an object at the steps at which it is present."""
    steps = np.flatnonzero(states[:, 5] > 0.0)
    heading = np.radians(states[:, 2]) if are_degrees else states[:, 2]
    speed = np.hypot(states[:, 3], states[:, 4])
    columns = np.column_stack([states[:, :2], heading, speed])
    return Observations.of_rows(
        name,
        steps * 100_000_000,  # 10 Hz
        columns[steps],
        first_row + steps,
        (_positive(item, "length"), _positive(item, "width")),
        kind=str(item.get("type", "")),
    )


def _states(place: str, item: Mapping[str, Any]) -> Floats:
    """Return x, y [m], heading (of either unit), velocity x, y [m/s], presence (T, 6).

    Raises:
        InputError: a list is missing, is not numeric, or differs in length from `valid`.
    """
    try:
        valid = np.array([bool(flag) for flag in item["valid"]], dtype=float)
        position = _vectors(item["position"])
        velocity = _vectors(item["velocity"])
        heading = np.array(list(item["heading"]), dtype=float).reshape(-1)
    except KeyError as error:
        raise InputError(f"{place} has no {error.args[0]!r}") from None
    except (TypeError, ValueError, IndexError, OverflowError):
        raise InputError(
            f"{place}: position, velocity, heading or valid is not a list with a number for each "
            "step"
        ) from None
    lengths = {len(valid), len(position), len(velocity), len(heading)}
    if len(lengths) > 1:
        raise InputError(
            f"{place}: position, velocity, heading and valid have {sorted(lengths)} entries; one "
            "for each step is needed"
        )
    return np.column_stack([position, heading, velocity, valid])


def _vectors(entries: Any) -> Floats:
    """Return vectors (T, 2) of a list of objects with x and y."""
    vectors = [(entry["x"], entry["y"]) for entry in entries]
    return np.array(vectors, dtype=float).reshape(-1, 2)


def _positive(item: Mapping[str, Any], key: str) -> float:
    """Return a positive number of an object, NaN if it has none."""
    value = item.get(key)
    return float(value) if isinstance(value, (int, float)) and value > 0.0 else math.nan

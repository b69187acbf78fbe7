# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scenarios of the Waymo Open Motion Dataset as Nocturne and GPUDrive take them (JSON).

| quantity | key of an object | unit |
|---|---|---|
| vehicle | id; without it the object's place in the list | |
| class | type: vehicle, pedestrian, cyclist | |
| length, width | length, width | m |
| time | place in the lists, times 0.1 s | |
| there | valid | |
| position | position: x, y; the footprint's middle | m |
| heading | heading | degrees (Nocturne) or rad (GPUDrive), counter-clockwise from +x |
| speed | velocity: x, y | m/s |

Source: the documentation of Nocturne's and of GPUDrive's scenes. Which unit headings have is told from the velocities.
"""

from collections.abc import Mapping, Sequence
import json
from pathlib import Path
from typing import Any

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.raw import (
    check_size,
    check_vehicles,
    Observations,
    only_file,
    RawLog,
    Segment,
)
from scenario_gen.numerics import Floats

STEP_NS = 100_000_000
MOVES = 2.0  # m/s from which on a velocity has the vehicle's direction
PER_OBJECT = 1000.0  # m/s, m: beyond, a value is a mark of absence


def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read the vehicles of one scenario.

    Raises:
        InputError: it is broken, has no vehicles, or an object lacks what is needed; names file and object.
    """
    path = only_file(paths, config)
    try:
        scene = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is no JSON: {str(error)[:200]}; copy it again") from None
    objects = scene.get("objects") if isinstance(scene, dict) else None
    if not isinstance(objects, list) or not all(isinstance(one, dict) for one in objects):
        raise InputError(f"{path}: `objects` is no list of objects")
    check_vehicles(str(path), len(objects), config)
    found = list(enumerate(objects))
    if not found:
        raise InputError(f"{path}: no object in it")
    names = [str(one.get("id", k)) for k, one in found]
    if len(set(names)) < len(names):
        names = [str(k) for k, _ in found]
    states, rows = [], 0
    for k, one in found:
        states.append(_states(f"{path}, object {k + 1}", one))
        rows += len(states[-1])
        check_size(str(path), 0, rows, config)
    degrees = _in_degrees(np.concatenate(states))
    vehicles, row = [], 0
    for name, (_, one), own in zip(names, found, states, strict=True):
        there = np.flatnonzero(own[:, 5] > 0.0)
        heading = np.radians(own[:, 2]) if degrees else own[:, 2]
        values = np.column_stack([own[:, :2], heading, np.hypot(own[:, 3], own[:, 4])])[there]
        size = (_number(one, "length"), _number(one, "width"))
        vehicles.append(
            Observations.of_rows(
                name,
                there.astype(np.int64) * STEP_NS,
                values,
                there + row,
                size,
                kind=str(one.get("type", "")),
            )
        )
        row += len(own)
    unit = "degrees" if degrees else "rad"
    notes = (f"read as a scene of Nocturne or GPUDrive, headings in {unit}",)
    return RawLog(
        path.stem, False, tuple(vehicles), rows, (Segment(0, str(path), "state", 1),), notes
    )


def _states(place: str, one: Mapping[str, Any]) -> Floats:
    """Return x, y [m], heading (of either unit), velocity x, y [m/s] and whether it is there, (T, 6).

    Raises:
        InputError: a list is missing, is no list of numbers, or has another length than `valid`.
    """
    try:
        valid = np.array([bool(there) for there in one["valid"]], dtype=float)
        position = np.array(
            [(step["x"], step["y"]) for step in one["position"]], dtype=float
        ).reshape(-1, 2)
        velocity = np.array(
            [(step["x"], step["y"]) for step in one["velocity"]], dtype=float
        ).reshape(-1, 2)
        heading = np.array(list(one["heading"]), dtype=float).reshape(-1)
    except KeyError as error:
        raise InputError(f"{place} has no {error.args[0]!r}") from None
    except (TypeError, ValueError, IndexError, OverflowError):
        raise InputError(
            f"{place}: position, velocity, heading or valid is no list of numbers, one for each step"
        ) from None
    lengths = {len(valid), len(position), len(velocity), len(heading)}
    if len(lengths) > 1:
        raise InputError(
            f"{place}: position, velocity, heading and valid have {sorted(lengths)} entries; one for each step is needed"
        )
    return np.column_stack([position, heading, velocity, valid])


def _in_degrees(states: Floats) -> bool:
    """Return whether headings agree better with the velocities if they are taken for degrees."""
    heading, velocity = states[:, 2], states[:, 3:5]
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    moves = (states[:, 5] > 0.0) & (speed > MOVES) & (speed < PER_OBJECT) & np.isfinite(heading)
    if not moves.any():
        there = states[states[:, 5] > 0.0, 2]
        return bool((np.abs(there) > 2.0 * np.pi).any())
    course = np.arctan2(velocity[moves, 1], velocity[moves, 0])
    agree = [
        float(np.cos(course - taken).mean())
        for taken in (np.radians(heading[moves]), heading[moves])
    ]
    return agree[0] > agree[1]


def _number(one: Mapping[str, Any], key: str) -> float:
    """Return a number of an object, NaN if it is missing or none."""
    value = one.get(key)
    return float(value) if isinstance(value, (int, float)) and value > 0.0 else float("nan")

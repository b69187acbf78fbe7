# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The frames of positions in a bag: fixed, and common to all vehicles."""

from collections.abc import Mapping
import math

import numpy as np

from scenario_gen.bags.vehicles import ODOMETRY, POSE
from scenario_gen.base.errors import InputError
from scenario_gen.logs.bag_names import child_vehicle
from scenario_gen.logs.raw import Rows

_AT_ORIGIN_M = 0.5  # within it, two vehicles cannot be at the same time
_SAME_START_NS = 1e9  # a later vehicle may start at the origin, too
_MAX_START_M = 60.0  # from the origin of its own frame, of a vehicle recorded since it began
_MAX_OFF_AXIS_M = 0.5  # such a vehicle is still on the x axis
_MAX_START_TURN_RAD = 0.1


def base_frames(
    label: str, vehicles: dict[str, Rows], frames: dict[str, str]
) -> tuple[dict[str, Rows], dict[str, str]]:
    """Return the vehicles among transforms, and their frames: those whose parents have no parent.

    Raises:
        InputError: an odometry is between a vehicle and the common frame.
    """
    roots = {child_vehicle(frame) for frame in frames.values()} - set(vehicles)
    bodies = [name for name in vehicles if child_vehicle(frames[name]) in roots]
    odometries = [name for name in bodies if name.rpartition("/")[2] == "odom"]
    if odometries:
        raise InputError(
            f"{label}: {', '.join(odometries)} is between a vehicle and its common frame, and "
            "chains of transforms are not read; record the pose of each vehicle in map, as "
            f"{POSE} or {ODOMETRY}"
        )
    return {name: vehicles[name] for name in bodies}, {name: frames[name] for name in bodies}


def check_frames(label: str, frames: Mapping[str, str], vehicles: Mapping[str, Rows]) -> list[str]:
    """Return notes on the frames of odometries, by vehicle.

    Raises:
        InputError: a frame moves, or each odometry starts at its vehicle's start: they have no
            common frame.
    """
    for vehicle, frame in frames.items():
        check_fixed_frame(frame, f"{label}: the odometry of vehicle {vehicle}")
    first_fixes = {
        vehicle: min(vehicles[vehicle].fixes) for vehicle in frames if vehicles[vehicle].fixes
    }
    at_origin = [
        vehicle
        for vehicle, (_, _, x, y, _) in first_fixes.items()
        if math.hypot(x, y) < _AT_ORIGIN_M
    ]
    starts_ns = [first_fixes[vehicle][0] for vehicle in at_origin]
    start_together = len(at_origin) >= 2 and np.ptp(starts_ns) < _SAME_START_NS
    names = ", ".join(f"{vehicle} in {frame!r}" for vehicle, frame in frames.items())
    if start_together or len({frames[vehicle] for vehicle in at_origin}) >= 2:
        raise InputError(
            f"{label}: the odometries of {' and '.join(at_origin)} begin at 0, 0, each where its "
            f"vehicle started ({names}); record positions in one frame, such as map, or choose "
            "with --set log.topics=…"
        )
    local = _local_odometries(first_fixes, frames)
    if len(local) >= 2 and len(local) == len(frames):
        raise InputError(
            f"{label}: the odometries of {' and '.join(local)} are in frames that begin where "
            f"each vehicle started ({names}): each is on the x axis of its frame and faces along "
            "it; record positions in one frame, such as map, or choose with --set log.topics=…"
        )
    if len(set(frames.values())) > 1:
        return [f"the odometries name several frames ({names}); they are read as one"]
    return []


def _local_odometries(
    first_fixes: Mapping[str, tuple[int, int, float, float, float]], frames: Mapping[str, str]
) -> list[str]:
    """Return the vehicles whose odometry counts from their start, by its frame and first fix."""
    return [
        vehicle
        for vehicle, first in first_fixes.items()
        if _began_at_origin(first) and frames[vehicle].rpartition("/")[2] == "odom"
    ]


def _began_at_origin(first: tuple[int, int, float, float, float]) -> bool:
    """Return whether a first fix is near the origin, on the x axis and in its direction."""
    _, _, x, y, heading = first
    is_on_axis = -_AT_ORIGIN_M < x < _MAX_START_M and abs(y) < _MAX_OFF_AXIS_M
    return is_on_axis and abs(heading) < _MAX_START_TURN_RAD


def check_fixed_frame(frame: str, place: str) -> None:
    """Check that positions are not in the frame of a moving vehicle.

    Raises:
        InputError: they are.
    """
    if frame.rpartition("/")[2].startswith("base_"):
        raise InputError(
            f"{place} is in frame {frame!r}, which moves with its vehicle; record it in a fixed "
            "frame, such as map"
        )

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Checks of requested start and end states: speed, room on the road, gaps between vehicles."""

from itertools import combinations

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import footprint_gaps
from scenario_gen.roads import footprint_fits, ground_for, nearest_pose_with_room
from scenario_gen.types import Encounter, Fit, Road, TypeLimits, Vehicle

_MAX_STANDING_SPEED_MPS = 0.05
_SEARCH_RADIUS_M = 30.0  # within which a pose with room is searched
_ROUNDING_M = 0.02  # poses are rounded to centimetres; this much more keeps their room


def refuse_impossible(
    encounter: Encounter, road: Road, starts: Floats, goals: Floats, limits: TypeLimits
) -> None:
    """Refuse states, (N, 4) each with NaN where none is requested, that no motion can have.

    Raises:
        RefusedError: one is faster than is planned for its type, or off the road.
    """
    for end, rows in (("start", starts), ("goal", goals)):
        for vehicle, state in zip(encounter.vehicles, rows, strict=True):
            if not np.isnan(state[0]):
                _refuse_impossible_state(road, vehicle, end, state, limits)


def _refuse_impossible_state(
    road: Road, vehicle: Vehicle, end: str, state: Floats, limits: TypeLimits
) -> None:
    subject = f"the {end} requested for vehicle {vehicle.id} (x {state[0]:.2f}, y {state[1]:.2f})"
    max_speed = limits.of(vehicle.type).planned.max_speed
    if state[3] > max_speed:
        raise RefusedError(
            f"{subject} has {state[3]:g} m/s; at most {max_speed:g} m/s is planned, 8/9 of "
            f"limits.{vehicle.type}.max_speed"
        )
    ground = ground_for(road, vehicle)
    if not footprint_fits(ground, state[None, :3], vehicle.length, vehicle.width)[0]:
        raise RefusedError(
            f"{subject} is off the road: a footprint of {vehicle.length:g} m by "
            f"{vehicle.width:g} m has no room there{_pose_with_room(ground, vehicle, state[:3])}"
        )


def _pose_with_room(ground: Road, vehicle: Vehicle, pose: Floats) -> str:
    """Return the nearest pose (3,) with room for a vehicle in words; "" if it is far away."""
    nearest = nearest_pose_with_room(ground, pose, vehicle.length, vehicle.width, _SEARCH_RADIUS_M)
    if nearest is None:
        return ""
    shift = nearest[0][:2] - pose[:2]
    x, y = nearest[0][:2] + _ROUNDING_M * shift / np.hypot(*shift)
    return f"; the nearest pose with room is '{x:.2f} {y:.2f} {pose[2]:.4f}'"


def refuse_misfits(fit: Fit, starts: Floats, goals: Floats) -> None:
    """Refuse requested states that do not agree with others or with the recorded motion.

    Args:
        fit: with all start and end states.
        starts: (N, 4) requested ones, NaN where there is none.
        goals: (N, 4) the same for the end.

    Raises:
        RefusedError: two footprints overlap at the start or the end, or a vehicle that stands
            there is asked to drive.
    """
    _refuse_overlaps(fit, "start", starts, fit.requested.start)
    _refuse_driving(fit, "start", starts, primitive=0)
    _refuse_overlaps(fit, "goal", goals, fit.requested.end)
    _refuse_driving(fit, "goal", goals, primitive=-1)


def _refuse_overlaps(fit: Fit, end: str, requested: Floats, states: Floats) -> None:
    is_requested = ~np.isnan(requested[:, 0])
    for i, j in combinations(range(len(fit.vehicles)), 2):
        if is_requested[i] or is_requested[j]:
            a, b = fit.vehicles[i], fit.vehicles[j]
            gaps, *_ = footprint_gaps(a.half, states[[i], :3], b.half, states[[j], :3])
            if gaps[0] <= 0.0:
                raise RefusedError(
                    f"at the requested {end} vehicles {a.id} and {b.id} overlap by "
                    f"{-float(gaps[0]):.2f} m"
                )


def _refuse_driving(fit: Fit, end: str, requested: Floats, *, primitive: int) -> None:
    """Refuse a requested speed for a vehicle that stands in its first or last primitive."""
    for vehicle, fitted, state in zip(fit.vehicles, fit.fitted, requested, strict=True):
        if state[3] > _MAX_STANDING_SPEED_MPS and fitted.stands[primitive]:
            when = "throughout" if fitted.stands.all() else "there"
            raise RefusedError(
                f"vehicle {vehicle.id} stands {when} in the recording, so the speed at its {end} "
                f"must be 0, not {state[3]:g} m/s"
            )

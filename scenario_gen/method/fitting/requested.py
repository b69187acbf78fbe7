# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What is wrong with requested start and end states by themselves: speed, room on the road, room beside each other."""

from itertools import combinations

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import footprint_gaps
from scenario_gen.roads import footprint_fits, ground_for
from scenario_gen.types import Encounter, Fit, Road, TypeLimits

STAND = 0.05  # m/s, a speed below this is met by standing
NAMES = {"starts": "start", "goals": "goal"}


def refuse_impossible(
    encounter: Encounter, road: Road, starts: Floats, goals: Floats, limits: TypeLimits
) -> None:
    """Refuse states, (N, 4) each with NaN where none is requested, that no motion can have.

    Raises:
        RefusedError: one is faster than is planned for its type, or off the road; with figures.
    """
    for name, rows in (("starts", starts), ("goals", goals)):
        for vehicle, state in zip(encounter.vehicles, rows, strict=True):
            if np.isnan(state[0]):
                continue
            what = f"the {NAMES[name]} requested of vehicle {vehicle.id} (x {state[0]:.2f}, y {state[1]:.2f})"
            max_speed = limits.of(vehicle.type).planned.max_speed
            if state[3] > max_speed:
                raise RefusedError(
                    f"{what} has {state[3]:g} m/s; at most {max_speed:g} m/s is planned, 8/9 of limits.{vehicle.type}.max_speed"
                )
            if not footprint_fits(
                ground_for(road, vehicle), state[None, :3], vehicle.length, vehicle.width
            )[0]:
                raise RefusedError(
                    f"{what} is off the road: a footprint of {vehicle.length:g} m by {vehicle.width:g} m has no room there"
                )


def refuse_misfits(fit: Fit, starts: Floats, goals: Floats) -> None:
    """Refuse requested states, (N, 4) each, NaN where there is none, that do not go with others or with the template's motion.

    Raises:
        RefusedError: two footprints overlap at the start or the end, or a vehicle that stands there is asked to drive.
    """
    for name, rows, states, first in (
        ("starts", starts, fit.requested.start, True),
        ("goals", goals, fit.requested.end, False),
    ):
        requested = ~np.isnan(rows[:, 0])
        for (i, a), (j, b) in combinations(enumerate(fit.vehicles), 2):
            gap = float(footprint_gaps(a.half, states[[i], :3], b.half, states[[j], :3])[0][0])
            if gap <= 0.0 and (requested[i] or requested[j]):
                raise RefusedError(
                    f"at the requested {NAMES[name]} vehicles {a.id} and {b.id} overlap by {-gap:.2f} m"
                )
        for i in np.flatnonzero(requested).tolist():
            stands = fit.fitted[i].stands
            if rows[i, 3] > STAND and stands[0 if first else -1]:
                when = "throughout" if stands.all() else "there"
                raise RefusedError(
                    f"vehicle {fit.vehicles[i].id} stands {when} in the recording, so the speed at its {NAMES[name]} must be 0, "
                    f"not {rows[i, 3]:g} m/s"
                )

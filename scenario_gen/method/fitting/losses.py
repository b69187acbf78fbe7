# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The parts of a recorded encounter that a fit loses: turns, conflicts, lanes, passings."""

from collections.abc import Iterable, Iterator

import numpy as np

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.roads import lights_of
from scenario_gen.situation import LOSABLE, Track
from scenario_gen.types import LaneNetwork, Loss, Road, SignalStop

Tracks = tuple[Track, ...]


_EXTRAPOLATION_M = 30.0  # beyond the end of a path, straight on


class LostEncounterError(RefusedError):
    """The recording fits the road, but a part of its encounter would be lost there."""


def allowed_losses(allow: str) -> frozenset[str]:
    """Return the kinds of losses that `fitting.allow` names.

    Raises:
        InputError: it has another name.
    """
    known = {f"lost_{kind}": kind for kind in LOSABLE}
    names = [name.strip() for name in allow.split(",") if name.strip()]
    for name in names:
        if name not in known:
            raise InputError(
                f"parameter allow has {name!r}; choose from {', '.join(known)}, with commas"
            )
    return frozenset(known[name] for name in names)


def refuse_lost(losses: Iterable[Loss], allow: str, road: str) -> None:
    """Refuse a fit with losses that `allow` does not name.

    Raises:
        LostEncounterError: it has some; the message names the vehicles and the parameter.
    """
    allowed = allowed_losses(allow)
    refused = [loss for loss in losses if loss.kind in LOSABLE and loss.kind not in allowed]
    if refused:
        kinds = sorted(allowed | {loss.kind for loss in refused})
        names = ",".join(f"lost_{kind}" for kind in kinds)
        reasons = "; ".join(loss.message for loss in refused)
        raise LostEncounterError(
            f"road {road} has nowhere this encounter fits unchanged: {reasons}; "
            f"fitting.allow={names} accepts this"
        )


def find_unused(network: LaneNetwork, used: Iterable[int]) -> tuple[Loss, ...]:
    """Return the loss of arms of a drawn junction without vehicles, given the used lanes."""
    arms = network.arms
    arm_of = {k: arm for arm, lanes in arms.items() for k in lanes}
    unused = len(arms) - len({arm_of[k] for k in used if k in arm_of})
    if len(arms) < 3 or not unused:
        return ()
    are = "is" if unused == 1 else "are"
    message = (
        f"{unused} of the {len(arms)} arms of road {network.name} {are} unused: no recorded "
        "vehicle enters or leaves there"
    )
    return (Loss("arm", (), message),)


def lost_lights(stops: Iterable[SignalStop], placed: Tracks, road: Road) -> Iterator[Loss]:
    """Yield the stops at red of a recording where a road has no light."""
    network = road.lanes
    lights = lights_of(network) if network is not None and network.rules_kept else ()
    for stop in stops:
        curve, name = placed[stop.who].curve, placed[stop.who].vehicle.id
        points = curve.at(np.arange(0.0, curve.length + _EXTRAPOLATION_M, 0.5))
        if stop.stands and not any(light.leads_over(points[:, :2]) for light in lights):
            message = f"vehicle {name} stops at red, and the road has no light there"
            yield Loss("light", (name,), message)

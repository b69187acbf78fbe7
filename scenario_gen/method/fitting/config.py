# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of the fitting.

Among them the parts of a recorded encounter that a fit may lose: turns, conflicts, lanes,
passings.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.roads import lights_of, PlaceLimits
from scenario_gen.situation import FOLLOW_UP_S, LEAD_S, LOSABLE, Track
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


@dataclass(frozen=True)
class FittingConfig(Parameters):
    """Parameters of the fitting (paper III-A)."""

    placement: str = parameter(
        "auto",
        "how the recording is placed: in its own frame, on the road's lanes, or anywhere on the "
        "grid",
        choices=("auto", "identity", "lanes", "search"),
    )
    allow: str = parameter(
        "",
        "losses that a fit may have, separated by commas: "
        + ", ".join(f"lost_{kind} ({meaning})" for kind, meaning in LOSABLE.items()),
    )
    shorten: bool = parameter(
        True,
        "shorten a recording at its begin and end if it does not fit as a whole, as long as "
        "conflicts, orders, reactions, waits and turns remain",
    )
    lead: float = parameter(
        LEAD_S,
        "kept of a shortened track before the vehicle's first event",
        unit="s",
        low=0.0,
        high=60.0,
    )
    follow_up: float = parameter(
        FOLLOW_UP_S, "kept after its last event", unit="s", low=0.0, high=60.0
    )
    scale_low: float = parameter(0.8, "smallest accepted scale s of eq 9", low=0.01, high=1.0)
    scale_high: float = parameter(1.25, "largest accepted scale s of eq 9", low=1.0, high=1000.0)
    max_move: float = parameter(
        3.0, "farthest move of an anchor or a path", unit="m", low=0.0, high=100.0
    )
    clearance: float = parameter(
        0.5, "gap between the footprints of fitted vehicles", unit="m", low=0.0, high=5.0
    )
    margin: float = parameter(
        0.3,
        "room on each side of a footprint that the search wants",
        unit="m",
        low=0.0,
        high=5.0,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        allowed_losses(self.allow)

    @property
    def place_limits(self) -> PlaceLimits:
        """What may change where a recording is placed on lanes."""
        return PlaceLimits(
            self.scale_low,
            self.scale_high,
            self.clearance,
            self.max_move,
            allowed_losses(self.allow),
        )

    def accepts(self, scale: float) -> bool:
        """Return whether a scale s of eq 9 is near enough to one."""
        return self.scale_low <= scale <= self.scale_high

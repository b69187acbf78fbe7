# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of the fitting."""

from dataclasses import dataclass

from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.roads import PlaceLimits
from scenario_gen.situation import FOLLOW_UP_S, LEAD_S, LOSABLE


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

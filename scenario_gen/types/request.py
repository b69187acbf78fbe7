# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A request for an ego slot, states, targets or an order, by option or ROS parameter."""

from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.numerics import Floats
from scenario_gen.types.encounter import Encounter, vehicle_index
from scenario_gen.types.target import read_numbers, read_targets, split_pieces, Target

State = tuple[float, ...]  # x [m], y [m], yaw [rad] and, unless it is the template's, speed [m/s]
ENDS = ("starts", "goals")
ORDERS = ("keep", "free", "swap")
_FORM = "id: x y yaw [speed]"


@dataclass(frozen=True)
class Request(Parameters):
    """All that one request may demand."""

    ego: str = parameter(
        "",
        "id of the vehicle that is left out for a planner under test; its track is given instead",
    )
    starts: str = parameter(
        "",
        f"start states on the road, `{_FORM}`, vehicles parted by `;`; others are the fitting's",
        unit="m, rad, m/s",
    )
    goals: str = parameter("", f"end states, likewise `{_FORM}`", unit="m, rad, m/s")
    target: str = parameter(
        "",
        "ranges to aim at, of pet, ttc, gap, arrival_gap, closing_speed, blind_margin: "
        "`pet=0.5..1.5; ttc[1,2]=1..2`",
    )
    order: str = parameter(
        "keep",
        "who goes first at a conflict; keep: as in the recording, free: anyone, "
        "swap: the second vehicle at the closest crossing",
        choices=ORDERS,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ENDS:
            self.states(name)
        read_targets(self.target)

    @property
    def targets(self) -> tuple[Target, ...]:
        """The requested ranges."""
        return read_targets(self.target)

    @property
    def moves(self) -> bool:
        """Whether start or end states are requested, which requires a new fit and plan."""
        return bool(self.starts or self.goals)

    @property
    def plain(self) -> "Request":
        """The request without target and order."""
        return replace(self, target="", order="keep")

    def states(self, end: str) -> dict[str, State]:
        """Return the requested states at one end ("starts" or "goals"), by vehicle id.

        Raises:
            InputError: the text is not of the form; the message names the parameter and the piece.
        """
        return read_states(getattr(self, end), end)

    def rows(self, end: str, encounter: Encounter) -> Floats:
        """Return the requested states (N, 4) at one end, NaN where nothing is requested.

        Raises:
            InputError: a vehicle is not the encounter's; the message lists those that are.
        """
        rows = np.full((len(encounter.vehicles), 4), np.nan)
        for name, state in self.states(end).items():
            rows[vehicle_index(encounter, name, end), : len(state)] = state
        return rows

    def ego_of(self, encounter: Encounter) -> int | None:
        """Return the index of the vehicle that is left out, None if none is.

        Raises:
            InputError: there is no such vehicle.
        """
        return vehicle_index(encounter, self.ego, "ego") if self.ego else None


def read_states(text: str, end: str) -> dict[str, State]:
    """Return {vehicle id: state} of a text such as `1: 10.5 -1.75 0.0 8.0; 2: 3 4 1.57`.

    Raises:
        InputError: it is not of that form, a value is not finite, a speed is negative, or a
            vehicle comes twice.
    """
    states: dict[str, State] = {}
    for piece in split_pieces(text):
        name, _, numbers = piece.rpartition(":")
        name, state = name.strip(), read_numbers(numbers)
        if not name or len(state) not in (3, 4):
            raise InputError(
                f"{end}: {piece!r} is not of the form `{_FORM}` with finite numbers, "
                "e.g. `1: 10.5 -1.75 0.0 8.0`"
            )
        if len(state) == 4 and state[3] < 0.0:
            raise InputError(f"{end}: {piece!r} asks for a negative speed")
        if name in states:
            raise InputError(f"{end}: vehicle {name!r} comes twice")
        states[name] = state
    return states

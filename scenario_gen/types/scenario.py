# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A scenario: what is generated, checked and published."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any, TYPE_CHECKING

import numpy as np

from scenario_gen.base.errors import OutOfRangeError
from scenario_gen.numerics import canonical_poses, Floats, freeze, frozen, Ints
from scenario_gen.types.facts import Facts
from scenario_gen.types.motion import held, Motion
from scenario_gen.types.notes import Note
from scenario_gen.types.reaction import Reaction, ReactionGraph
from scenario_gen.types.target import Reached
from scenario_gen.types.vehicle import Vehicle

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, eq=False)
class Scenario(Motion):
    """The motion of N vehicles on a target road; its times start at 0 s.

    Attributes:
        acceleration: (N, T) m/s², longitudinal; linear between two samples.
        seed: of the request.
        index: number of the scenario within the request.
        frame_id: the road's frame, in which positions and headings are.
        reference_drive: only with an ego slot: the motion of the vehicle that was left out, as a
            scenario of it alone on the same clock. Both together were proven valid, so the slot
            can be driven.
        facts: what else is known about it.
    """

    acceleration: Floats
    seed: int = 0
    index: int = 0
    frame_id: str = "map"
    reference_drive: "Scenario | None" = None
    facts: Facts = Facts()

    def __post_init__(self) -> None:
        super().__post_init__()
        freeze(self, acceleration=held(frozen(self.acceleration), self.present))

    def __repr__(self) -> str:
        return f"Scenario({self.index}, {len(self.vehicles)} vehicles, {self.time[-1]:.1f} s)"

    @property
    def title(self) -> str:
        """Its name in messages."""
        return f"scenario {self.index}"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Floats:
        """Return x [m], y [m], heading [rad] and speed [m/s] of the vehicles (V, T, 4)."""
        x, y = np.moveaxis(self.position, -1, 0)
        return np.stack([x, y, self.heading, self.speed], axis=-1).astype(dtype or float)

    @property
    def array_names(self) -> tuple[str, ...]:
        """The names of the arrays (N, T, ...)."""
        return (*super().array_names, "acceleration")

    def _arrays_at(self, time: Floats) -> dict[str, Any]:
        """Return the arrays at times (M,) [s], by field."""
        acceleration = [np.interp(time, self.time, row) for row in self.acceleration]
        return {**super()._arrays_at(time), "acceleration": np.array(acceleration)}

    def with_facts(self, facts: Facts) -> "Scenario":
        """Return the scenario with other facts; its arrays are not checked again."""
        other = copy(self)
        freeze(other, facts=facts)
        return other

    def to_dataframe(self) -> "DataFrame":
        """Return a table with a row for each vehicle and each sample at which it is present.

        Columns: scenario (its index), vehicle (id), time [s], x, y [m], heading [rad],
        speed [m/s], acceleration [m/s²].
        """
        return dataframe([self])


def dataframe(scenarios: Iterable[Scenario]) -> "DataFrame":
    """Return scenarios as one table, as `Scenario.to_dataframe` does."""
    import pandas as pd

    tables = [
        pd.DataFrame(
            {"scenario": scenario.index}
            | scenario.columns()
            | {"acceleration": scenario.acceleration[scenario.is_present]}
        )
        for scenario in scenarios
    ]
    names = ("scenario", "vehicle", "time", "x", "y", "heading", "speed", "acceleration")
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=list(names))


@dataclass(frozen=True, eq=False)
class BoundaryStates:
    """What was requested of each vehicle's first and last instant.

    Attributes:
        start, end: (N, 4) x [m], y [m], yaw [rad], speed [m/s].
        freed: (N, 2, 2) metres and m/s by which a scenario's start and end may differ from that; 0
            where it was requested.
    """

    start: Floats
    end: Floats
    relaxed: Floats = field(default_factory=lambda: np.zeros((0, 2, 2)))

    def __post_init__(self) -> None:
        relaxed = self.relaxed if len(self.relaxed) else np.zeros((len(self.start), 2, 2))
        freeze(
            self,
            relaxed=frozen(relaxed),
            start=canonical_poses(self.start),
            end=canonical_poses(self.end),
        )


class Cause(StrEnum):
    """Why a candidate scenario was refused."""

    SPEED_PROFILE = "speed_profile"  # no speed profile meets lengths, end speeds and limits
    OVERLAP = "overlap"  # two footprints touch at some instant
    OFF_ROAD = "off_road"  # a footprint leaves drivable space
    WRONG_WAY = "wrong_way"  # a vehicle drives against its lane
    BOUNDARY_STATE = "boundary_state"  # start or end differs from what was requested
    SPEED = "speed"  # negative or above the limit
    LONGITUDINAL_ACCELERATION = "longitudinal_acceleration"
    LATERAL_ACCELERATION = "lateral_acceleration"
    CURVATURE = "curvature"
    PASSING_ORDER = "passing_order"  # not the template's order at a conflict
    STOP_NOT_KEPT = "stop_not_kept"  # a vehicle does not keep a stop of the template
    TRAFFIC_RULE = "traffic_rule"  # a stop line of the map or a right of way is violated
    REACTION = (
        "reaction"  # who reacts in the template goes too early, too late, or at another distance
    )
    SIDE_CLEARANCE = "side_clearance"  # who shares a lane side by side is nearer or farther
    CONFLICT_LOST = (
        "conflict_lost"  # the stretch in which all are there leaves out a conflict of the template
    )
    TOO_SHORT = "too_short"  # less than 5 s, or than half of a vehicle's recorded distance
    LATE_BRAKING = "late_braking"  # before a record ends, above 2 m/s² and harder than recorded
    NOT_FINITE = "not_finite"
    OUT_OF_RANGE = "out_of_range"  # not in the requested range; it was not checked
    UNUSABLE = "unusable_message"  # damaged, or in a frame other than the road's
    ALTERED = "altered_message"  # its bytes differ from those in its entry on scenarios/info
    UNUSUAL = "unusual"  # valid, but rarer among encounters of its kind than the template


def causes_in_words(refused: Mapping[Cause, int]) -> list[tuple[str, int]]:
    """Return causes of refusal with how many candidates each refused, the most frequent first."""
    words = ((cause.value.replace("_", " "), count) for cause, count in refused.items() if count)
    return sorted(words, key=lambda cause: (-cause[1], cause[0]))


@dataclass(frozen=True)
class Violation:
    """A violation: its cause, time [s], vehicles (indices), and a sentence with figures."""

    cause: Cause
    time: float
    vehicles: tuple[int, ...]
    message: str


@dataclass(frozen=True)
class Verdict:
    """The checker's answer for one scenario; valid if there is no violation.

    `conflicts` counts the template's conflicts that also exist in the scenario, `not_applicable`
    those that do not.
    """

    violations: tuple[Violation, ...] = ()
    conflicts: int = 0
    not_applicable: int = 0

    @property
    def valid(self) -> bool:
        """True if nothing is violated."""
        return not self.violations


@dataclass(frozen=True, eq=False)
class EgoSlot:
    """A vehicle that is left out for a planner, and its required states.

    Attributes:
        vehicle: its identity and footprint.
        start, goal: (4,) x [m], y [m], yaw [rad], speed [m/s].
    """

    vehicle: Vehicle
    start: Floats
    goal: Floats


@dataclass(frozen=True)
class ScenarioSet:
    """What a request got: valid scenarios, and an account of every candidate.

    `refused` counts refused candidates by their first cause; `adaptations` are notes on how they
    were drawn. `ego` is the vehicle that was left out for a planner under test, if one was; each
    scenario then has its reference drive. The scenarios of a large set are not in memory but drawn
    again whenever they are looked at. `reached` says what sampling towards a target came to.
    `graph` says who reacts to whom in the template (None: nobody looked), `reactions` are those
    that every scenario keeps.
    """

    requested: int
    scenarios: Sequence[Scenario]
    candidates: int
    refused: Counter[Cause] = field(default_factory=Counter)
    adaptations: Sequence[Note] = ()
    ego: EgoSlot | None = None
    reached: Reached | None = None
    reactions: tuple[Reaction, ...] = ()
    graph: ReactionGraph | None = None

    def __repr__(self) -> str:
        return f"ScenarioSet({len(self.scenarios)} of {self.candidates} candidates)"

    def __len__(self) -> int:
        return len(self.scenarios)

    def __iter__(self) -> Iterator[Scenario]:
        return iter(self.scenarios)

    def __getitem__(self, k: int) -> Scenario:
        """Return a scenario by its place in the set.

        Raises:
            OutOfRangeError: there is none.
        """
        try:
            return self.scenarios[k]
        except (IndexError, TypeError) as error:
            raise OutOfRangeError(
                f"no scenario [{k!r}]: a number from 0 to {len(self) - 1} is needed"
            ) from error

    @property
    def acceptance(self) -> float:
        """Share of candidates that were valid."""
        return len(self.scenarios) / self.candidates if self.candidates else 0.0


def split_off(scenario: Scenario, index: int) -> tuple[Scenario, Scenario]:
    """Return a scenario of all vehicles but one, and one of that one, both on the same clock."""
    rows = [n for n in range(len(scenario.vehicles)) if n != index]
    return _of(scenario, rows), _of(scenario, [index])


def with_witness(scenario: Scenario, index: int) -> Scenario:
    """Return the scenario without one vehicle, whose motion becomes the reference drive.

    It ends when the last of the other vehicles leaves.
    """
    others, witness = split_off(scenario, index)
    return replace(others.between(0, int(others.present[:, 1].max())), reference_drive=witness)


def join_ego(scenario: Scenario) -> Scenario:
    """Return the scenario of all vehicles, that of the reference drive last, if there is one."""
    witness = scenario.reference_drive
    if witness is None:
        return scenario
    parts = (replace(scenario, reference_drive=None), witness)
    time = np.unique(
        np.concatenate([part.time for part in parts])
    )  # whole nanoseconds, so equal instants are equal
    vehicles = (*scenario.vehicles, *witness.vehicles)
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(part, name)[:, _held(part, time)] for part in parts])
        for name in scenario.array_names
    }
    present = np.concatenate([np.searchsorted(time, part.time[part.present]) for part in parts])
    return replace(parts[0], vehicles=vehicles, time=time, **arrays, present=present)


def _held(part: Scenario, time: Floats) -> Ints:
    """Return the sample of a part at each time (T,) [s]; arbitrary where nobody is present."""
    return np.minimum(np.searchsorted(part.time, time), len(part.time) - 1)


def _of(scenario: Scenario, rows: Sequence[int]) -> Scenario:
    arrays = {
        name: getattr(scenario, name)[list(rows)] for name in (*scenario.array_names, "present")
    }
    return replace(scenario, vehicles=tuple(scenario.vehicles[n] for n in rows), **arrays)

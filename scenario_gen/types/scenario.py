# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A scenario: what is generated, checked and published."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

from scenario_gen.base.renaming import Renamed
from scenario_gen.numerics import (
    Bools,
    canonical_heading,
    canonical_poses,
    Floats,
    freeze,
    frozen,
    Ints,
)
from scenario_gen.types.encounter import columns_of, Vehicle
from scenario_gen.types.notes import Note
from scenario_gen.types.presence import ALWAYS, always, canonical_presence, held, mask
from scenario_gen.types.reaction import Reaction, ReactionGraph
from scenario_gen.types.target import Reached

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

NEARNESS = {"closest_approach": "gap", "pet": "pet"}
"""Facts that say how near vehicles come [m, s], and the figures (`UNITS`) that they are, of the most critical pair."""
FACTS = (
    *NEARNESS,
    "rarity",
    "weight",
    "target.",
    "order",
    "passing_order",
    "reactions",
    "search.",
)
"""How the names of a scenario's facts begin."""


@dataclass(frozen=True, eq=False)
class Scenario:
    """N vehicles over T instants on a target road.

    Between two instants the motion is defined: position is the cubic Hermite interpolant of the two positions and
    velocity vectors (speed along heading), heading is interpolated linearly. The checker proves validity of that motion.

    Attributes:
        vehicles: N identities and footprints.
        time: (T,) seconds from the scenario's start, strictly increasing, time[0] = 0.
        position: (N, T, 2) metres in the road's frame, of the footprint's centre.
        heading: (N, T) rad, unwrapped.
        speed: (N, T) m/s in the body frame, >= 0.
        acceleration: (N, T) m/s², longitudinal.
        seed: the request's seed; index: the scenario's number within the request.
        frame_id: the road's frame.
        present: (N, 2) first and last instant at which each vehicle is there, as in `Tracks`; default: everybody throughout.
        reference_drive: of a scenario with an ego slot: the motion of the vehicle that was left out, as a scenario of it alone
            on the same clock. Both together were proven valid, so the slot can be driven.
        facts: what else its entry in `scenarios/info` says: `closest_approach`, `pet`, `rarity`, `weight`, `target.…`, `order`,
            `passing_order`, `reactions`, `search.…` (FACTS).
    """

    vehicles: tuple[Vehicle, ...]
    time: Floats
    position: Floats
    heading: Floats
    speed: Floats
    acceleration: Floats
    seed: int = 0
    index: int = 0
    frame_id: str = "map"
    present: Ints = field(default_factory=lambda: ALWAYS)
    reference_drive: "Scenario | None" = None
    facts: Mapping[str, str] = field(default_factory=dict)
    witness = Renamed("reference_drive")

    def __post_init__(self) -> None:
        n, t = len(self.vehicles), len(self.time)
        present = canonical_presence(self.present, n, t, f"scenario {self.index}")
        freeze(
            self, time=frozen(np.round(self.time, 9)), present=present
        )  # whole nanoseconds, as on the wire
        freeze(self, heading=held(canonical_heading(self.heading), present))
        for name in ("position", "speed", "acceleration"):
            freeze(self, **{name: held(frozen(getattr(self, name)), present)})

    def __repr__(self) -> str:
        return f"Scenario({self.index}, {len(self.vehicles)} vehicles, {self.time[-1]:.1f} s)"

    @property
    def all_present(self) -> bool:
        """Whether every vehicle is there throughout."""
        return always(self.present, len(self.time))

    @property
    def there(self) -> Bools:
        """(N, T) whether each vehicle is there at each instant."""
        return mask(self.present, len(self.time))

    def to_dataframe(self) -> "DataFrame":
        """Return a row for each vehicle and instant at which it is there.

        Columns: scenario (its index), vehicle (id), time [s], x, y [m], heading [rad], speed [m/s], acceleration [m/s²].
        """
        return dataframe([self])

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the vehicles' paths, as `scenario_gen.plot` does.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        import scenario_gen

        return scenario_gen.plot(self, ax)


def dataframe(scenarios: Iterable[Scenario]) -> "DataFrame":
    """Return scenarios as one table, as `Scenario.to_dataframe` does."""
    import pandas as pd

    tables = [
        pd.DataFrame(
            {"scenario": one.index}
            | columns_of(one)
            | {"acceleration": one.acceleration[one.there]}
        )
        for one in scenarios
    ]
    names = ("scenario", "vehicle", "time", "x", "y", "heading", "speed", "acceleration")
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=list(names))


@dataclass(frozen=True, eq=False)
class BoundaryStates:
    """What was requested of each vehicle's first and last instant.

    Attributes:
        start, end: (N, 4) x [m], y [m], yaw [rad], speed [m/s].
        freed: (N, 2, 2) metres and m/s by which a scenario's start and end may differ from that; 0 where it was requested.
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
    TRAFFIC_RULE = "traffic_rule"  # a vehicle runs a stop line of the map, or takes another one's right of way
    REACTION = (
        "reaction"  # who reacts in the template goes too early, too late, or at another distance
    )
    CONFLICT_LOST = (
        "conflict_lost"  # the stretch in which all are there leaves out a conflict of the template
    )
    NOT_FINITE = "not_finite"
    OUT_OF_RANGE = "out_of_range"  # not in the requested range; it was not checked
    UNUSUAL = "unusual"  # valid, but rarer among encounters of its kind than the template


def causes_in_words(refused: Mapping[Cause, int]) -> list[tuple[str, int]]:
    """Return causes of refusal with how many candidates each refused, the most frequent first."""
    words = ((cause.value.replace("_", " "), count) for cause, count in refused.items() if count)
    return sorted(words, key=lambda cause: (-cause[1], cause[0]))


@dataclass(frozen=True)
class Violation:
    """One thing wrong with a scenario: its cause, when [s], which vehicles (indices), and a sentence with the figures."""

    cause: Cause
    time: float
    vehicles: tuple[int, ...]
    message: str


@dataclass(frozen=True)
class Verdict:
    """The checker's answer for one scenario; valid if there is no violation.

    `conflicts` counts the template's conflicts that also exist in the scenario, `not_applicable` those that do not.
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
    """A vehicle that is left out for a planner, and the states (4,) x [m], y [m], yaw [rad], speed [m/s] required of it."""

    vehicle: Vehicle
    start: Floats
    goal: Floats


@dataclass(frozen=True)
class ScenarioSet:
    """What a request got: valid scenarios, and an account of every candidate.

    `refused` counts refused candidates by their first cause; `adaptations` are notes on how they were drawn. `ego` is the
    vehicle that was left out for a planner under test, if one was; each scenario then has its reference drive.
    The scenarios of a large set are not in memory but drawn again whenever they are looked at. `reached` says what sampling
    towards a target came to.
    `graph` says who reacts to whom in the template (None: nobody looked), `reactions` are those that every scenario keeps.
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
        return self.scenarios[k]

    @property
    def acceptance(self) -> float:
        """Share of candidates that were valid."""
        return len(self.scenarios) / self.candidates if self.candidates else 0.0

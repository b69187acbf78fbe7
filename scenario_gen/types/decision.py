# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A decision at a conflict: which driver decides, what he does, and how likely this is."""

from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any


class Outcome(StrEnum):
    """What a driver does at a conflict; all but `GOES_FIRST` let the other vehicle go first."""

    GOES_FIRST = "goes first"
    GOES_SECOND = "goes second"  # without slowing down
    ROLLS = "rolls"  # slows down, and does not stand
    STOPS = "stops"


@dataclass(frozen=True)
class Decision:
    """What one vehicle does where its path meets that of another vehicle.

    Attributes:
        who: ROS name of the vehicle that decides.
        whom: ROS name of the other vehicle.
        outcome: what `who` does.
        lag: seconds by which `whom` would enter the conflict area later than `who`, if neither
            slowed down.
        probability: share of all scenarios from the encounter that have this outcome.
    """

    who: str
    whom: str
    outcome: Outcome
    lag: float
    probability: float

    @property
    def first(self) -> str:
        """ROS name of the vehicle that goes first."""
        return self.who if self.outcome is Outcome.GOES_FIRST else self.whom

    @property
    def second(self) -> str:
        """ROS name of the vehicle that goes second."""
        return self.whom if self.outcome is Outcome.GOES_FIRST else self.who

    def document(self) -> dict[str, Any]:
        """Return the decision as a JSON document."""
        return asdict(self)

    def __str__(self) -> str:
        return f"vehicle {self.who} {self.outcome}"

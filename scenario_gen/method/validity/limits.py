# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a valid scenario must keep to; every limit is a parameter."""

from dataclasses import dataclass, replace

from scenario_gen.base.parameters import parameter
from scenario_gen.situation import Situation
from scenario_gen.types import TypeLimits

_SHARE_OF_GAP, _MOST_CLEARANCE = 0.5, 0.5  # of the template's least gap; m


@dataclass(frozen=True)
class Limits(TypeLimits):
    """Limits of the checker; those of motion are of each type.

    Speed and heading are linear between samples, position is the cubic of `Scenario`.
    """

    position_tolerance: float = parameter(
        0.1, "start and end positions are this near to the request", unit="m", low=0.0
    )
    speed_tolerance: float = parameter(
        0.1, "start and end speeds are this near to the request", unit="m/s", low=0.0
    )
    stand_speed: float = parameter(
        0.1, "a vehicle that stands in the recording is slower than this", unit="m/s", low=0.0
    )
    creep_speed: float = parameter(
        0.5,
        "a vehicle that waits in the recording, but moves slowly, is slower than this",
        unit="m/s",
        low=0.0,
    )
    stand_duration: float = parameter(
        1.0, "shortest stand or creep that counts as a wait", unit="s", low=0.01
    )
    min_clearance: float = parameter(
        -1.0,
        "smallest gap between two footprints, by their best separating axis; a gap of 0 (touching) is an overlap; -1: half the "
        "recording's smallest gap, at most 0.5 m",
        unit="m",
        low=-1.0,
    )
    slip: float = parameter(
        0.2,
        "displacement over time may differ from speed along heading by this, ahead and sideways",
        unit="m/s",
        low=0.0,
    )
    slip_share: float = parameter(0.03, "and by this share of the speed", low=0.0)
    acceleration_tolerance: float = parameter(
        0.5,
        "change of speed over time may leave the range of the two samples' accelerations by this, and accelerations taken from "
        "the positions alone may exceed their limits by it",
        unit="m/s²",
        low=0.0,
    )
    presence_margin: float = parameter(
        1.0,
        "a vehicle drives on for this long before it comes and after it goes, at the speed and rate of turn that it has there; "
        "nobody may be where it then is",
        unit="s",
        low=0.0,
        high=10.0,
    )
    gap_share: float = parameter(
        0.5,
        "who passes second does so with the recording's gap behind the other's clearing, more or less by this share",
        low=0.0,
    )
    anticipation: float = parameter(
        0.5,
        "or earlier by this, but not before that one has cleared unless it does in the recording; and who stands for another one "
        "drives off at most this long before that one has cleared, or earlier by this than in the recording",
        unit="s",
        low=0.0,
    )
    patience: float = parameter(1.0, "and later by this", unit="s", low=0.0)
    headway_share: float = parameter(
        0.5,
        "a follower's median time gap is at most the recording's greatest, and greater by this share",
        low=0.0,
        high=10.0,
    )
    floor_share: float = parameter(
        0.8,
        "a vehicle comes as near to one ahead of it in its lane, bumper to bumper, as this share of the smallest gap that it has "
        "in the recording at such a speed (2 m/s more or less)",
        low=0.0,
        high=1.0,
    )
    least_headway: float = parameter(
        0.5,
        "and above 3 m/s no nearer than this time gap, unless it does in the recording",
        unit="s",
        low=0.0,
        high=5.0,
    )
    time_resolution: float = parameter(
        1e-6,
        "what cannot be proven over an interval this short is refused",
        unit="s",
        low=1e-9,
        high=1.0,
    )

    @property
    def clearance(self) -> float:
        """Gap [m] that must be exceeded; 0 where it follows a template and none is known."""
        return max(self.min_clearance, 0.0)

    def for_template(self, situation: Situation) -> "Limits":
        """Return the limits of scenarios of a template, whose own least gap says how near vehicles may come to one another."""
        if self.min_clearance >= 0.0:
            return self
        return replace(
            self,
            min_clearance=min(max(_SHARE_OF_GAP * situation.least_gap, 0.0), _MOST_CLEARANCE),
        )

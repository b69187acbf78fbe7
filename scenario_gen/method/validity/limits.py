# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The limits of the checker; every limit is a parameter."""

from dataclasses import dataclass, replace

from scenario_gen.base.parameters import parameter
from scenario_gen.situation import Situation
from scenario_gen.types import TypeLimits

_LEAST_GAP_SHARE = 0.5  # of the template's smallest gap that must remain
_MAX_CLEARANCE_M = 0.5  # however far apart the template's vehicles are


@dataclass(frozen=True)
class Limits(TypeLimits):
    """Limits of the checker, with the limits of motion of each road-user type.

    Speed and heading are linear between samples, position is the cubic of `Scenario`.
    """

    position_tolerance: float = parameter(
        0.1, "largest distance of start and end positions from the request", unit="m", low=0.0
    )
    speed_tolerance: float = parameter(
        0.1, "largest difference of start and end speeds from the request", unit="m/s", low=0.0
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
        "smallest gap between two footprints, by their best separating axis; a gap of 0 "
        "(touching) is an overlap; -1: half the recording's smallest gap, at most 0.5 m",
        unit="m",
        low=-1.0,
    )
    slip: float = parameter(
        0.2,
        "largest difference of displacement over time from speed along heading, ahead and "
        "sideways",
        unit="m/s",
        low=0.0,
    )
    slip_share: float = parameter(0.03, "in addition, as a share of the speed", low=0.0)
    acceleration_tolerance: float = parameter(
        0.5,
        "by how much the change of speed over time may leave the range of the two samples' "
        "accelerations, and accelerations from positions may exceed their limits",
        unit="m/s²",
        low=0.0,
    )
    presence_margin: float = parameter(
        1.0,
        "time that a vehicle is present before it enters and after it leaves, at its speed and "
        "rate of turn there; no other vehicle may be in its place then",
        unit="s",
        low=0.0,
        high=10.0,
    )
    gap_share: float = parameter(
        0.8,
        "the second vehicle passes with the recording's gap behind the first one's clearing, "
        "changed by at most this share",
        low=0.0,
    )
    anticipation: float = parameter(
        0.5,
        "or earlier by this, but not before the first one has cleared unless it does so in the "
        "recording; and a vehicle that stands for another one drives off at most this long before "
        "that one has cleared, or earlier by this than in the recording",
        unit="s",
        low=0.0,
    )
    patience: float = parameter(3.0, "or later by this", unit="s", low=0.0)
    headway_share: float = parameter(
        1.0,
        "a follower's median time gap exceeds the recording's greatest one by at most this share",
        low=0.0,
        high=10.0,
    )
    floor_share: float = parameter(
        0.6,
        "smallest bumper-to-bumper gap to a vehicle ahead in the same lane, as a share of the "
        "smallest one in the recording at a similar speed (2 m/s more or less)",
        low=0.0,
        high=1.0,
    )
    least_headway: float = parameter(
        0.5,
        "smallest time gap above 3 m/s, unless the recording has a smaller one",
        unit="s",
        low=0.0,
        high=5.0,
    )
    time_resolution: float = parameter(
        1e-6,
        "a scenario is refused if it is not proven over intervals this short",
        unit="s",
        low=1e-9,
        high=1.0,
    )

    @property
    def clearance(self) -> float:
        """Gap [m] that must be exceeded; 0 where it depends on a template that is not known."""
        return max(self.min_clearance, 0.0)

    def for_template(self, situation: Situation) -> "Limits":
        """Return the limits for scenarios of a template, whose smallest gap sets the clearance."""
        if self.min_clearance >= 0.0:
            return self
        clearance = max(_LEAST_GAP_SHARE * situation.least_gap, 0.0)
        return replace(self, min_clearance=min(clearance, _MAX_CLEARANCE_M))

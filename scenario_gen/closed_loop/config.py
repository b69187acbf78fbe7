# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of a drive in closed loop."""

from dataclasses import dataclass, field

from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.base.road_users import TypeLimits

REPLAY, REACTIVE, COMMITTED = "replay", "reactive", "committed"
FORESIGHT = {REACTIVE: 5.0, COMMITTED: 0.5}
"""Time [s] for which drivers predict an ego that they need not wait for."""


@dataclass(frozen=True)
class ObservationConfig(Parameters):
    """How the ego observes the other vehicles; by default everywhere, exactly and at once."""

    delay: int = parameter(
        0, "number of steps after which the ego observes the others", low=0, high=100
    )
    position_noise: float = parameter(
        0.0, "standard deviation of observed x and y", unit="m", low=0.0, high=100.0
    )
    speed_noise: float = parameter(
        0.0, "standard deviation of observed speeds", unit="m/s", low=0.0, high=100.0
    )
    seed: int = parameter(0, "seed of the noise", low=0, high=2**32 - 1)
    range: float = parameter(
        0.0,
        "distance of the centres up to which others are observed; 0: any",
        unit="m",
        low=0.0,
        high=1e6,
    )
    occlusion: bool = parameter(
        False, "vehicles, obstacles and the surroundings of the road hide others"
    )
    setback: float = parameter(
        2.5,
        "distance from the road's edge at which the surroundings hide others: the width of a "
        "pavement (RASt 06)",
        unit="m",
        low=0.0,
        high=100.0,
    )

    @property
    def is_perfect(self) -> bool:
        """Whether the ego observes everything exactly and at once."""
        noise = self.position_noise or self.speed_noise
        return not (self.delay or noise or self.range or self.occlusion)

    def __str__(self) -> str:
        parts = []
        if self.delay:
            parts.append(f"delay {self.delay} steps")
        if self.position_noise or self.speed_noise:
            noise = f"{self.position_noise:g} m and {self.speed_noise:g} m/s"
            parts.append(f"noise {noise} (seed {self.seed})")
        if self.range:
            parts.append(f"range {self.range:g} m")
        if self.occlusion:
            parts.append(f"occlusion by vehicles and {self.setback:g} m beside the road")
        return ", ".join(parts) or "perfect"


@dataclass(frozen=True)
class ClosedLoopConfig(Parameters):
    """The other drivers, the ego's limits, the end of a drive, and the verdict's thresholds."""

    step: float = parameter(0.1, "time between two decisions", unit="s", low=0.005, high=0.5)
    policy: str = parameter(
        REACTIVE,
        "the others replay the scenario, react to the ego early, or only to an evident conflict",
        choices=(REPLAY, REACTIVE, COMMITTED),
    )
    reaction: float = parameter(
        1.0,
        "mean reaction time to the ego; each driver's is drawn from half to one and a half of it",
        unit="s",
        low=0.0,
        high=5.0,
    )
    headway: float = parameter(
        1.2,
        "median time gap of drivers that follow nobody in the recording; others keep theirs (IDM)",
        unit="s",
        low=0.0,
        high=5.0,
    )
    standstill_gap: float = parameter(
        2.0, "gap at which the others stop behind another (IDM)", unit="m", low=0.0, high=20.0
    )
    acceleration: float = parameter(
        2.0, "largest acceleration of the others", unit="m/s²", low=0.1, high=10.0
    )
    comfortable_braking: float = parameter(
        3.0, "braking of the others where it suffices", unit="m/s²", low=0.1, high=10.0
    )
    strongest_braking: float = parameter(
        8.0, "strongest braking of the others for the ego", unit="m/s²", low=0.5, high=12.0
    )
    jerk: float = parameter(
        9.8,
        "largest jerk of the others, where comfortable braking does not suffice",
        unit="m/s³",
        low=1.0,
        high=1e6,
    )
    patience: float = parameter(
        3.5,
        "median time after which a vehicle stops waiting for one that hardly moves",
        unit="s",
        low=0.0,
        high=1e6,
    )
    observation: ObservationConfig = field(default_factory=ObservationConfig)
    limits: TypeLimits = field(default_factory=TypeLimits)
    ego_curvature_rate: float = parameter(
        0.3,
        "how fast the ego's curvature changes: the rate of its steering",
        unit="1/(m s)",
        low=0.001,
        high=20.0,
    )
    overtime: float = parameter(
        1.0,
        "longest drive: this multiple of the scenario's duration, plus 5 s",
        low=1.0,
        high=10.0,
    )
    goal_width: float = parameter(
        2.0,
        "greatest lateral distance at which the ego passes the goal",
        unit="m",
        low=0.1,
        high=50.0,
    )
    hard_braking: float = parameter(
        4.0,
        "deceleration that counts as hard braking, also of a vehicle whose turn the ego takes",
        unit="m/s²",
        low=0.1,
        high=20.0,
    )
    off_road_depth: float = parameter(
        0.1,
        "depth outside the drivable area from which a footprint is off the road",
        unit="m",
        low=0.0,
        high=5.0,
    )
    criteria: str = parameter(
        "",
        "further criteria that a drive must meet, separated by commas: names of installed ones or "
        "MODULE:CLASS, with e.g. <0.5 for another threshold",
    )
    repeat: int = parameter(
        1,
        "times that each scenario is driven, to see whether the drives are the same",
        low=1,
        high=10,
    )
    drive_time: float = parameter(
        600.0,
        "longest computation of a planner for one drive; the drive fails after it",
        unit="s",
        low=0.1,
        high=1e6,
    )

    def facts(self) -> dict[str, str]:
        """Return the facts that every file of verdicts states."""
        return {"policy": self.policy, "observation": str(self.observation)}

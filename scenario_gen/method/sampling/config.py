# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of sampling."""

from dataclasses import dataclass, replace

from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.types import VehicleType

_SHARES_OF_ONE_DRIVER = {
    "arrival_sigma": 0.0,
    "pace_sigma": 0.0,
    "wait_sigma": 0.0,
    "end_speed_sigma": 0.0,
    "gap_sigma": 0.0,
    "headway_sigma": 0.0,
    "strength_sigma": 0.0,
    "leave_out": 0.0,
    "longitudinal_sigma": 0.6,
    "time_sigma": 2.0 / 3.0,
    "duration_tolerance": 1.0 / 3.0,
}
"""By which one driver varies from day to day, over what drivers differ by."""


@dataclass(frozen=True)
class SamplingConfig(Parameters):
    """What varies from scenario to scenario, and by how much.

    Source: σ_f and l are those of eq 14, σ_ω that of eq 13; the others are not in the paper.
    """

    drivers: float = parameter(
        1.0,
        "how much drivers differ; 1: as recorded drivers do, 0: one driver, with one clock and "
        "recorded sizes, start and end states. Spreads are stated for 1",
        low=0.0,
        high=1.0,
    )
    arrival_sigma: float = parameter(
        2.0,
        "between drivers: standard deviation of each vehicle's shift in time relative to the "
        "others",
        unit="s",
        low=0.0,
        high=10.0,
    )
    pace_sigma: float = parameter(
        0.2,
        "between drivers: standard deviation of each vehicle's pace, as a share",
        low=0.0,
        high=0.3,
    )
    wait_sigma: float = parameter(
        2.0,
        "between drivers: standard deviation of the length of each wait",
        unit="s",
        low=0.0,
        high=10.0,
    )
    end_speed_sigma: float = parameter(
        2.0,
        "between drivers: standard deviation of start and end speeds",
        unit="m/s",
        low=0.0,
        high=5.0,
    )
    gap_sigma: float = parameter(
        1.5,
        "between drivers: standard deviation of the gap behind a vehicle to which one yields",
        unit="s",
        low=0.0,
        high=5.0,
    )
    headway_sigma: float = parameter(
        0.6,
        "between drivers: standard deviation of the logarithm of a follower's time gap",
        low=0.0,
        high=1.0,
    )
    strength_sigma: float = parameter(
        0.6,
        "between drivers: standard deviation of the logarithm of braking and of acceleration",
        low=0.0,
        high=1.0,
    )
    leave_out: float = parameter(
        0.9,
        "largest share of the time before the first conflict, and after the last one, that a "
        "scenario leaves out; scaled by `drivers`",
        low=0.0,
        high=1.0,
    )
    place_sigma: float = parameter(
        0.2, "standard deviation of the place in the lane", unit="m", low=0.0, high=2.0
    )
    sizes: str = parameter(
        "catalogue",
        "sizes of cars, from a catalogue of eight or as recorded",
        choices=("catalogue", "recorded"),
    )
    ego: str = parameter(
        "keep",
        "start and end states of the vehicle that is left out; `keep`: as recorded, `free`: "
        "varied like those of the others",
        choices=("keep", "free"),
    )
    reactions: str = parameter(
        "keep",
        "`keep`: followers and yielders of the recording react in the scenarios, too; "
        "`none`: no vehicle reacts",
        choices=("keep", "none"),
    )
    decisions: str = parameter(
        "recorded",
        "`recorded`: who goes first stays as recorded; `drawn`: other outcomes that drivers would "
        "have chosen get sets of their own, with counts by their probability",
        choices=("recorded", "drawn"),
    )
    decision_rate: float = parameter(
        0.8,
        "drawn: β of P(goes first) = 1 / (1 + exp(-β lag)), fitted to recorded turns, crossings "
        "and merges",
        unit="1/s",
        low=0.0,
        high=10.0,
    )
    offered_lag_sigma: float = parameter(
        3.0,
        "drawn: standard deviation of the offered lag, by which the other vehicle would arrive "
        "later if nobody slowed down",
        unit="s",
        low=0.1,
        high=10.0,
    )
    freedom: float = parameter(
        2.5, "standard deviations at which variations are truncated", low=0.5, high=4.0
    )
    lateral_sigma: float = parameter(
        0.3,
        "σ_f: standard deviation across the route, between anchors",
        unit="m",
        low=0.0,
        high=10.0,
    )
    lateral_length: float = parameter(
        40.0, "l: length scale of the deviation along the route", unit="m", low=1.0, high=1000.0
    )
    observation_sigma: float = parameter(
        1.0,
        "σ_ω: standard deviation across the route at an interior anchor",
        unit="m",
        low=1e-3,
        high=10.0,
    )
    steering: float = parameter(
        1.0, "lateral corrections of a driver, over those in the recording", low=0.0, high=10.0
    )
    longitudinal_sigma: float = parameter(
        2.0,
        "σ_s: standard deviation along the route, at the same time as in the recording; 60 % of "
        "it with one driver",
        unit="m",
        low=0.0,
        high=10.0,
    )
    longitudinal_time: float = parameter(
        4.0, "time scale of displacements along the route", unit="s", low=0.1, high=1000.0
    )
    time_sigma: float = parameter(
        1.5,
        "σ_t: standard deviation of the changepoint clock that all vehicles share; two thirds of "
        "it with one driver",
        unit="s",
        low=0.0,
        high=10.0,
    )
    duration_tolerance: float = parameter(
        0.3,
        "share by which a scenario may be longer or shorter; a third of it with one driver",
        low=0.0,
        high=0.5,
    )
    fixed_duration: bool = parameter(False, "keep the recording's duration")
    max_jerk: float = parameter(
        0.0,
        "largest jerk along the route; 0: 1.2 times the recording's, 1.0 m/s³ at least",
        unit="m/s³",
        low=0.0,
        high=100.0,
    )
    bend_acceleration: float = parameter(
        0.0,
        "lateral acceleration above which the clock is slowed before bends; 0: 1.2 times the "
        "recording's, 2 m/s² at least",
        unit="m/s²",
        low=0.0,
        high=10.0,
    )
    max_stretch: float = parameter(
        0.2,
        "share by which the clock may be longer than the recording's, where bends or lengths "
        "need it",
        low=0.0,
        high=1.0,
    )
    attempts: int = parameter(
        20, "candidates drawn per requested scenario, at most", low=1, high=10_000
    )

    @property
    def scaled(self) -> "SamplingConfig":
        """The parameters of candidates: spreads at `drivers`."""
        spreads = {
            name: getattr(self, name) * (share + (1.0 - share) * self.drivers)
            for name, share in _SHARES_OF_ONE_DRIVER.items()
        }
        return replace(self, **spreads)

    def of(self, kind: VehicleType) -> "SamplingConfig":
        """Return the parameters for a vehicle type: slow types vary less than cars."""
        share = kind.varies
        return replace(
            self,
            end_speed_sigma=share * self.end_speed_sigma,
            longitudinal_sigma=share * self.longitudinal_sigma,
            strength_sigma=share * self.strength_sigma,
        )

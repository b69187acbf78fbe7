# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of sampling."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.types import VehicleType

POPULATION = {
    "arrival_sigma": 2.0,
    "pace_sigma": 0.18,
    "wait_sigma": 2.0,
    "end_speed_sigma": 1.2,
    "leave_out": 0.9,
}
"""What `population` frees, at least: as wide as encounters differ; which scenarios remain, the population decides."""


@dataclass(frozen=True)
class SamplingConfig(Parameters):
    """What varies from scenario to scenario, and by how much; the limits of motion are `TypeLimits`.

    Source: σ_f and l of eq 14, σ_ω of eq 13; the others are ours.
    """

    variety: str = parameter(
        "wide",
        "what is free: `narrow` keeps one clock, sizes, start and end states; `wide` frees them, each by its parameter; "
        "`population` frees them more, and keeps what is usual among recorded encounters of the kind",
        choices=("narrow", "wide", "population"),
    )
    arrival_sigma: float = parameter(
        1.5,
        "wide: standard deviation of each vehicle's own shift in time against the others",
        unit="s",
        low=0.0,
        high=10.0,
    )
    pace_sigma: float = parameter(
        0.06, "wide: standard deviation of each vehicle's own pace, as a share", low=0.0, high=0.2
    )
    wait_sigma: float = parameter(
        1.0, "wide: standard deviation of the length of each wait", unit="s", low=0.0, high=10.0
    )
    end_speed_sigma: float = parameter(
        0.4, "wide: standard deviation of start and end speeds", unit="m/s", low=0.0, high=5.0
    )
    leave_out: float = parameter(
        0.0,
        "wide: share of the time before the first conflict, and of that after the last, that a scenario leaves out at most",
        low=0.0,
        high=1.0,
    )
    place_sigma: float = parameter(
        0.2, "wide: standard deviation of the place in the lane", unit="m", low=0.0, high=2.0
    )
    sizes: str = parameter(
        "catalogue",
        "wide: sizes of cars, from the catalogue of eight or as recorded",
        choices=("catalogue", "recorded"),
    )
    ego: str = parameter(
        "keep",
        "wide: start and end states of the vehicle that is left out; `keep`: as recorded, `free`: free as those of the others",
        choices=("keep", "free"),
    )
    reactions: str = parameter(
        "keep",
        "wide: `keep`: followers and yielders of the recording react in the scenarios, too; `none`: nobody does",
        choices=("keep", "none"),
    )
    freedom: float = parameter(
        2.5, "wide: standard deviations at which all that is free is cut", low=0.5, high=4.0
    )
    lateral_sigma: float = parameter(
        0.3,
        "σ_f: standard deviation across the route, between anchors",
        unit="m",
        low=0.0,
        high=10.0,
    )
    lateral_length: float = parameter(
        40.0, "l: distance along the route over which it varies", unit="m", low=1.0, high=1000.0
    )
    observation_sigma: float = parameter(
        1.0,
        "σ_ω: standard deviation across the route at an interior anchor",
        unit="m",
        low=1e-3,
        high=10.0,
    )
    steering: float = parameter(
        1.0,
        "how much a driver corrects to the side, over what the recording's does",
        low=0.0,
        high=10.0,
    )
    longitudinal_sigma: float = parameter(
        1.2,
        "σ_s: standard deviation along the route, at the same time of the recording",
        unit="m",
        low=0.0,
        high=10.0,
    )
    longitudinal_time: float = parameter(
        4.0, "time over which displacements along the route vary", unit="s", low=0.1, high=1000.0
    )
    time_sigma: float = parameter(
        1.0,
        "σ_t: standard deviation of the changepoint clock that all vehicles share",
        unit="s",
        low=0.0,
        high=10.0,
    )
    duration_tolerance: float = parameter(
        0.1, "share by which a scenario may be longer or shorter", low=0.0, high=0.5
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
        "lateral acceleration above which the pace is lowered ahead of bends; 0: 1.2 times the recording's, 2 m/s² at least",
        unit="m/s²",
        low=0.0,
        high=10.0,
    )
    max_stretch: float = parameter(
        0.2,
        "share by which the clock may be longer than the recording's, where bends or lengths need it",
        low=0.0,
        high=1.0,
    )
    attempts: int = parameter(
        20, "candidates drawn per requested scenario, at most", low=1, high=10_000
    )

    @property
    def drawn(self) -> "SamplingConfig":
        """The parameters that candidates are drawn with: for `population` those of a `wide` that is wider."""
        return (
            replace(self, variety="wide").at_least(POPULATION)
            if self.variety == "population"
            else self
        )

    def of(self, kind: VehicleType) -> "SamplingConfig":
        """Return the parameters for one of a type, whose speeds and places vary less than a car's if it is slow."""
        share = kind.varies
        return replace(
            self,
            end_speed_sigma=share * self.end_speed_sigma,
            longitudinal_sigma=share * self.longitudinal_sigma,
        )

    def at_least(self, least: Mapping[str, float]) -> "SamplingConfig":
        """Return the parameters with those named at least so large."""
        return replace(
            self, **{name: max(value, getattr(self, name)) for name, value in least.items()}
        )

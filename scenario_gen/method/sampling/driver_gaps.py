# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How drivers differ from each other: the gap that another driver accepts, or keeps.

A reaction's residual is by what one driver varies from day to day. Another driver passes behind
the same vehicle with another gap, or follows with another headway. Each reaction has one number
for this: a delay [s] beside the residual,

- yielder: Δ ~ N(0, σ), cut where the certificate would refuse the gap. Half of Δ is a longer or
  shorter approach, or wait, for the other vehicle; half is a later or earlier drive;
- follower: h (exp(N(0, σ)) - 1) with the recorded time gap h, cut in the same way.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import math

import numpy as np
from scipy import special

from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.time_warp import MIN_RATE_RATIO, smooth_step
from scenario_gen.method.validity import allowed_gap, Limits
from scenario_gen.numerics import Floats
from scenario_gen.types import FOLLOW, Reaction


@dataclass(frozen=True)
class _Tuning:
    """Choices without a source.

    Attributes:
        approach: s before the entry over which a yielder that does not stand is delayed.
        approach_share: of the delay; the rest delays the whole drive.
        min_approach: s of an approach that can be longer or shorter.
        margin: s of the allowed gap that are left to the residual.
        ample_headway: s; a greater time gap may become as small as this.
        nearer_share: of the shortest time gap, by which a follower is nearer.
        farther_share: of the allowed rise of the greatest time gap, by which it is farther.
    """

    approach: float = 5.0
    approach_share: float = 0.5
    min_approach: float = 1.5
    margin: float = 0.5
    ample_headway: float = 3.0
    nearer_share: float = 0.35
    farther_share: float = 0.8


_TUNING = _Tuning()
_PEAK_SLOPE_RATIO = 1.875  # of the smooth step


@dataclass(frozen=True, eq=False)
class DriverGap:
    """The delay of a driver in one reaction.

    Attributes:
        basis: (G,) share of the delay at template times.
        rate: (G,) its derivative [1/s].
        sigma: standard deviation of its number: seconds, or of the logarithm of a time gap.
        headway: s, the recorded time gap of a follower; 0 of a yielder.
        low, high: bounds of the number in standard deviations.
    """

    basis: Floats
    rate: Floats
    sigma: float
    headway: float
    low: float
    high: float

    def delay(self, z: Floats) -> Floats:
        """Return delays (S,) [s] from standard normal numbers (S,); the median is 0."""
        within = np.abs(special.ndtr(np.array([self.low, self.high])) - 0.5)
        share = special.ndtr(z) - 0.5
        number = self.sigma * special.ndtri(0.5 + 2.0 * share * np.where(share < 0.0, *within))
        return np.asarray(self.headway * np.expm1(number) if self.headway > 0.0 else number)


@dataclass(frozen=True, eq=False)
class Ramp:
    """A shift in time by one second that fades at requested states.

    Attributes:
        grid: (G,) template times [s].
        value, rate: (G,) the shift and its derivative [1/s].
    """

    grid: Floats
    value: Floats
    rate: Floats

    def gap_of(
        self,
        edge: Reaction,
        rests: Sequence[tuple[float, float]],
        config: SamplingConfig,
        limits: Limits,
    ) -> DriverGap | None:
        """Return the driver's gap in a reaction; None if it has none, or may not vary.

        Args:
            edge: the reaction.
            rests: begin and end [s] of the driver's stands.
            config: the standard deviations.
            limits: of the certificate.
        """
        if edge.kind == FOLLOW:
            return self._headway(edge, config, limits)
        if edge.gap == math.inf or config.gap_sigma == 0.0:
            return None
        begin, end = _approach(edge, rests, float(self.grid[0]))
        share = _TUNING.approach_share if end - begin >= _TUNING.min_approach else 0.0
        duration = max(end - begin, _TUNING.min_approach)
        step, slope = smooth_step((self.grid - begin) / duration)
        value = 1.0 - share + share * step
        rate = self.rate * value + self.value * share * slope / duration
        least, most = allowed_gap(edge, limits)
        earliest = -(1.0 - MIN_RATE_RATIO) * duration / _PEAK_SLOPE_RATIO / max(share, 1e-9)
        if edge.stands:
            earliest = max(earliest, -limits.anticipation)
        low = max(min(least - edge.gap + _TUNING.margin, 0.0), earliest)
        high = max(most - edge.gap - _TUNING.margin, 0.0)
        return _bounded(self.value * value, rate, config.gap_sigma, 0.0, (low, high), config)

    def _headway(self, edge: Reaction, config: SamplingConfig, limits: Limits) -> DriverGap | None:
        """Return the gap of a follower."""
        shortest, headway, greatest = edge.headway
        if config.headway_sigma == 0.0 or headway <= 0.0:
            return None
        nearer = max(_TUNING.nearer_share * shortest, shortest - _TUNING.ample_headway)
        farther = _TUNING.farther_share * limits.headway_share * greatest
        least, most = 1.0 - min(nearer / headway, 0.9), 1.0 + farther / headway
        bounds = math.log(least), math.log(most)
        return _bounded(self.value, self.rate, config.headway_sigma, headway, bounds, config)


def driver_gaps(
    edges: Sequence[Reaction],
    ramp: Ramp,
    rests: Sequence[tuple[float, float]],
    config: SamplingConfig,
    limits: Limits,
) -> Iterator[DriverGap]:
    """Yield the gaps of one driver, one for each vehicle to which it reacts."""
    followed = {edge.whom for edge in edges if edge.kind == FOLLOW}
    for edge in edges:
        if edge.kind != FOLLOW and edge.whom in followed:
            continue
        gap = ramp.gap_of(edge, rests, config, limits)
        if gap is not None:
            yield gap


def _approach(
    edge: Reaction, rests: Sequence[tuple[float, float]], start: float
) -> tuple[float, float]:
    """Return when [s] a yielder waits for the other vehicle, or approaches behind it."""
    waits = [rest for rest in rests if edge.since < rest[1] <= edge.until + 1.0]
    if edge.stands and waits:
        return waits[-1]
    return max(min(edge.since, edge.enters - _TUNING.approach), start), edge.enters


def _bounded(
    basis: Floats,
    rate: Floats,
    sigma: float,
    headway: float,
    bounds: tuple[float, float],
    config: SamplingConfig,
) -> DriverGap:
    """Return a gap with bounds, in units of sigma, within `freedom`."""
    low, high = np.clip(np.array(bounds) / sigma, -config.freedom, config.freedom).tolist()
    return DriverGap(basis, rate, sigma, headway, low, high)

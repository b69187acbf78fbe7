# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The time warp that all vehicles of a sample share, so that the order of passing survives.

The clock of a sample is t(τ) = t₀(τ) + δ(τ). The nominal clock t₀ is the template's, slowed where
a route bends more than the speed allows. δ is a Gaussian process over τ with δ = 0 at the start
and slope zero at both ends, where speeds are given. Between the points of its grid a clock is the
cubic of its times and rates, so its rate is that of the published clock.

A vehicle that slowed down alone before a bend would have to speed up, brake and speed up again,
for lengths and changepoint times are given. So the clock of all vehicles runs slower there, before
the bend already, and they meet as in the recording.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import ndimage, special
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicHermiteSpline

from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.gp import Features, Observations, principal, Regression
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import F1, F2, I1, kernel, named, OUT2
from scenario_gen.types import Encounter

SAMPLE_PERIOD_S = 0.1  # of published scenarios
MAX_RATE_RATIO = 1.35  # of a clock over the nominal one: drivers vary by about a third
MIN_RATE_RATIO = 0.75
_WARP_LENGTH_RATIO = 0.75
"""Length scale over the encounter's duration. A sample is quicker or slower as a whole: with slope
zero at both ends a longer scale leaves nothing to draw, and a shorter one squeezes single
primitives to speeds that no driver had."""
_NEWTON_STEPS = 4
_ROUNDING_STEPS = 1e-6


@dataclass(frozen=True, eq=False)
class Clock:
    """A clock on a grid of the template's time.

    Attributes:
        grid: (G,) seconds of the template, evenly spaced.
        time: (G,) or (S, G) seconds of the scenario.
        rate: the rate dt/dτ, of the same shape.
    """

    grid: Floats
    time: Floats
    rate: Floats

    @property
    def step(self) -> float:
        """Seconds between the points of the grid."""
        return float(self.grid[1] - self.grid[0])

    def nearest(self, tau: Floats) -> Ints:
        """Return the indices (k,) of the grid that are nearest to template times (k,) [s]."""
        cell = np.round(tau / self.step).astype(np.int64)
        return np.asarray(np.clip(cell, 0, len(self.grid) - 1))

    def times_at(self, tau: Floats) -> Floats:
        """Return the scenario times (S, k) [s] of S clocks nearest to template times (k,) [s]."""
        return self.time[:, self.nearest(tau)]

    def at(self, tau: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return time [s], rate and the rate's two derivatives [1/s, 1/s²] of a single clock.

        Args:
            tau: (q,) template times [s].
        """
        curve = CubicHermiteSpline(self.grid, self.time, self.rate)
        return curve(tau), curve(tau, 1), curve(tau, 2), curve(tau, 3)


def smooth_step(x: Floats) -> tuple[Floats, Floats]:
    """Return the quintic step 10 x³ - 15 x⁴ + 6 x⁵ from 0 to 1 on [0, 1], and its derivative."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * x * (10.0 + x * (6.0 * x - 15.0)), 30.0 * x * x * (1.0 - x) * (1.0 - x)


class TimeWarp:
    """Draws clocks.

    The deviation of the end is drawn first, from its Gaussian truncated to the duration tolerance;
    the rest follows given the end.
    """

    def __init__(self, nominal: Clock, config: SamplingConfig, least_share: Floats) -> None:
        """Prepare the process.

        Args:
            nominal: the clock without deviation.
            config: σ_t and the tolerance of the duration.
            least_share: (G,) slowest rate of a sample over the nominal one.
        """
        self.nominal = nominal
        grid = nominal.grid
        self._least_share = least_share
        duration = float(nominal.time[-1]) / SAMPLE_PERIOD_S
        tolerance = config.duration_tolerance
        self._shortest = np.ceil(duration * (1.0 - tolerance) - _ROUNDING_STEPS)
        self._longest = np.floor(duration * (1.0 + tolerance) + _ROUNDING_STEPS)
        if config.fixed_duration or self._shortest > self._longest:
            self._shortest = self._longest = float(round(duration))

        start, end = float(grid[0]), float(grid[-1])
        length = _WARP_LENGTH_RATIO * (end - start)
        features = Features(start, end, config.time_sigma or 1.0, length)
        x, none = np.array([start, start, end, end]), np.zeros(4)
        given_end = np.array([0.0, 0.0, 0.0, 1.0])
        regression = Regression(features, Observations(x, given_end, none, (0, 1, 1, 0)))
        value, slope = regression.predict(grid), regression.predict(grid, 1)
        self._share, self._share_rate = value.mean, slope.mean

        self._end_sigma = 0.0
        self._factor = self._rates = np.zeros((len(grid), 0))
        if config.time_sigma > 0.0:
            free = Observations(x[:3], none[:3], none[:3], (0, 1, 1))
            at_end = Regression(features, free).predict(grid[-1:])
            self._end_sigma = float(np.sqrt(np.square(at_end.factor).sum()))
            both = principal(np.vstack([value.factor, slope.factor]))
            self._factor, self._rates = both[: len(grid)], both[len(grid) :]

    @property
    def count(self) -> int:
        """Standard normal numbers per sample."""
        return 1 + self._factor.shape[1]

    def sample(self, z: Floats, scale: float) -> Clock:
        """Return S clocks, which end on the published grid.

        Args:
            z: (S, count) standard normal numbers.
            scale: factor on the deviations.
        """
        nominal = self.nominal
        end = scale * self._end_deviation(z[:, 0])[:, None]
        delta = end * self._share + scale * (z[:, 1:] @ self._factor.T)
        rate = end * self._share_rate + scale * (z[:, 1:] @ self._rates.T)

        slowest = 1.0 - self._least_share
        room = np.where(rate < 0.0, slowest, MAX_RATE_RATIO - 1.0) * nominal.rate
        damping = np.minimum(1.0, (room / np.maximum(np.abs(rate), 1e-9)).min(axis=1))[:, None]

        ends = nominal.time[-1] + damping[:, 0] * delta[:, -1]
        steps = np.clip(np.round(ends / SAMPLE_PERIOD_S), self._shortest, self._longest)
        missing = (steps * SAMPLE_PERIOD_S - ends)[:, None]
        time = nominal.time + damping * delta + missing * self._share
        time[:, -1] = np.round(time[:, -1] / SAMPLE_PERIOD_S) * SAMPLE_PERIOD_S
        return Clock(
            nominal.grid, time, nominal.rate + damping * rate + missing * self._share_rate
        )

    def _end_deviation(self, z: Floats) -> Floats:
        """Truncated Gaussian deviations of the end (S,) [s] from standard normal numbers (S,)."""
        end = self.nominal.time[-1]
        low = self._shortest * SAMPLE_PERIOD_S - end
        high = self._longest * SAMPLE_PERIOD_S - end
        if self._end_sigma < 1e-9 or high - low < 1e-9:
            return np.zeros_like(z)
        a, b = special.ndtr(low / self._end_sigma), special.ndtr(high / self._end_sigma)
        return np.asarray(self._end_sigma * special.ndtri(a + (b - a) * special.ndtr(z)))


@kernel(inline=True)
def cell_of(grid: Floats, value: float, j: int) -> int:
    """Return the cell of a rising grid (G,) in which a value lies, searched from cell j on."""
    while j < len(grid) - 2 and value > grid[j + 1]:
        j += 1
    while j > 0 and value < grid[j]:
        j -= 1
    return j


class ClockSamples(NamedTuple):
    """The clocks of S samples at up to T instants.

    Attributes:
        tau: (S, T) template times [s], ascending.
        pace: (S, T) rate dt/dτ of the clock.
        slope: (S, T) 1/s, derivative d²t/dτ² of the rate.
        counts: (S,) number of instants that are filled.
    """

    tau: Floats
    pace: Floats
    slope: Floats
    counts: Ints

    @classmethod
    def of(cls, clock: Clock, at: Floats, counts: Ints) -> "ClockSamples":
        """Evaluate S clocks at scenario times (S, T) [s], the first `counts` (S,) of them."""
        samples = cls(np.zeros(at.shape), np.ones(at.shape), np.zeros(at.shape), counts)
        template_times(clock.grid, clock.time, clock.rate, at, samples)
        return samples


@kernel(F1, F2, F2, F2, named(ClockSamples, OUT2, OUT2, OUT2, I1))
def template_times(
    grid: Floats, time: Floats, rate: Floats, at: Floats, out: ClockSamples
) -> None:
    """Invert S clocks.

    Args:
        grid: (G,) seconds of the template, evenly spaced.
        time: (S, G) seconds of the clocks.
        rate: (S, G) their rates.
        at: (S, T) scenario times [s], ascending.
        out: filled.
    """
    h = grid[1] - grid[0]
    for s in range(time.shape[0]):
        j = 0
        for k in range(out.counts[s]):
            t = min(max(at[s, k], time[s, 0]), time[s, -1])
            j = cell_of(time[s], t, j)
            start, end = time[s, j], time[s, j + 1]
            c1, q = h * rate[s, j], h * rate[s, j + 1]
            c2 = 3.0 * (end - start) - 2.0 * c1 - q
            c3 = 2.0 * (start - end) + c1 + q
            x = (t - start) / (end - start)
            for _ in range(_NEWTON_STEPS):
                value = start + x * (c1 + x * (c2 + x * c3))
                x -= (value - t) / (c1 + x * (2.0 * c2 + 3.0 * c3 * x))
            x = min(max(x, 0.0), 1.0)
            out.tau[s, k] = grid[j] + h * x
            out.pace[s, k] = (c1 + x * (2.0 * c2 + 3.0 * c3 * x)) / h
            out.slope[s, k] = (2.0 * c2 + 6.0 * c3 * x) / (h * h)


SLOWING_S = 1.5  # before and after a bend, over which the clock is slowed: about 2 m/s² at 10 m/s
_PASSES_COUNT = 3  # of the moving average: three make it C2


def template_grid(encounter: Encounter) -> Floats:
    """Return evenly spaced template times (G,) [s], the samples' among them."""
    parts = max(round(encounter.dt / SAMPLE_PERIOD_S), 1)
    return np.linspace(0.0, encounter.duration, parts * (len(encounter.time) - 1) + 1)


def slowed_clock(grid: Floats, slowdowns: Sequence[Floats], max_duration: float) -> Clock:
    """Return the smooth (C2) clock that is as slow everywhere as the slowest vehicle requires.

    Args:
        grid: (G,) template times [s].
        slowdowns: (G,) per vehicle, the factor by which the clock must be slowed, 1 or more.
        max_duration: over the template's; larger slowdowns are met in part.
    """
    slowdown = np.maximum(np.max(slowdowns, axis=0), 1.0)
    step = float(grid[1] - grid[0])
    width = 2 * max(round(SLOWING_S / step / _PASSES_COUNT), 1) + 1
    reach = _PASSES_COUNT * (width - 1) + 1
    rate = ndimage.maximum_filter1d(slowdown, reach, mode="nearest")
    for _ in range(_PASSES_COUNT):
        rate = ndimage.uniform_filter1d(rate, width, mode="nearest")
    extra = rate - 1.0
    longer = 0.5 * step * float((extra[1:] + extra[:-1]).sum())
    room = (max_duration - 1.0) * float(grid[-1] - grid[0])
    share = min(room / longer, 1.0) if longer > 0.0 else 1.0
    return clock_from_rate(grid, 1.0 + extra * share)


def clock_from_rate(grid: Floats, rate: Floats) -> Clock:
    """Return the clock with these rates (G,) at template times (G,) [s], cubic in between."""
    step = float(grid[1] - grid[0])
    return Clock(grid, cumulative_trapezoid(rate, dx=step, initial=0.0), rate)

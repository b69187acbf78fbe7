# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The joint time warp: how fast the template's clock runs in a sample, for all vehicles alike, so that who goes first survives.

A sample's clock is t(τ) = t₀(τ) + δ(τ). The nominal clock t₀ is the template's, slowed where a vehicle's route bends more than
its speed allows. δ is a Gaussian process over τ with δ = 0 at the start and slope zero at both ends, where speeds are given.
Between the points of a grid the clock is a cubic: rate and its slope are those of the clock that is published.
"""

from dataclasses import dataclass

import numpy as np
from scipy import special

from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.gp import Features, Observations, principal, Regression
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.kernels import F1, F2, I1, kernel, OUT2

DT = 0.1  # s, the grid of published scenarios
LONGEST_SHARE, SHORTEST_SHARE = (
    1.35,
    0.75,
)  # slowest and fastest that a clock may run, as a share of the nominal one
_LENGTH_SHARE = 0.75
"""Length scale of the warp's deviation as a share of the encounter's duration: a sample is quicker or slower as a whole.
With slope zero at both ends a longer one leaves nothing to draw; a shorter one squeezes single primitives, whose speeds then are
nobody's."""


@dataclass(frozen=True, eq=False)
class Clock:
    """A clock on a grid of the template's time.

    Attributes:
        grid: (G,) seconds of the template.
        time: (G,) or (S, G) seconds of the scenario there.
        rate: the same shape, their rate dt/dτ.
    """

    grid: Floats
    time: Floats
    rate: Floats

    def at(self, tau: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Time [s], rate, and its first two derivatives [1/s, 1/s²] at template times (q,) [s] of a single clock."""
        cell = np.clip(np.searchsorted(self.grid, tau, side="right") - 1, 0, len(self.grid) - 2)
        h = self.grid[1] - self.grid[0]
        x = (tau - self.grid[cell]) / h
        a, b = self.time[cell], self.time[cell + 1]
        p, q = h * self.rate[cell], h * self.rate[cell + 1]
        two, three = 3.0 * (b - a) - 2.0 * p - q, 2.0 * (a - b) + p + q
        value = a + x * (p + x * (two + x * three))
        rate, slope = (
            (p + x * (2.0 * two + 3.0 * three * x)) / h,
            (2.0 * two + 6.0 * three * x) / (h * h),
        )
        return value, rate, slope, 6.0 * three / (h * h * h)


class TimeWarp:
    """Samples clocks.

    The end's deviation is drawn first, from its Gaussian truncated to the duration tolerance, the rest given the end.
    """

    def __init__(
        self, nominal: Clock, config: SamplingConfig, least_share: Floats | None = None
    ) -> None:
        """Prepare.

        Args:
            nominal: the clock without deviation.
            config: σ_t and the tolerance of the duration.
            least_share: (G,) slowest rate that a sample may have, as a share of the nominal one.
        """
        self.nominal = nominal
        grid = nominal.grid
        self._least_share = (
            np.full(len(grid), SHORTEST_SHARE) if least_share is None else least_share
        )
        start, end = float(grid[0]), float(nominal.time[-1])
        self._shortest = np.ceil(end * (1.0 - config.duration_tolerance) / DT - 1e-6)
        self._longest = np.floor(end * (1.0 + config.duration_tolerance) / DT + 1e-6)
        if config.fixed_duration or self._shortest > self._longest:
            self._shortest = self._longest = float(round(end / DT))
        sigma, length = config.time_sigma or 1.0, _LENGTH_SHARE * float(grid[-1] - start)
        features = Features(start, float(grid[-1]), sigma, length)
        x = np.array([start, start, grid[-1], grid[-1]])
        none = np.zeros(4)
        free = Regression(features, Observations(x[:3], none[:3], none[:3], (0, 1, 1))).predict(
            grid[-1:]
        )
        regression = Regression(
            features, Observations(x, np.array([0.0, 0.0, 0.0, 1.0]), none, (0, 1, 1, 0))
        )
        value, slope = regression.predict(grid), regression.predict(grid, 1)
        self._share, self._share_rate = value.mean, slope.mean
        if config.time_sigma == 0.0:
            self._end_sigma, self._factor, self._rates = (
                0.0,
                np.zeros((len(grid), 0)),
                np.zeros((len(grid), 0)),
            )
            return
        self._end_sigma = float(np.sqrt(np.square(free.factor).sum()))
        both = principal(np.vstack([value.factor, slope.factor]), 1e-9)
        self._factor, self._rates = both[: len(grid)], both[len(grid) :]

    @property
    def size(self) -> int:
        """Standard normal numbers needed per sample."""
        return 1 + self._factor.shape[1]

    def sample(self, z: Floats, scale: float) -> Clock:
        """Clocks from numbers z (S, size), deviations multiplied by `scale`; they end on the published grid."""
        nominal = self.nominal
        end = scale * self._end(z[:, 0])[:, None]
        delta = end * self._share + scale * (z[:, 1:] @ self._factor.T)
        rate = end * self._share_rate + scale * (z[:, 1:] @ self._rates.T)
        room = np.where(rate < 0.0, 1.0 - self._least_share, LONGEST_SHARE - 1.0) * nominal.rate
        damped = np.minimum(1.0, (room / np.maximum(np.abs(rate), 1e-9)).min(axis=1))[:, None]
        ends = nominal.time[-1] + damped[:, 0] * delta[:, -1]
        missing = (np.clip(np.round(ends / DT), self._shortest, self._longest) * DT - ends)[
            :, None
        ]
        time = nominal.time + damped * delta + missing * self._share
        time[:, -1] = np.round(time[:, -1] / DT) * DT
        return Clock(nominal.grid, time, nominal.rate + damped * rate + missing * self._share_rate)

    def _end(self, z: Floats) -> Floats:
        """Truncated Gaussian deviations of the end [s] from standard normal ones."""
        low, high = (
            self._shortest * DT - self.nominal.time[-1],
            self._longest * DT - self.nominal.time[-1],
        )
        if self._end_sigma < 1e-9 or high - low < 1e-9:
            return np.zeros_like(z)
        a, b = special.ndtr(low / self._end_sigma), special.ndtr(high / self._end_sigma)
        return np.asarray(self._end_sigma * special.ndtri(a + (b - a) * special.ndtr(z)))


@kernel(F1, F2, F2, F2, I1, OUT2, OUT2, OUT2)
def template_times(
    grid: Floats,
    time: Floats,
    rate: Floats,
    at: Floats,
    count: Ints,
    tau: Floats,
    pace: Floats,
    slope: Floats,
) -> None:
    """Template times of scenario times, with the clock's rate and its slope there.

    Args:
        grid: (G,) seconds of the template, evenly spaced.
        time: (S, G) seconds of the clocks, see `Clock`.
        rate: (S, G) their rates.
        at: (S, T) scenario times [s], ascending.
        count: (S,) how many of them are asked for.
        tau: (S, T) filled with template times [s].
        pace: (S, T) filled with dt/dτ.
        slope: (S, T) filled with d²t/dτ² [1/s].
    """
    h = grid[1] - grid[0]
    for s in range(time.shape[0]):
        j = 0
        for k in range(count[s]):
            t = min(max(at[s, k], time[s, 0]), time[s, -1])
            while j < len(grid) - 2 and t > time[s, j + 1]:
                j += 1
            while j > 0 and t < time[s, j]:
                j -= 1
            a, b, p, q = time[s, j], time[s, j + 1], h * rate[s, j], h * rate[s, j + 1]
            two, three = 3.0 * (b - a) - 2.0 * p - q, 2.0 * (a - b) + p + q
            x = (t - a) / (b - a)
            for _ in range(4):
                x -= (a + x * (p + x * (two + x * three)) - t) / (
                    p + x * (2.0 * two + 3.0 * three * x)
                )
            x = min(max(x, 0.0), 1.0)
            tau[s, k] = grid[j] + h * x
            pace[s, k] = (p + x * (2.0 * two + 3.0 * three * x)) / h
            slope[s, k] = (2.0 * two + 6.0 * three * x) / (h * h)

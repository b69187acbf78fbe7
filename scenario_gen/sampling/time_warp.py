# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The joint time warp: when the changepoints come, for all vehicles alike, so that who goes first survives."""

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Floats
from scenario_gen.sampling.config import SamplingConfig
from scenario_gen.sampling.gp import Features, Observations, Regression

DT = 0.1  # s, the grid of published scenarios
LONGEST_SHARE, SHORTEST_SHARE = 1.35, 0.75  # longest and shortest a primitive may become, as a share of its own duration
_LENGTH_SHARE = 1.5
"""Length scale of the warp's deviation as a share of the encounter's duration: longer than the encounter, so that a sample
is quicker or slower as a whole. A shorter one squeezes single primitives, whose speeds then are nobody's (E grows fourfold)."""


class TimeWarp:
    """Samples monotone time warps t + δ(t) of the template's clock, δ a Gaussian process over time with δ(0) = 0.

    The end's deviation is drawn first, from its Gaussian truncated to the duration tolerance, the rest given the end.
    """

    def __init__(self, times: Floats, config: SamplingConfig, least_share: Floats | None = None) -> None:
        """Prepare.

        Args:
            times: (K + 2,) seconds of start, changepoints and end, strictly increasing from 0.
            config: σ_t and the tolerance of the duration.
            least_share: (K + 1,) the shortest each primitive may become, as a share of its duration.
        """
        self.times = times
        self._least_share = np.full(len(times) - 1, SHORTEST_SHARE) if least_share is None else least_share
        end = float(times[-1])
        self._shortest = np.ceil(end * (1.0 - config.duration_tolerance) / DT - 1e-6)
        self._longest = np.floor(end * (1.0 + config.duration_tolerance) / DT + 1e-6)
        if config.fixed_duration or self._shortest > self._longest:
            self._shortest = self._longest = float(round(end / DT))
        if config.time_sigma == 0.0:
            self._end_sigma, self._share, self._factor = 0.0, times / end, np.zeros((len(times), 0))
            return
        features = Features(0.0, end, config.time_sigma, _LENGTH_SHARE * end)
        ends, none = np.array([0.0, end]), np.zeros(2)
        free = Regression(features, Observations(ends[:1], none[:1], none[:1])).predict(ends[1:])
        self._end_sigma = float(np.sqrt(np.square(free.factor).sum()))
        given = Regression(features, Observations(ends, np.array([0.0, 1.0]), none)).predict(times)
        self._share, self._factor = given.mean, exact.compact(given.factor, 1e-9)

    @property
    def size(self) -> int:
        """Standard normal numbers needed per sample."""
        return 1 + self._factor.shape[1]

    def sample(self, z: Floats, scale: Floats) -> Floats:
        """Warped times (S, K + 2) [s] from numbers z (S, size), deviations multiplied by scale (S,)."""
        rest = exact.matmul(z[:, 1:], self._factor.T)
        delta = (self._share * self._end(z[:, 0])[:, None] + rest) * scale[:, None]
        steps = np.diff(self.times)
        rate = np.clip(1.0 + np.diff(delta, axis=1) / steps, self._least_share, LONGEST_SHARE)
        end = (rate * steps).sum(axis=1)
        missing = np.clip(np.round(end / DT), self._shortest, self._longest) * DT - end
        room = np.where(missing[:, None] < 0.0, rate - self._least_share, LONGEST_SHARE - rate) * steps + 1e-9
        pieces = rate * steps + room * (missing / room.sum(axis=1))[:, None]
        warped = np.concatenate([np.zeros((len(z), 1)), np.cumsum(pieces, axis=1)], axis=1)
        warped[:, -1] = np.round(warped[:, -1] / DT) * DT
        return np.asarray(warped)

    def _end(self, z: Floats) -> Floats:
        """Truncated Gaussian deviations of the end [s] from standard normal ones."""
        low, high = self._shortest * DT - self.times[-1], self._longest * DT - self.times[-1]
        if self._end_sigma < 1e-9 or high - low < 1e-9:
            return np.zeros_like(z)
        a, b = exact.ndtr(low / self._end_sigma), exact.ndtr(high / self._end_sigma)
        return np.asarray(self._end_sigma * exact.ndtri(a + (b - a) * exact.ndtr(z)))

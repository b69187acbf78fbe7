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

"""The path a vehicle drove: a penalised cubic B-spline by distance driven (P-spline; Eilers & Marx 1996)."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Floats

if TYPE_CHECKING:
    from scipy.interpolate import BSpline  # slow to import

KNOT = 1.0  # m between knots
MARGIN = 5.0  # m of path beyond both ends, for fixes that lie there
STEP = 0.1  # m between the points of the table from parameter to arc length
CURVATURE = 0.1  # 1/m: spectral density of the curvature, about 0.1 1/m over 10 m
STEERING = 0.002  # 1/m³: spectral density of the curvature's change, about 0.02 1/m² over 5 m
CREEP = 0.2  # m: fixes closer together than this share one weight, for GPS noise is no steering
STRAIGHT = 3.0  # m: a shorter path has no shape of its own


@dataclass(frozen=True, eq=False)
class Path:
    """A curve by its parameter u (distance driven as first guessed) and its true arc length."""

    curve: "BSpline"
    parameter: Floats
    length: Floats

    def project(self, guess: Floats, points: Floats) -> tuple[Floats, Floats]:
        """Arc length of the points' feet on the curve near the parameters `guess`, and the points' distances from it."""
        tangent = self.curve(guess, 1)
        gap = points - self.curve(guess)
        foot = guess + (gap * tangent).sum(axis=1) / (np.square(tangent)).sum(axis=1)
        foot = np.clip(foot, self.parameter[0], self.parameter[-1])
        return np.interp(foot, self.parameter, self.length), exact.hypot(*(points - self.curve(foot)).T)

    def pose(self, arc: Floats) -> tuple[Floats, Floats]:
        """Positions (T, 2) and headings (T,), unwrapped, at arc lengths."""
        u = np.interp(arc, self.length, self.parameter)
        tangent = self.curve(u, 1)
        return self.curve(u), np.unwrap(exact.arctan2(tangent[:, 1], tangent[:, 0]))


def fit_path(place: Floats, points: Floats, weight: Floats, noise: float) -> Path:
    """Fit a curve to points (F, 2) at distances driven `place` (F,); weights in (0, 1], noise in metres."""
    from scipy.interpolate import BSpline

    low, high = place.min() - MARGIN, place.max() + MARGIN
    spans = max(int(np.ceil((high - low) / KNOT)), 4)
    step = (high - low) / spans
    knots = low + step * np.arange(-3, spans + 4)
    spread = np.gradient(place) if len(place) > 1 else np.ones(1)
    weight = weight * np.clip(np.abs(spread) / CREEP, 0.005, 1.0) / np.square(noise)
    count = spans + 3
    band = np.zeros((4, count))
    right = np.zeros((count, 2))
    rows = BSpline.design_matrix(np.clip(place, low, high - 1e-9), knots, 3).tocsr()
    values = rows.data.reshape(-1, 4)
    start = rows.indices.reshape(-1, 4)[:, 0]
    for i in range(4):
        np.add.at(right, start + i, (weight * values[:, i])[:, None] * points)
        for j in range(i + 1):
            np.add.at(band[i - j], start + j, weight * values[:, i] * values[:, j])
    penalise(band, 2, exact.power(step, -3) / CURVATURE)
    penalise(band, 3, exact.power(step, -5) / STEERING)
    return tabulate(BSpline(knots, exact.solve_banded(band, right), 3), low, high)


def penalise(band: Floats, order: int, weight: float) -> None:
    """Add weight · ‖differences of that order‖² to a lower band matrix (4, n)."""
    stencil = np.array({2: [1.0, -2.0, 1.0], 3: [-1.0, 3.0, -3.0, 1.0]}[order])
    last = band.shape[1] - order
    for i in range(order + 1):
        for j in range(i + 1):
            band[i - j, j : j + last] += weight * stencil[i] * stencil[j]


def straight_path(point: Floats, heading: float, low: float, high: float) -> Path:
    """A straight line through `point` where the distance driven is (low + high) / 2."""
    from scipy.interpolate import BSpline

    direction = np.array([exact.cos(heading), exact.sin(heading)])
    ends = np.array([low - MARGIN, high + MARGIN])
    where = point + (ends - (low + high) / 2.0)[:, None] * direction
    return tabulate(BSpline(np.repeat(ends, 2), where, 1), ends[0], ends[1])


def tabulate(curve: "BSpline", low: float, high: float) -> Path:
    """Measure the curve's arc length."""
    u = np.linspace(low, high, int(np.ceil((high - low) / STEP)) + 1)
    rate = exact.hypot(*curve(u, 1).T)
    length = low + np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2.0 * np.diff(u))])
    return Path(curve, u, length)

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How strongly a driver brakes and accelerates, from driver to driver.

A phase of the mean speed u(τ) is an interval of braking, or of acceleration, a(τ) = u'(τ). A
driver who is stronger by a factor k has k a(c + k (τ - c)) instead: the same change of speed in a
shorter time. With the centroid c = ∫ τ a dτ / ∫ a dτ the place before and after the phase is the
same at the same time, so the driver arrives when the recorded one does. A phase is not extended
into a stand, or beyond an end of the recording, and not made stronger than drivers usually are.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from scenario_gen.method.sampling.speed_profile.spline import SpeedSpline
from scenario_gen.numerics import Floats, runs

MAX_FACTOR = 2.2  # of strength, and its inverse
_STEP_S = 0.05
_PHASE_MPS2 = 0.15  # acceleration from which a phase begins
_PHASE_MPS = 0.5  # least change of speed in a phase
_NODES_COUNT = 9
_USUAL_MPS2 = (3.0, 2.0)  # braking and acceleration up to which drivers are stronger


@dataclass(frozen=True, eq=False)
class Strength:
    """The change of the mean speed of a stronger or weaker driver.

    Attributes:
        log_factor: (K,) logarithms of factors.
        change: (2, K, n) change of the coefficients [m/s] in braking, and in acceleration.
    """

    log_factor: Floats
    change: Floats

    @classmethod
    def of(cls, spline: SpeedSpline, mean: Floats, longer: Floats) -> "Strength":
        """Prepare the changes.

        Args:
            spline: the basis.
            mean: (n,) coefficients [m/s] of the mean speed.
            longer: (n,) effect of each further metre.
        """
        log_factor = np.linspace(-1.0, 1.0, _NODES_COUNT) * np.log(MAX_FACTOR)
        change = np.zeros((2, _NODES_COUNT, spline.size))
        if mean.max(initial=0.0) <= 0.0:
            return cls(log_factor, change)
        inverse = np.linalg.inv(spline.design(spline.middle))
        inverse[spline.still] = 0.0
        for kind, sign in enumerate((-1.0, 1.0)):
            for phase in _phases(spline, mean, sign, _USUAL_MPS2[kind]):
                rows = [phase.change(factor, spline.middle) for factor in np.exp(log_factor)]
                change[kind] += np.array(rows) @ inverse.T
        change -= (change @ spline.length)[..., None] * longer
        return cls(log_factor, change)

    @property
    def effect(self) -> Floats:
        """(n, 2) mean effect of a unit of the logarithms on the coefficients [m/s]."""
        typical = 0.5 * self.log_factor[-1] * np.eye(2)
        rise = self.changes(typical) - self.changes(-typical)
        return np.asarray(rise.T / self.log_factor[-1])

    def changes(self, log_factor: Floats) -> Floats:
        """Return the change (S, n) of the coefficients for logarithms (S, 2) of factors."""
        spacing = self.log_factor[1] - self.log_factor[0]
        known = np.clip(log_factor, *self.log_factor[[0, -1]])
        distance = np.abs(known[..., None] - self.log_factor) / spacing
        weight = np.maximum(1.0 - distance, 0.0)  # linear interpolation
        return np.asarray(np.einsum("skj,kjn->sn", weight, self.change))


@dataclass(frozen=True, eq=False)
class _Phase:
    """A phase of braking or of acceleration.

    Attributes:
        time: (q,) seconds.
        gained: (q,) change of speed [m/s] since its begin.
        centre: its centroid [s].
        least: the least factor; a smaller one would extend it too far.
        most: the greatest factor; a greater one would be unusually strong.
    """

    time: Floats
    gained: Floats
    centre: float
    least: float
    most: float

    def change(self, factor: float, at: Floats) -> Floats:
        """Return by how much speeds (n,) [m/s] at times `at` (n,) [s] change with a factor."""
        factor = max(min(factor, self.most), self.least)
        scaled = self.centre + factor * (at - self.centre)
        return np.interp(scaled, self.time, self.gained) - np.interp(at, self.time, self.gained)


def _phases(spline: SpeedSpline, mean: Floats, sign: float, usual: float) -> Iterator[_Phase]:
    """Yield the phases of braking (sign -1) or of acceleration (1); `usual` [m/s²] limits them."""
    start, end = spline.breaks[[0, -1]].tolist()
    time = np.linspace(start, end, max(round((end - start) / _STEP_S), 2) + 1)
    speed, acceleration = spline.design(time) @ mean, spline.design(time, 1) @ mean
    for a, b in runs(sign * acceleration > _PHASE_MPS2):
        if b - a < 2 or abs(speed[b - 1] - speed[a]) < _PHASE_MPS:
            continue
        part = slice(a, b)
        weight = acceleration[part] / acceleration[part].sum()
        centre = float(weight @ time[part])
        standing = np.flatnonzero(speed <= 1e-3)
        low = time[standing[standing < a].max(initial=0)]
        high = time[standing[standing >= b].min(initial=len(time) - 1)]
        least = max(
            (centre - time[a]) / max(centre - low, 1e-9),
            (time[b - 1] - centre) / max(high - centre, 1e-9),
        )
        most = max(usual / float(np.abs(acceleration[part]).max()), 1.0)
        yield _Phase(time[part], speed[part] - speed[a], centre, float(least), most)

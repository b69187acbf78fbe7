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

"""How far along its path a vehicle is: a quadratic B-spline on the common clock, fitted by a quadratic program.

With coefficients c_0 … c_T and ticks i = 0 … T-1: place s_i = (c_i + c_{i+1})/2, speed v_i = (c_{i+1} - c_i)/dt, and the
acceleration between two ticks is constant. Second and third differences of c are acceleration and jerk, so limits on speed
and acceleration are sparse linear inequalities, and where a vehicle stands its coefficients are one variable: v = 0 exactly.
"""

from collections.abc import Sequence

import clarabel  # type: ignore[import-untyped,unused-ignore]
import numpy as np
from scipy import sparse

from scenario_gen import exact
from scenario_gen.arrays import Bools, Floats
from scenario_gen.errors import InputError
from scenario_gen.logs.config import LogConfig


class Motion:
    """The fit of one vehicle's motion over T ticks of `dt` seconds; `stands` (T,) tells where the speed is zero."""

    def __init__(self, stands: Bools, config: LogConfig) -> None:
        dt = config.period
        count = len(stands) + 1
        group = np.concatenate([[0], np.cumsum(~stands)])  # v_i = 0 makes c_{i+1} the variable of c_i
        self.dt, self.ticks = dt, len(stands)
        self.merge = sparse.csr_array((np.ones(count), (np.arange(count), group)))
        first = self._differences(1) / dt
        second = self._differences(2) / np.square(dt)
        third = self._differences(3) * (np.sqrt(dt) / (config.jerk * exact.power(dt, 3)))
        self.prior = (third.T @ third).tocsc()
        self.constraints = sparse.vstack([-first, second, -second], format="csc")
        rows = second.shape[0]
        self.bounds = np.concatenate(
            [np.zeros(first.shape[0]), np.full(rows, config.acceleration_limit), np.full(rows, config.braking_limit)]
        )

    def _differences(self, order: int) -> sparse.csr_array:
        """Differences of the coefficients, over the merged variables."""
        matrix = self.merge
        for _ in range(order):
            matrix = matrix[1:] - matrix[:-1]
        return matrix

    def _basis(self, seconds: Floats, *, speed: bool) -> sparse.csr_array:
        """Rows that evaluate the place or the speed at any time, over the merged variables."""
        tick = np.clip(np.floor(seconds / self.dt).astype(int), 0, max(self.ticks - 2, 0))
        u = seconds / self.dt - tick
        if speed:
            weights = [(u - 1.0) / self.dt, (1.0 - 2.0 * u) / self.dt, u / self.dt]
        else:
            weights = [np.square(1.0 - u) / 2.0, 0.5 + u - np.square(u), np.square(u) / 2.0]
        row = np.arange(len(seconds))
        entries = (np.concatenate(weights), (np.tile(row, 3), np.concatenate([tick, tick + 1, tick + 2])))
        return sparse.csr_array(entries, shape=(len(seconds), self.ticks + 1)) @ self.merge

    def solve(self, observed: Sequence[tuple[Floats, Floats, Floats, bool]]) -> Floats:
        """Return the coefficients (T+1,) that fit best.

        Args:
            observed: (seconds, values, standard deviations, whether the values are speeds rather than places).
        """
        quadratic, linear = self.prior, np.zeros(self.merge.shape[1])
        for seconds, values, deviation, speed in observed:
            rows = self._basis(seconds, speed=speed)
            weighted = rows.T * (1.0 / np.square(deviation))
            quadratic = quadratic + weighted @ rows
            linear = linear - weighted @ values
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.direct_solve_method = "qdldl"  # one thread: the same bits everywhere
        cones = [clarabel.NonnegativeConeT(len(self.bounds))]
        upper = sparse.triu(quadratic, format="csc")
        solution = clarabel.DefaultSolver(upper, linear, self.constraints, self.bounds, cones, settings).solve()
        if solution.status not in (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved):
            raise InputError(f"speeds and positions cannot be reconciled ({solution.status}); check their units")
        merged = np.maximum.accumulate(np.asarray(solution.x))  # the solver's tolerance must not drive backwards
        coefficients: Floats = self.merge @ merged
        return coefficients

    def place(self, coefficients: Floats, seconds: Floats) -> Floats:
        """Distance driven [m] at any times."""
        tick = np.clip(np.floor(seconds / self.dt).astype(int), 0, max(self.ticks - 2, 0))
        u = seconds / self.dt - tick
        c0, c1, c2 = (coefficients[tick + k] for k in range(3))
        place: Floats = c0 * np.square(1.0 - u) / 2.0 + c1 * (0.5 + u - np.square(u)) + c2 * np.square(u) / 2.0
        return place

    def at_ticks(self, coefficients: Floats) -> tuple[Floats, Floats]:
        """Distance driven [m] and speed [m/s] at the T ticks."""
        return (coefficients[1:] + coefficients[:-1]) / 2.0, np.diff(coefficients) / self.dt

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The motion of a vehicle along its path, within the limits of a car."""

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import clarabel  # type: ignore[import-untyped,unused-ignore]
import numpy as np
from scipy import linalg, sparse

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.smoothing.path import differences, observe


class UnreconciledError(InputError):
    """No motion of a car fits speeds and positions."""


class Motion:
    """Distance along a path over time: a quadratic B-spline fitted by a quadratic program.

    With coefficients c_0 … c_T and ticks i = 0 … T-1: distance s_i = (c_i + c_{i+1})/2, speed
    v_i = (c_{i+1} - c_i)/dt, and the acceleration between two ticks is constant. Second and third
    differences of c are acceleration and jerk, so limits on speed and acceleration are sparse
    linear inequalities. While a vehicle stands, its coefficients are one variable: v = 0 exactly.
    """

    def __init__(
        self, stands: Bools, dt: float, jerk: float, lowest: float, highest: float
    ) -> None:
        """Set up the program.

        Args:
            stands: (T,) whether the speed is zero at each tick.
            dt: seconds between ticks.
            jerk: typical change of acceleration within one second [m/s²].
            lowest: acceleration [m/s²], negative.
            highest: acceleration [m/s²].
        """
        self.dt = dt
        self.ticks = len(stands)
        # v_i = 0 makes c_{i+1} the variable of c_i.
        self.variable = np.concatenate([[0], np.cumsum(~stands)])
        self.size = int(self.variable[-1]) + 1
        self.jerk = jerk
        self.lowest = lowest
        self.highest = highest

    def _is_within_limits(self, variables: Floats) -> bool:
        """Return whether variables (V,) keep the limits of speed and acceleration."""
        coefficients = variables[self.variable]
        acceleration = np.diff(coefficients, 2) / self.dt**2
        is_forwards = (np.diff(coefficients) >= 0.0).all()
        return bool(
            is_forwards
            and acceleration.max(initial=0.0) <= self.highest
            and acceleration.min(initial=0.0) >= self.lowest
        )

    def _limits(self) -> tuple[Any, Floats]:
        """Return the matrix and right side of the limits: speed, acceleration, deceleration."""
        speed, acceleration = (self._difference_matrix(order) for order in (1, 2))
        blocks = (-speed / self.dt, acceleration / self.dt**2, -acceleration / self.dt**2)
        rows = sparse.vstack(blocks).tocsc()
        rows.eliminate_zeros()
        n = len(self.variable)
        limits = [0.0, self.highest, -self.lowest]
        return rows, np.repeat(limits, [n - 1, n - 2, n - 2])

    def _merged(self, tick: Ints, weights: Floats) -> tuple[Ints, Floats]:
        """Return rows (F, E) over coefficients from `tick` (F,) on as rows over variables.

        Returns:
            The first variable (F,), and the rows (F, E) from it on.
        """
        rows = np.zeros(weights.shape)
        start = self.variable[tick]
        variables = self.variable[tick[:, None] + np.arange(weights.shape[1])]
        column = variables - start[:, None]
        np.add.at(rows, (np.arange(len(tick))[:, None], column), weights)
        return start, rows

    def _differences(self, order: int) -> tuple[Ints, Floats]:
        """Return differences of the coefficients as rows over variables, as `_merged` does."""
        tick = np.arange(len(self.variable) - order)
        return self._merged(tick, differences(len(self.variable), order))

    def _difference_matrix(self, order: int) -> Any:
        """Return differences of the coefficients as a sparse matrix over variables (F, V)."""
        start, rows = self._differences(order)
        column = start[:, None] + np.arange(order + 1)
        row = np.broadcast_to(np.arange(len(start))[:, None], column.shape)
        entries = (rows.ravel(), (row.ravel(), column.ravel()))
        return sparse.coo_array(entries, (len(start), self.size + order)).tocsc()[:, : self.size]

    def _weights(
        self, seconds: Floats, *, speed: bool = False
    ) -> tuple[Ints, tuple[Floats, Floats, Floats]]:
        """Return the weights of coefficients in the distances, or speeds, at any times (F,).

        Returns:
            The first of three coefficients (F,), and the weight (F,) of each.
        """
        tick = np.clip(np.floor(seconds / self.dt).astype(np.int64), 0, max(self.ticks - 2, 0))
        u = seconds / self.dt - tick
        if speed:
            return tick, ((u - 1.0) / self.dt, (1.0 - 2.0 * u) / self.dt, u / self.dt)
        return tick, (np.square(1.0 - u) / 2.0, 0.5 + u - np.square(u), np.square(u) / 2.0)

    def solve(self, observed: Sequence[tuple[Floats, Floats, Floats, bool]]) -> Floats:
        """Return the coefficients (T+1,) that fit best.

        Args:
            observed: times, values, standard deviations (F,), and whether values are speeds.

        Raises:
            UnreconciledError: the solver finds no solution.
        """
        quadratic = np.zeros((4, self.size + 3))
        linear = np.zeros(self.size + 3)
        start, third = self._differences(3)
        weight = np.full(len(start), self.dt / (self.jerk * self.dt**3) ** 2)
        observe(quadratic, linear, start, third, weight)
        for seconds, values, deviation, are_speeds in observed:
            tick, weights = self._weights(seconds, speed=are_speeds)
            start, rows = self._merged(tick, np.column_stack(weights))
            observe(quadratic, linear, start, rows, 1.0 / np.square(deviation), values)
        best = self._optimum(quadratic[:, : self.size], linear[: self.size])
        # Within the solver's tolerance, the motion may run backwards.
        increasing = np.maximum.accumulate(best)
        return np.asarray(increasing[self.variable])

    def _optimum(self, quadratic: Floats, linear: Floats) -> Floats:
        """Return the variables of least cost within the limits.

        The optimum without limits is 20 times as fast; mostly no limit is reached there.

        Args:
            quadratic: lower bands (4, V) of the cost's matrix.
            linear: (V,) right side.

        Raises:
            UnreconciledError: the solver finds no solution.
        """
        with suppress(np.linalg.LinAlgError):
            free = np.asarray(linalg.solveh_banded(quadratic, linear, lower=True))
            if self._is_within_limits(free):
                return free
        constraints, bounds = self._limits()
        shape = (self.size, self.size)
        lower = sparse.dia_array((quadratic, -np.arange(4)), shape)
        upper = lower.T.tocsc()
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.direct_solve_method = "qdldl"  # one thread: the same bits everywhere
        cones = [clarabel.NonnegativeConeT(len(bounds))]
        for equilibrate in (True, False):  # scaling worsens the matrix if fixes are seconds apart
            settings.equilibrate_enable = equilibrate
            solver = clarabel.DefaultSolver(upper, -linear, constraints, bounds, cones, settings)
            solution = solver.solve()
            if solution.status in (
                clarabel.SolverStatus.Solved,
                clarabel.SolverStatus.AlmostSolved,
            ):
                return np.asarray(solution.x)
        raise UnreconciledError("speeds and positions contradict each other; check their units")

    def place(self, coefficients: Floats, seconds: Floats) -> Floats:
        """Return the distances (F,) [m] at any times (F,) [s] for coefficients (T+1,)."""
        tick, (w0, w1, w2) = self._weights(seconds)
        distance: Floats = (
            w0 * coefficients[tick] + w1 * coefficients[tick + 1] + w2 * coefficients[tick + 2]
        )
        return distance

    def at_ticks(self, coefficients: Floats) -> tuple[Floats, Floats]:
        """Return distances (T,) [m] and speeds (T,) [m/s] at the ticks for coefficients (T+1,)."""
        return (coefficients[1:] + coefficients[:-1]) / 2.0, np.diff(coefficients) / self.dt

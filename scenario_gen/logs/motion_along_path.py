# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The motion along a path: distance and speed over time, from positions and measured speeds."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import clarabel  # type: ignore[import-untyped,unused-ignore]
import numpy as np
from scipy import linalg, sparse

from scenario_gen.base.errors import InputError
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.path import differences, observe
from scenario_gen.numerics import Bools, Floats, Ints


@dataclass(frozen=True)
class SmoothingModel:
    """Tuning of smoothing.

    Attributes:
        standing_mps: a vehicle stands if it is slower for a second and its fixes stay in place.
        still_mps: slower than on the way to or from standing.
        max_shift_m: if fixes move farther while the speed is zero, the speed is wrong.
        settling_s: at either end of a stand, free for the motion: a car stops without a step.
        min_travel_m: a vehicle that moves less has no direction of travel.
        straight_m: a shorter path has no shape.
        max_path_m: a longer one, by its speeds, contradicts the fixes, which are cut before.
        round_count: fits of path and motion in turn.
        speed_noise_mps: bounds of the estimated noise of speeds.
        min_doubted_s: a stretch of speeds that contradict the fixes for longer is not used.
    """

    standing_mps: float = 0.3
    still_mps: float = 0.1
    max_shift_m: float = 1.0
    settling_s: float = 0.3
    min_travel_m: float = 0.5
    straight_m: float = 3.0
    max_path_m: float = 200_000.0
    round_count: int = 3
    speed_noise_mps: tuple[float, float] = (0.3, 3.0)
    min_doubted_s: float = 0.5


SMOOTHING = SmoothingModel()


class UnreconciledError(InputError):
    """No motion of a car fits speeds and positions."""


class Motion:
    """Distance along a path over time: a quadratic B-spline fitted by a quadratic program.

    With coefficients c_0 … c_T and ticks i = 0 … T-1: distance s_i = (c_i + c_{i+1})/2, speed
    v_i = (c_{i+1} - c_i)/dt, and the acceleration between two ticks is constant. Second and third
    differences of c are acceleration and jerk, so limits on speed and acceleration are sparse
    linear inequalities. While a vehicle stands, its coefficients are one variable: v = 0 exactly.
    """

    def __init__(self, stands: Bools, config: LogConfig) -> None:
        """Set up the program; the speed is zero at the ticks at which `stands` (T,) is true."""
        dt = config.period
        self.dt = dt
        self.ticks = len(stands)
        # v_i = 0 makes c_{i+1} the variable of c_i.
        self.variable = np.concatenate([[0], np.cumsum(~stands)])
        self.size = int(self.variable[-1]) + 1
        start, third = self._differences(3)
        weight = np.full(len(start), dt / (config.jerk * dt**3) ** 2)
        self.prior = np.zeros((4, self.size + 3))
        no_target = np.zeros(len(weight))
        observe(self.prior, np.zeros(self.size + 3), start, third, 1, weight, no_target)
        self.constraints, self.bounds = self._limits(config)

    def _limits(self, config: LogConfig) -> tuple[Any, Floats]:
        """Return the matrix and right side of the limits: speed, acceleration, deceleration."""
        speed_start, first = self._differences(1)
        start, second = self._differences(2)
        speed = first * (1.0 / self.dt)
        acceleration = second * (1.0 / np.square(self.dt))
        blocks = ((speed_start, -speed), (start, acceleration), (start, -acceleration))
        counts = [len(block_start) for block_start, _ in blocks]
        limits = [0.0, config.acceleration_limit, config.braking_limit]
        row_starts = np.cumsum([0, *counts])
        rows = [
            np.repeat(row_start + np.arange(len(values)), values.shape[1])
            for row_start, (_, values) in zip(row_starts, blocks, strict=False)
        ]
        columns = [
            (block_start[:, None] + np.arange(values.shape[1])).ravel()
            for block_start, values in blocks
        ]
        entries = np.concatenate([values.ravel() for _, values in blocks])
        used = entries != 0.0  # merged variables leave the last entries of a row empty
        indices = (np.concatenate(rows)[used], np.concatenate(columns)[used])
        shape = (row_starts[-1], self.size)
        return sparse.csc_array((entries[used], indices), shape), np.repeat(limits, counts)

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
        quadratic = self.prior.copy()
        linear = np.zeros(self.size + 3)
        for seconds, values, deviation, are_speeds in observed:
            tick, weights = self._weights(seconds, speed=are_speeds)
            start, rows = self._merged(tick, np.column_stack(weights))
            observe(quadratic, linear, start, rows, 1, 1.0 / np.square(deviation), values)
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
            if (self.constraints @ free <= self.bounds).all():
                return free
        shape = (self.size, self.size)
        lower = sparse.dia_array((quadratic, -np.arange(4)), shape)
        upper = lower.T.tocsc()
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.direct_solve_method = "qdldl"  # one thread: the same bits everywhere
        cones = [clarabel.NonnegativeConeT(len(self.bounds))]
        for equilibrate in (True, False):  # scaling worsens the matrix if fixes are seconds apart
            settings.equilibrate_enable = equilibrate
            solver = clarabel.DefaultSolver(
                upper, -linear, self.constraints, self.bounds, cones, settings
            )
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

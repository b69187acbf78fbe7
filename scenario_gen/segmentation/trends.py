"""Changepoints as knots of a constant-acceleration time law: shift them to where the trends change, drop the least useful."""

import numpy as np

from scenario_gen.arrays import Floats, Ints

SPEED_SCALE = 0.2


def hats(length: int, knots: Ints) -> Floats:
    """(length, K) basis of the continuous piecewise-linear functions with the given K knots, the first 0, the last length - 1."""
    return np.column_stack([np.interp(np.arange(length), knots, row) for row in np.eye(len(knots))])


def misfit(signals: Floats, start: int, stop: int, inside: Ints) -> float:
    """Squared misfit of signals (n, T) in start..stop to continuous piecewise-linear functions with knots `inside`."""
    knots = np.concatenate([[0], np.asarray(inside) - start, [stop - 1 - start]])
    basis = hats(stop - start, knots)
    wanted = signals[:, start:stop].T
    gram = basis.T @ basis + 1e-9 * np.eye(len(knots))
    rest = wanted - basis @ np.linalg.solve(gram, basis.T @ wanted)
    return float((rest**2).sum())


def _around(points: Ints, i: int, samples: int) -> tuple[int, int, Ints]:
    """Return the stretch that changepoint i has a say in: start, stop, and the other changepoints in it."""
    before, after = points[max(i - 2, 0) : i], points[i + 1 : i + 3]
    start = int(before[0]) if len(before) == 2 else 0
    stop = int(after[1]) + 1 if len(after) == 2 else samples
    others = np.concatenate([before[-1:], after[:1]])
    return start, stop, others


def cost_of_removal(signals: Floats, points: Ints, i: int) -> float:
    """How much worse the signals are described without changepoint i."""
    start, stop, others = _around(points, i, signals.shape[1])
    return misfit(signals, start, stop, others) - misfit(signals, start, stop, np.sort(np.append(others, points[i])))


def settle(signals: Floats, points: Ints, reach: int, gap: int, rounds: int = 3) -> Ints:
    """Shift each changepoint by up to `reach` samples to where the signals' trends change.

    Args:
        signals: (n, T), each in units of its own noise.
        points: (K,) changepoints.
        reach: samples.
        gap: least distance between changepoints and from either end.
        rounds: passes over all changepoints.
    """
    points = np.array(points)
    home = points.copy()
    samples = signals.shape[1]
    for _ in range(rounds):
        before = points.copy()
        for i in range(len(points)):
            low = max(home[i] - reach, (points[i - 1] if i else 0) + gap)
            high = min(home[i] + reach, (points[i + 1] if i + 1 < len(points) else samples - 1) - gap)
            start, stop, others = _around(points, i, samples)
            places = np.arange(low, high + 1)
            if len(places):
                costs = [misfit(signals, start, stop, np.sort(np.append(others, c))) for c in places]
                points[i] = places[int(np.argmin(costs))]
        if np.array_equal(before, points):
            break
    return points


def thin(signals: Floats, points: Ints, wanted: int) -> Ints:
    """Drop changepoints, always the one that the signals' description misses least, until `wanted` are left."""
    points = np.array(points)
    while len(points) > wanted:
        costs = [cost_of_removal(signals, points, i) for i in range(len(points))]
        points = np.delete(points, int(np.argmin(costs)))
    return points

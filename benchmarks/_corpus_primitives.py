# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Encounters whose primitives are known: two vehicles whose accelerations are drawn from a few, segment by segment. Synthetic."""

import numpy as np

from scenario_gen.numerics.arrays import Ints
from scenario_gen.types.encounter import Encounter, Vehicle

DT = 0.1
PRIMITIVES = np.array(
    [[0, 0], [-1.6, 0], [0, -1.6], [1.4, 0], [0, 1.4], [-1.5, -1.5], [1.3, 1.3], [-1.5, 1.4]]
)  # m/s² of each
FAST, SLOW = 16.0, 5.0  # m/s: a vehicle that would leave these does something else


def planted_encounter(random: np.random.Generator, name: str) -> tuple[Encounter, Ints, Ints]:
    """Return an encounter of 15 to 25 s, its changepoints (K,) and the planted primitive of each sample (T,)."""
    speed = random.uniform(8.0, 13.0, 2)
    labels: list[int] = []
    accelerations = []
    last = -1
    while len(labels) < 150 + 100 * random.random():
        steps = int(random.uniform(20, 45))
        ends = speed + PRIMITIVES * steps * DT
        able = [
            k
            for k in range(len(PRIMITIVES))
            if k != last and (ends[k] < FAST).all() and (ends[k] > SLOW).all()
        ]
        last = int(random.choice(able)) if able else 0
        labels += [last] * steps
        accelerations += [PRIMITIVES[last]] * steps
        speed = speed + PRIMITIVES[last] * steps * DT
    found = np.array(labels)
    driven = np.array(accelerations).T
    start = speed[:, None] - driven.sum(axis=1, keepdims=True) * DT
    speeds = start + np.cumsum(driven, axis=1) * DT - driven * DT
    noisy = np.maximum(speeds + 0.03 * random.standard_normal(speeds.shape), 0.0)
    ways = np.cumsum(speeds, axis=1) * DT
    position = np.stack(
        [
            np.stack([ways[0], np.zeros(len(found))], 1),
            np.stack([-ways[1] + 100.0, np.full(len(found), 3.5)], 1),
        ]
    )
    heading = np.repeat(np.array([[0.0], [np.pi]]), len(found), axis=1)
    points = np.flatnonzero(np.diff(found)) + 1
    return (
        Encounter(
            name, (Vehicle("a"), Vehicle("b")), 0, round(DT * 1e9), position, heading, noisy
        ),
        points,
        found,
    )


def f1(found: Ints, true: Ints, tolerance: int = 5) -> tuple[int, int, int]:
    """Return matched, found and true changepoints; each true one is matched once, within `tolerance` samples."""
    left = list(found.tolist())
    matched = 0
    for point in true.tolist():
        near = [other for other in left if abs(other - point) <= tolerance]
        if near:
            left.remove(min(near, key=lambda other: abs(other - point)))
            matched += 1
    return matched, len(found), len(true)


def score(counts: list[tuple[int, int, int]]) -> float:
    """F1 of changepoints over many encounters."""
    matched, found, true = (sum(int(one[k]) for one in counts) for k in range(3))
    return 2.0 * matched / max(found + true, 1)

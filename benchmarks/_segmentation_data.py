# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sequences with known states for the segmentation benchmark: cells A-D (docs/benchmarks.md states their separation)."""

from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.numerics.arrays import Floats, Ints
from scenario_gen.types import Encounter, Vehicle


@dataclass(frozen=True)
class Labelled:
    """A sequence with its truth: x (T, D), labels (T,), and the parameters it was drawn with (None where there are none)."""

    x: Floats
    labels: Ints
    means: Floats | None = None
    covariances: Floats | None = None
    transition: Floats | None = None
    encounter: Encounter | None = None

    @property
    def changepoints(self) -> Ints:
        """Samples whose label differs from the one before."""
        return np.flatnonzero(np.diff(self.labels)) + 1


CELLS = {"A": (300, 6, 4), "B": (3000, 6, 6), "C": (3000, 24, 8)}
DWELL = 40.0
DISTANCE = 2.0


def gaussian_hmm(cell: str, seed: int, distance: float = DISTANCE, dof: float = 0.0) -> Labelled:
    """A sticky Gaussian HMM: mean dwell 40, state means about `distance` apart in all, eigenvalues in 0.25-1.5 on random axes.

    With `dof` > 0 the noise is Student's t with so many degrees of freedom.
    """
    samples, dimensions, states = CELLS[cell]
    rng = np.random.default_rng([seed, ord(cell)])
    means = rng.normal(size=(states, dimensions)) * distance / np.sqrt(2.0 * dimensions)
    covariances = np.empty((states, dimensions, dimensions))
    for k in range(states):
        axes = np.linalg.qr(rng.normal(size=(dimensions, dimensions)))[0]
        covariances[k] = axes @ np.diag(rng.uniform(0.25, 1.5, dimensions)) @ axes.T
    transition = np.full((states, states), 1.0 / (DWELL * (states - 1)))
    np.fill_diagonal(transition, 1.0 - 1.0 / DWELL)
    labels = np.empty(samples, np.int64)
    labels[0] = rng.integers(states)
    for t in range(1, samples):
        labels[t] = rng.choice(states, p=transition[labels[t - 1]])
    factors = np.linalg.cholesky(covariances)
    noise = np.einsum("tij,tj->ti", factors[labels], rng.normal(size=(samples, dimensions)))
    if dof > 0.0:
        noise /= np.sqrt(rng.chisquare(dof, size=(samples, 1)) / dof)
    x = means[labels] + noise
    return Labelled(x, labels, means, covariances, transition)


def _schedule(rng: np.random.Generator, samples: int) -> tuple[Floats, Floats, Floats]:
    """Speed, acceleration and turn rate (T,) of one driver: cruises, speed changes, turns, stops; each 3-8 s long."""
    dt = 0.1
    speed, acceleration, turn = np.zeros(samples), np.zeros(samples), np.zeros(samples)
    v, t, last = rng.uniform(6.0, 14.0), 0, "cruise"
    while t < samples:
        choices = ["cruise", "accelerate", "brake", "turn", "stop"]
        if v < 0.1:
            choices = ["stand"] if last == "stop" else ["accelerate"]
        else:
            choices = [
                c
                for c in choices
                if c != last
                and not (c == "accelerate" and v > 15.0)
                and not (c == "brake" and v < 6.0)
            ]
        last = str(rng.choice(choices))
        length = int(rng.uniform(30, 80))
        a = omega = 0.0
        if last == "accelerate":
            a = rng.uniform(0.7, 2.0)
            length = min(length, max(int((17.0 - v) / a / dt), 10))
        elif last == "brake":
            a = -rng.uniform(0.7, 2.0)
            length = min(length, int((v - 3.0) / -a / dt))
        elif last == "turn":
            omega = rng.choice([-1.0, 1.0]) * rng.uniform(0.15, 0.35)
            length = int(rng.uniform(30, 60))
        elif last == "stop":
            a = -rng.uniform(1.0, 2.5)
            length = max(round(v / -a / dt), 1)
            a = -v / (length * dt)
        length = max(length, 10)
        for _ in range(min(length, samples - t)):
            speed[t], acceleration[t], turn[t] = v, a, omega
            v = max(v + a * dt, 0.0)
            t += 1
        if last == "stop":
            v = 0.0
    return speed, acceleration, turn


def driving(seed: int, samples: int = 1200) -> Labelled:
    """Cell D: two vehicles with piecewise-constant acceleration and turn rate; noise 0.15 m per axis and 0.1 m/s.

    `x` is the raw (T, 6): x, y, speed of each vehicle; a label is a maximal interval in which nothing changes.
    """
    rng = np.random.default_rng([seed, ord("D")])
    speeds, keys, positions, headings = [], [], [], []
    for vehicle in range(2):
        speed, acceleration, turn = _schedule(rng, samples)
        heading = rng.uniform(-np.pi, np.pi) + np.concatenate([[0.0], np.cumsum(turn[:-1]) * 0.1])
        step = 0.5 * (speed[:-1] + speed[1:]) * 0.1
        middle = 0.5 * (heading[:-1] + heading[1:])
        xy = np.zeros((samples, 2))
        xy[1:] = np.cumsum(np.column_stack([step * np.cos(middle), step * np.sin(middle)]), axis=0)
        speeds.append(speed)
        keys.append(np.column_stack([acceleration, turn]))
        positions.append(xy + np.array([0.0, 20.0 * vehicle]))
        headings.append(heading)
    changed = (np.diff(np.hstack(keys), axis=0) != 0.0).any(axis=1)
    labels = np.concatenate([[0], np.cumsum(changed)]).astype(np.int64)
    noisy_speed = np.maximum(np.array(speeds) + rng.normal(size=(2, samples)) * 0.1, 0.0)
    noisy_position = np.array(positions) + rng.normal(size=(2, samples, 2)) * 0.15
    encounter = Encounter.sampled(
        (Vehicle("0"), Vehicle("1")),
        0.1,
        noisy_position,
        np.array(headings),
        noisy_speed,
        name=f"D-{seed}",
    )
    x = np.column_stack([noisy_position[0], noisy_speed[0], noisy_position[1], noisy_speed[1]])
    return Labelled(x, labels, encounter=encounter)


def with_outliers(
    encounter: Encounter, rng: np.random.Generator, share: float = 0.01
) -> Encounter:
    """Single speeds off by 10 m/s and single positions off by 20 m (standard deviations)."""
    position, speed = encounter.position.copy(), encounter.speed.copy()
    wrong = rng.uniform(size=speed.shape) < share
    speed[wrong] = np.maximum(speed[wrong] + 10.0 * rng.normal(size=wrong.sum()), 0.0)
    wrong = rng.uniform(size=speed.shape) < share
    position[wrong] += 20.0 * rng.normal(size=(wrong.sum(), 2))
    return replace(encounter, position=position, speed=speed)


def with_gaps(encounter: Encounter, rng: np.random.Generator, share: float = 0.05) -> Encounter:
    """Samples of a vehicle lost, and filled with lines between their neighbours as the reader of logs does."""
    position, speed = encounter.position.copy(), encounter.speed.copy()
    t = np.arange(speed.shape[1])
    for xy, v in zip(position, speed, strict=True):
        kept = rng.uniform(size=len(t)) >= share
        v[:] = np.interp(t, t[kept], v[kept])
        xy[:] = np.column_stack([np.interp(t, t[kept], xy[kept, axis]) for axis in range(2)])
    return replace(encounter, position=position, speed=speed)

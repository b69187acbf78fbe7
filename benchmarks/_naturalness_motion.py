# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Measures of motion per vehicle: jerk, changes of sign, extrema of speed, lateral acceleration and yaw rate, turns.

Recorded and generated motion go through the same operators on the same clock (0.1 s): acceleration is the difference of speeds,
jerk that of accelerations; yaw rate is the difference of headings, lateral acceleration speed times yaw rate.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenario_gen.numerics.arrays import Floats

DT = 0.1
ACCELERATION_BAND, YAW_BAND = 0.1, 0.01  # m/s², rad/s: below it a value has no sign
EXTREMUM = 0.3  # m/s: speeds that turn by less are no extremum
TURN = 25.0  # degrees
SHORT = 2.0  # m: who drives less stands
CLEARLY_TURNS = 45.0  # degrees


@dataclass(frozen=True, eq=False)
class Signals:
    """Motion of N vehicles every 0.1 s and what follows from it.

    Attributes:
        time: (T,) s.
        position: (N, T, 2) m.
        heading: (N, T) rad.
        speed: (N, T) m/s.
        acceleration: (N, T - 1) m/s²; jerk: (N, T - 2) m/s³.
        yaw_rate: (N, T - 1) rad/s; lateral: (N, T - 1) m/s², lateral acceleration.
    """

    time: Floats
    position: Floats
    heading: Floats
    speed: Floats
    acceleration: Floats
    jerk: Floats
    yaw_rate: Floats
    lateral: Floats

    @classmethod
    def of(cls, motion: Mapping[str, Any]) -> "Signals":
        """Derive them from plain arrays; a clock that is not of 0.1 s is interpolated."""
        time, heading = (
            np.asarray(motion["time"], dtype=float),
            np.unwrap(motion["heading"], axis=1),
        )
        position: Floats = np.array(motion["position"])
        speed: Floats = np.array(motion["speed"])
        clock: Floats = np.arange(int(np.floor(time[-1] / DT + 1e-6)) + 1, dtype=np.float64) * DT
        if len(clock) != len(time) or np.abs(clock - time).max() > 1e-6:

            def interpolated(rows: Floats) -> Floats:
                return np.array([np.interp(clock, time, row) for row in rows])

            position = np.stack([interpolated(position[..., axis]) for axis in (0, 1)], axis=-1)
            heading, speed = interpolated(heading), interpolated(speed)
        acceleration, yaw_rate = np.diff(speed, axis=1) / DT, np.diff(heading, axis=1) / DT
        lateral = 0.5 * (speed[:, 1:] + speed[:, :-1]) * yaw_rate
        return cls(
            clock,
            position,
            heading,
            speed,
            acceleration,
            np.diff(acceleration, axis=1) / DT,
            yaw_rate,
            lateral,
        )

    def at_shares(self, share: Floats) -> Floats:
        """Return positions (N, S, 2) [m] at shares (S,) of the duration."""
        time = share * self.time[-1]
        x, y = (
            np.array([np.interp(time, self.time, row) for row in self.position[..., axis]])
            for axis in (0, 1)
        )
        return np.stack([x, y], axis=-1)


def sign_changes(values: Floats, band: float) -> int:
    """How often a series (T,) changes its sign; values within the band have none."""
    signs = np.sign(values[np.abs(values) > band])
    return int((np.diff(signs) != 0).sum())


def extrema(speed: Floats) -> int:
    """How often a speed (T,) turns, by at least EXTREMUM."""
    count, direction, low, high = 0, 0, speed[0], speed[0]
    for value in speed.tolist():
        low, high = min(low, value), max(high, value)
        if direction <= 0 and value - low >= EXTREMUM:
            count += direction < 0
            direction, high = 1, value
        elif direction >= 0 and high - value >= EXTREMUM:
            count += direction > 0
            direction, low = -1, value
    return count


def roughness(signals: Signals) -> dict[str, Floats]:
    """Return the measures of every vehicle, (N,) each; counts are per 10 s but for the extrema."""
    per = 10.0 / max(float(signals.time[-1]), DT)

    def peak(values: Floats) -> Floats:
        return np.asarray(np.abs(values).max(axis=1, initial=0.0))

    def changes(values: Floats, band: float) -> Floats:
        return per * np.array([sign_changes(row, band) for row in values])

    return {
        "jerk": peak(signals.jerk),
        "acceleration changes": changes(signals.acceleration, ACCELERATION_BAND),
        "extrema": np.array([float(extrema(row)) for row in signals.speed]),
        "lateral jerk": peak(np.diff(signals.lateral, axis=1) / DT),
        "lateral changes": changes(signals.lateral, ACCELERATION_BAND),
        "lateral": peak(signals.lateral),
        "yaw acceleration": peak(np.diff(signals.yaw_rate, axis=1) / DT),
        "yaw changes": changes(signals.yaw_rate, YAW_BAND),
        "yaw rate": peak(signals.yaw_rate),
        "acceleration": peak(signals.acceleration),
    }


def turns(signals: Signals) -> Floats:
    """Return by how much each vehicle turns from its start to its end (N,) [degrees]."""
    return np.asarray(np.degrees(signals.heading[:, -1] - signals.heading[:, 0]), dtype=float)


def driven(signals: Signals) -> Floats:
    """Return how far each vehicle drives (N,) [m]."""
    return np.asarray(np.hypot(*np.moveaxis(np.diff(signals.position, axis=1), -1, 0)).sum(axis=1))


def keeps_turn(template: Signals, sample: Signals) -> np.ndarray:
    """Whether each vehicle (N,) turns as in the template: within 25°, and of the same kind (stands, straight, left, right)."""
    before, after = turns(template), turns(sample)
    near = np.abs(before - after) <= TURN
    stands = (driven(template) < SHORT) == (driven(sample) < SHORT)
    small, large = (
        np.minimum(np.abs(before), np.abs(after)),
        np.maximum(np.abs(before), np.abs(after)),
    )
    kind = ~((small < TURN) & (large > CLEARLY_TURNS)) & ~(
        (small >= TURN) & (np.sign(before) != np.sign(after))
    )
    return np.asarray(near & stands & kind)


def arrays(motion: Any) -> dict[str, Any]:
    """Return the motion of an encounter or a scenario as arrays by name."""
    names = ("time", "position", "heading", "speed")
    return {name: np.array(getattr(motion, name)) for name in names}


def displacement(samples: list[Signals]) -> float:
    """Return the mean distance [m] of a vehicle in two samples at the same share of the time."""
    share = np.linspace(0.0, 1.0, 101)
    position = np.array([s.at_shares(share) for s in samples])
    first, second = np.triu_indices(len(position), 1)
    return float(np.linalg.norm(position[first] - position[second], axis=-1).mean())

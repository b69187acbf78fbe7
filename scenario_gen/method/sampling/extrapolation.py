# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Straight on before and behind a route: acceleration and curvature decay, the speed is kept."""

import numpy as np

from scenario_gen.numerics import Floats

MAX_EXTRAPOLATION_S = 4.0  # roads are seldom known much farther
ACCELERATION_DECAY_S = 0.5  # critically damped, so that the jerk begins at 0
_MIN_DECAY_S = 0.2  # a quicker decay would be a jolt
_MIN_SPEED_SHARE = 0.5  # of the speed, left when the acceleration has decayed
_CURVATURE_DECAY_M = 4.0  # as quickly as a driver straightens the wheel
_MAX_BEND_LENGTHS = 4.0  # decay lengths after which the curvature is negligible
_GAUSS_POINTS, _GAUSS_WEIGHT = np.polynomial.legendre.leggauss(6)


def extrapolate(state: Floats, curvature: Floats, since: Floats, sign: float) -> Floats:
    """Return states (S, T, 5) of vehicles that drive on from their states.

    With a time constant f the acceleration is a(t) = a₀ (1 + t / f) exp(-t / f).

    Args:
        state: (S, 5) x, y [m], yaw [rad], speed [m/s], acceleration [m/s²].
        curvature: (S,) 1/m, in these states.
        since: (S, T) seconds after the state, or before it.
        sign: 1 after it, -1 before it.
    """
    x, y, yaw, speed, acceleration = (column[:, None] for column in state.T)
    gain, decay = sign * acceleration, _decay_time(state, sign)[:, None]
    left = np.exp(-since / decay)
    driven = speed * since + gain * decay * (
        2.0 * since - 3.0 * decay + (3.0 * decay + since) * left
    )
    turned, ahead, left_by = _decaying_bend(sign * curvature[:, None], driven)
    cos, sin = np.cos(yaw), np.sin(yaw)
    columns = (
        x + sign * (ahead * cos - left_by * sin),
        y + sign * (ahead * sin + left_by * cos),
        yaw + turned,
        speed + gain * (2.0 * decay - (2.0 * decay + since) * left),
        acceleration * (1.0 + since / decay) * left,
    )
    return np.stack(columns, axis=-1)


def extrapolation_time(state: Floats, ahead: float, sign: float) -> Floats:
    """Return for how long (S,) [s] vehicles can drive on; 0 if only with a jolt.

    Args:
        state: (S, 5) as for `extrapolate`.
        ahead: metres of free road.
        sign: 1 after the state, -1 before it.
    """
    gain = np.maximum(sign * state[:, 4], 0.0)
    fastest = state[:, 3] + 2.0 * gain * ACCELERATION_DECAY_S
    seconds = np.minimum(ahead / np.maximum(fastest, 1e-3), MAX_EXTRAPOLATION_S)
    return np.where(_decay_time(state, sign) < _MIN_DECAY_S, 0.0, seconds)


def _decay_time(state: Floats, sign: float) -> Floats:
    """Return the time constants (S,) [s] with which accelerations decay before a standstill."""
    loss = np.maximum(-sign * state[:, 4], 1e-9)
    until_slow = np.maximum(0.5 * _MIN_SPEED_SHARE * state[:, 3] / loss, 1e-6)
    return np.minimum(ACCELERATION_DECAY_S, until_slow)


def _decaying_bend(curvature: Floats, driven: Floats) -> tuple[Floats, Floats, Floats]:
    """Return heading [rad], and place ahead and to the left [m], on a path that straightens.

    Args:
        curvature: (S, 1) 1/m at its start; it decays exponentially with the distance.
        driven: (S, T) metres along it.
    """
    length = _CURVATURE_DECAY_M

    def heading(distance: Floats) -> Floats:
        return np.asarray(curvature * length * (1.0 - np.exp(-distance / length)))

    curved = np.minimum(driven, _MAX_BEND_LENGTHS * length)
    rest = driven - curved
    turned = heading(curved)
    ahead, left = rest * np.cos(turned), rest * np.sin(turned)
    for point, weight in zip(_GAUSS_POINTS.tolist(), _GAUSS_WEIGHT.tolist(), strict=True):
        between = heading(curved * (0.5 + 0.5 * point))
        ahead = ahead + 0.5 * weight * curved * np.cos(between)
        left = left + 0.5 * weight * curved * np.sin(between)
    return turned, ahead, left

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The noise of measured positions and speeds."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from scenario_gen.numerics import Bools, Floats

_NOISE_M = (0.1, 1.5)  # bounds of the estimates
_MIN_FIX_COUNT = 30  # moving fixes from which noise can be estimated


def estimated_noise(fix: Floats, least: float = _NOISE_M[0]) -> float:
    """Return the standard deviation [m] of fixes (F, 2) [m] about local parabolas.

    It is the larger one of those along and across the direction of travel, and at least `least`.
    """
    half = min(15, (len(fix) - 1) // 2)
    if half < 3:
        return 0.5
    lag = np.arange(-half, half + 1)
    place = fix @ (1.0, 1.0j)
    # At lag 0, the slope and the value of the parabola.
    fitted = sliding_window_view(place, len(lag)) @ np.linalg.pinv(np.vander(lag, 3))[1:].T
    slope, value = fitted.T
    ahead = np.exp(-1.0j * np.angle(slope))
    residual = (place[half : len(fix) - half] - value) * ahead
    return float(np.clip(_larger_noise(residual.real, residual.imag), least, _NOISE_M[1]))


def residual_noise(
    first_estimate: float, is_moving: Bools, lateral: Floats, longitudinal: Floats
) -> float:
    """Return the standard deviation [m] of fixes about the path and motion fitted to them.

    It is at most twice the first estimate. Without that bound, noise and smoothness would increase
    each other, since smoothing leaves noise of long memory.

    Args:
        first_estimate: returned if few fixes are of a moving vehicle, since those of a standing
            one are often repeated.
        is_moving: (F,) whether the vehicle moves.
        lateral: (F,) of the fixes from the path [m].
        longitudinal: (F,) of the fixes from the motion along it [m].
    """
    if is_moving.sum() < _MIN_FIX_COUNT:
        return first_estimate
    noise = _larger_noise(longitudinal[is_moving], lateral[is_moving])
    low, high = _NOISE_M
    return float(np.clip(noise, low, min(2.0 * first_estimate, high)))


def _larger_noise(along: Floats, across: Floats) -> float:
    return max(white_equivalent(along), white_equivalent(across))


def white_equivalent(noise: Floats) -> float:
    """Return the deviation of white noise whose mean is as uncertain as that of noise (T,).

    Values beyond three robust deviations are clipped; the deviation is then scaled by the root of
    the autocorrelation time, 1 + 2 Σ ρ_l over the lags before the first ρ_l below 0.1.
    """
    noise = noise - np.median(noise)
    limit = 3.0 * 1.4826 * float(np.median(np.abs(noise))) + 1e-3
    noise = np.clip(noise, -limit, limit)
    power = float(np.square(noise).sum())
    time = 1.0
    for lag in range(1, min(20, len(noise) // 3)):
        correlation = float((noise[:-lag] * noise[lag:]).sum()) / max(power, 1e-12)
        if correlation < 0.1:
            break
        time += 2.0 * correlation
    return float(np.sqrt(power / len(noise) * time))

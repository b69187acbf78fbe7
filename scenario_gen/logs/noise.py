# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Speeds and noise of raw fixes."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from scenario_gen.numerics import Bools, Floats

_NOISE_M = (0.1, 1.5)  # bounds of the estimates
_MIN_FIX_COUNT = 30  # moving fixes from which noise can be estimated


def speed_of_fixes(seconds: Floats, fix: Floats, window: float = 0.5) -> Floats:
    """Return the speeds (F,) [m/s] of raw fixes (F, 2) [m], over `window` seconds around each."""
    first = np.searchsorted(seconds, seconds - window / 2.0 - 1e-9)
    last = np.searchsorted(seconds, seconds + window / 2.0 + 1e-9) - 1
    is_alone = last <= first
    first = np.where(is_alone, np.maximum(first - 1, 0), first)
    last = np.where(is_alone, np.minimum(last + 1, len(fix) - 1), last)
    rate: Floats = np.hypot(*(fix[last] - fix[first]).T) / (seconds[last] - seconds[first])
    return rate


def estimated_noise(fix: Floats) -> float:
    """Return the standard deviation [m] of fixes (F, 2) [m] about local parabolas."""
    half = min(15, (len(fix) - 1) // 2)
    if half < 3:
        return 0.5
    lag = np.arange(-half, half + 1)
    square = np.square(lag) - np.square(lag).mean()
    # Value at lag 0 of the parabola that fits best.
    parabola = 1.0 / len(lag) - np.square(lag).mean() * square / np.square(square).sum()
    residual = fix[half : len(fix) - half] - sliding_window_view(fix, len(lag), axis=0) @ parabola
    noise = max(white_equivalent(residual[:, 0]), white_equivalent(residual[:, 1]))
    return float(np.clip(noise, *_NOISE_M))


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
    noise = max(white_equivalent(lateral[is_moving]), white_equivalent(longitudinal[is_moving]))
    low, high = _NOISE_M
    return float(np.clip(noise, low, min(2.0 * first_estimate, high)))


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

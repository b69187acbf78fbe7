# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Features: longitudinal and lateral acceleration of each vehicle, and whether it moves.

Positions and speeds drift during a steady drive, and Gaussian states would cut the drift into
pieces; accelerations are nearly constant within a primitive (paper IV-B) and jump between
primitives. They are the coefficients of lines (speed) and parabolas (position) fitted over
windows. Of the windows that contain a sample, the one with the best fit is used, so that a window
across a changepoint does not blur it (the idea of Kuwahara's edge-preserving filter). Lateral
acceleration has the same unit as the longitudinal one and, unlike the turn rate, stays bounded at
walking pace. Speed enters only as a soft switch between standing and moving. The gap to other
vehicles is not used: it is an integral of speeds and drifts like a position.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from scenario_gen.method.segmentation.hdp_hmm.problem import moving_mean
from scenario_gen.numerics import Floats
from scenario_gen.types import Motion
from scenario_gen.types.motion import held

STAND_BLUR_RATIO = 0.2  # differences of `moving` that are noise
STAND_WINDOW_S = 0.9
MIN_SPIKE_M, MIN_SPIKE_MPS = 0.5, 0.5  # smaller deviations are no spikes


def _best_window(
    signals: Sequence[Floats], width: int, degree: int, value: Callable[[list[Floats]], Floats]
) -> Floats:
    """Return, for each sample, `value` of the best-fitting window that contains it.

    Args:
        signals: each (T,); they share the choice of window.
        width: samples in a window.
        degree: of the polynomials that are fitted in every window.
        value: function of the coefficients (W, degree + 1) of each signal, in powers of samples
            from the window's middle; returns (W,).
    """
    samples = len(signals[0])
    width = min(width, samples)
    middle = (width - 1) / 2.0
    powers = np.vander(np.arange(width) - middle, degree + 1, increasing=True)
    fit = np.linalg.pinv(powers).T
    coefficients, misfit = [], np.zeros(samples - width + 1)
    for signal in signals:
        windows = sliding_window_view(signal, width)
        fitted = windows @ fit
        misfit += np.square(windows - fitted @ powers.T).sum(axis=1)
        coefficients.append(fitted)
    t = np.arange(samples)
    offsets = [width - 1, (3 * width) // 4, width // 2, width // 4, 0]
    around = np.clip(np.array([t - offset for offset in offsets]), 0, samples - width)
    chosen = around[misfit[around].argmin(axis=0), t]
    result: Floats = value(coefficients)[chosen]
    return result


def without_spikes(values: Floats, floor: float) -> Floats:
    """Replace single outliers of values (T, D) by interpolation (Hampel's filter).

    An outlier is more than `floor` and more than six times the median distance away from the
    median of the two samples on either side. Of neighbouring outliers the farthest one is removed
    first, since it shifts the medians of the others.
    """
    t = np.arange(len(values))
    spikes = np.zeros(len(values), np.bool_)
    for _ in range(4 if len(values) >= 5 else 0):
        around = np.stack([values[:-4], values[1:-3], values[3:-1], values[4:]])
        far = np.zeros(len(values))
        far[2:-2] = np.sqrt(np.square(values[2:-2] - np.median(around, axis=0)).sum(axis=1))
        peaks = far >= sliding_window_view(np.pad(far, 2), 5).max(axis=1)
        new = peaks & (far > np.maximum(6.0 * 1.4826 * np.median(far[2:-2]), floor))
        if not new.any():
            break
        spikes |= new
        values = np.column_stack(
            [np.interp(t, t[~spikes], column[~spikes]) for column in values.T]
        )
    return values


def without_outliers(encounter: Motion) -> Motion:
    """Replace single positions and speeds that contradict their neighbours."""
    position = np.stack([without_spikes(xy, MIN_SPIKE_M) for xy in encounter.position])
    speed = np.stack([without_spikes(v[:, None], MIN_SPIKE_MPS)[:, 0] for v in encounter.speed])
    return replace(encounter, position=position, speed=speed)


def longitudinal_acceleration(speed: Floats, dt: float, window: float) -> Floats:
    """Return the acceleration (T,) [m/s²] from speed (T,) [m/s], by lines over `window` s."""
    width = max(3, round(window / dt))
    return _best_window([speed], width, 1, lambda c: c[0][:, 1] / dt)


def lateral_acceleration(position: Floats, dt: float, window: float) -> Floats:
    """Return the lateral acceleration (T,) [m/s²], positive to the left.

    Parabolas are fitted to the position (T, 2) [m] over `window` seconds.
    """

    def lateral(c: list[Floats]) -> Floats:
        velocity = np.stack([c[0][:, 1], c[1][:, 1]]) / dt
        acceleration = 2.0 * np.stack([c[0][:, 2], c[1][:, 2]]) / np.square(dt)
        cross = velocity[0] * acceleration[1] - velocity[1] * acceleration[0]
        return np.asarray(cross / np.maximum(np.hypot(velocity[0], velocity[1]), 1.0))

    if len(position) < 4:
        return np.zeros(len(position))
    return _best_window([position[:, 0], position[:, 1]], max(4, round(window / dt)), 2, lateral)


def moving(speed: Floats, dt: float, slow: float) -> Floats:
    """Return 0 where the vehicle stands, 1 where it moves, and a ramp between: (T,).

    The ramp is `slow` m/s wide, in the moving average of the speed (T,) [m/s].
    """
    smooth = moving_mean(speed, max(1, min(round(STAND_WINDOW_S / dt), len(speed))))
    return np.asarray(np.clip((smooth - 0.5 * slow) / slow, 0.0, 1.0))


def driving_features(
    encounter: Motion,
    speed_window: float,
    turn_window: float,
    speed_noise: float,
    turn_noise: float,
) -> tuple[Floats, Floats]:
    """Return features (T, 3N) of an encounter, vehicle by vehicle, and their noise (3N,).

    A vehicle's first or last features are held where it is absent.

    Args:
        encounter: N vehicles, T samples.
        speed_window: seconds, for the longitudinal acceleration.
        turn_window: seconds, for the lateral one.
        speed_noise: m/s², differences in longitudinal acceleration that are noise.
        turn_noise: m/s², the same for the lateral one.
    """
    vehicles, dt = encounter.vehicles, encounter.dt
    features = np.zeros((*encounter.speed.shape, 3))
    for i, vehicle in enumerate(vehicles):
        present = encounter.present_slice(i)
        position, speed = encounter.position[i, present], encounter.speed[i, present]
        moves = moving(speed, dt, vehicle.kind.waits_below)
        features[i, present, 0] = longitudinal_acceleration(speed, dt, speed_window)
        features[i, present, 1] = lateral_acceleration(position, dt, turn_window) * moves
        features[i, present, 2] = moves
    noise = np.tile([speed_noise, turn_noise, STAND_BLUR_RATIO], len(vehicles))
    return np.column_stack(list(held(features, encounter.present))), noise


def paper_features(encounter: Motion) -> Floats:
    """Return the paper's positions and speeds (T, 3N)."""
    stacked = np.concatenate((encounter.position, encounter.speed[..., None]), axis=-1)
    return np.column_stack(list(stacked))

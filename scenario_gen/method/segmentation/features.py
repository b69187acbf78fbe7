# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What the sampler looks at: per vehicle longitudinal and lateral acceleration, and whether it moves.

Positions and speeds drift through a steady drive, and a Gaussian state chops the drift into pieces; accelerations stay put
within a primitive (paper IV-B) and jump between primitives. They come from straight lines (speed) and parabolas
(position) fitted over a window: of the windows that contain a sample the one that fits best decides, so that a window which
straddles a changepoint does not blur it (the idea of Kuwahara's edge-preserving filter). Lateral acceleration rather than
turn rate: it is in the same unit, and does not explode at walking pace. Speed itself enters as a soft switch between
standing and moving only. The gap to other vehicles is left out: it is an integral of speeds and drifts like a position.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from scenario_gen.method.segmentation.hdp_hmm.problem import moving_mean
from scenario_gen.numerics import Floats
from scenario_gen.types import Motion

STAND_BLUR = 0.2
STAND_WINDOW = 0.9
POSITION_FLOOR, SPEED_FLOOR = 0.5, 0.5
SPIKE_ROUNDS = 4


def _best_window(
    signals: Sequence[Floats], width: int, degree: int, value: Callable[[list[Floats]], Floats]
) -> Floats:
    """Fit polynomials over every window of `width` samples; per sample, `value` of the window around it with the least misfit.

    Args:
        signals: each (T,); they share the choice of window.
        width: samples in a window.
        degree: of the polynomials.
        value: from one (W, degree + 1) array of coefficients per signal, powers of samples from the window's middle, to (W,).
    """
    samples = len(signals[0])
    width = min(width, samples)
    middle = (width - 1) / 2.0
    powers = np.vander(np.arange(width) - middle, degree + 1, increasing=True)
    fit = np.linalg.pinv(powers).T
    coefficients, misfit = [], np.zeros(samples - width + 1)
    for signal in signals:
        windows = sliding_window_view(signal, width)
        found = windows @ fit
        misfit += np.square(windows - found @ powers.T).sum(axis=1)
        coefficients.append(found)
    t = np.arange(samples)
    offsets = [width - 1, (3 * width) // 4, width // 2, width // 4, 0]
    around = np.clip(np.array([t - offset for offset in offsets]), 0, samples - width)
    chosen = around[misfit[around].argmin(axis=0), t]
    result: Floats = value(coefficients)[chosen]
    return result


def without_spikes(values: Floats, floor: float) -> Floats:
    """Replace single samples of values (T, D) that lie far from their neighbours by what lies between these (Hampel's filter).

    Far is six times the usual distance (by its median) from the median of the two samples on either side, and `floor`; of
    neighbours, the one that is farthest goes first, for it moves the others' medians.
    """
    t = np.arange(len(values))
    spikes = np.zeros(len(values), np.bool_)
    for _ in range(SPIKE_ROUNDS if len(values) >= 5 else 0):
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
    """Return the encounter without single positions and speeds that no vehicle could have had between its neighbours."""
    position = np.stack([without_spikes(xy, POSITION_FLOOR) for xy in encounter.position])
    speed = np.stack([without_spikes(v[:, None], SPEED_FLOOR)[:, 0] for v in encounter.speed])
    return replace(encounter, position=position, speed=speed)


def longitudinal_acceleration(speed: Floats, dt: float, window: float) -> Floats:
    """(T,) m/s² from speed (T,) by lines over `window` seconds."""
    width = max(3, round(window / dt))
    return _best_window([speed], width, 1, lambda c: c[0][:, 1] / dt)


def lateral_acceleration(position: Floats, dt: float, window: float) -> Floats:
    """(T,) m/s², positive to the left, from position (T, 2) by parabolas over `window` seconds."""

    def lateral(c: list[Floats]) -> Floats:
        velocity = np.stack([c[0][:, 1], c[1][:, 1]]) / dt
        acceleration = 2.0 * np.stack([c[0][:, 2], c[1][:, 2]]) / np.square(dt)
        cross = velocity[0] * acceleration[1] - velocity[1] * acceleration[0]
        return np.asarray(cross / np.maximum(np.hypot(velocity[0], velocity[1]), 1.0))

    if len(position) < 4:
        return np.zeros(len(position))
    return _best_window([position[:, 0], position[:, 1]], max(4, round(window / dt)), 2, lateral)


def moving(speed: Floats, dt: float, slow: float) -> Floats:
    """(T,) 0 where the vehicle stands, 1 where it moves, a ramp of `slow` m/s between, from speed (T,) averaged over 0.9 s."""
    smooth = moving_mean(speed, max(1, min(round(STAND_WINDOW / dt), len(speed))))
    return np.asarray(np.clip((smooth - 0.5 * slow) / slow, 0.0, 1.0))


def driving_features(
    encounter: Motion,
    speed_window: float,
    turn_window: float,
    speed_noise: float,
    turn_noise: float,
) -> tuple[Floats, Floats]:
    """Features (T, 3N) of an encounter, vehicle by vehicle, and the (3N,) spreads below which they mean nothing.

    Args:
        encounter: N vehicles, T samples.
        speed_window: seconds, for the longitudinal acceleration.
        turn_window: seconds, for the lateral one.
        speed_noise: m/s², differences in longitudinal acceleration that are noise.
        turn_noise: m/s², the same for the lateral one.
    """
    features = np.full(
        (encounter.speed.shape[1], len(encounter.vehicles), 3), np.nan
    )  # NaN: not measured, where it is not there
    for i, (first, last) in enumerate(encounter.present.tolist()):
        own = slice(first, last + 1)
        position, speed = encounter.position[i, own], encounter.speed[i, own]
        moves = moving(speed, encounter.dt, encounter.vehicles[i].kind.waits_below)
        features[own, i, 0] = longitudinal_acceleration(speed, encounter.dt, speed_window)
        features[own, i, 1] = lateral_acceleration(position, encounter.dt, turn_window) * moves
        features[own, i, 2] = moves
    return features.reshape(len(features), -1), np.tile(
        [speed_noise, turn_noise, STAND_BLUR], len(encounter.vehicles)
    )


def paper_features(encounter: Motion) -> Floats:
    """(T, 3N) positions and speeds as the paper stacks them; NaN where a vehicle is not there."""
    stacked = np.concatenate((encounter.position, encounter.speed[..., None]), axis=-1)
    return np.column_stack(list(np.where(encounter.is_present[..., None], stacked, np.nan)))

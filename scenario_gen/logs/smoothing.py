# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Reconciling positions with measured speeds: a vehicle moves forward along a smooth path.

A track becomes a path (a curve by arc length, `path.py`) and a motion along it (place and speed over time, `motion.py`),
fitted in turn. The path is smooth in *distance*, so GPS noise does not become heading noise however slowly the vehicle
creeps; the motion is smooth in *time*, never runs backwards, keeps to the limits of a car and is still where the car stands.
So position, speed and heading agree by construction: the distance between samples is the mean of their speeds times dt, and
the heading is the path's direction, held while standing.
"""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from scenario_gen import exact
from scenario_gen.arrays import Bools, Floats
from scenario_gen.logs.cleaning import Track
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.intervals import runs
from scenario_gen.logs.motion import Motion
from scenario_gen.logs.path import fit_path, Path, STRAIGHT, straight_path

STANDS = 0.3  # m/s: below this a vehicle stands, if it does so for a second and its fixes stay in place
STILL = 0.1  # m/s: below this it is not on its way to or from standing
CREEPS = 1.0  # m: fixes that move further than this while the speed is zero say that the speed is wrong
DOUBTED = 3.0  # m/s: a speed that differs more from that of the fixes has no say in the first layout; if most do, in nothing
MOVED = 0.5  # m: who moves less has no direction of travel
ROUNDS = 3  # of path and motion in turn


@dataclass(frozen=True, eq=False)
class Smooth:
    """A piece of a track on the common clock: T samples from tick `first` on.

    Attributes:
        first: index of the first sample on the common clock.
        position: (T, 2) metres.
        heading: (T,) rad, unwrapped; NaN if the vehicle never moved and its log does not say.
        speed: (T,) m/s.
        before: (S,) measured speed less the speed of the raw fixes [m/s].
        after: (T,) published speed less the speed of the published positions [m/s].
        changed: (S,) measured speed less the published speed [m/s].
        moved: (F,) distance of the raw fixes from the published positions at their stamps [m].
    """

    first: int
    position: Floats
    heading: Floats
    speed: Floats
    before: Floats
    after: Floats
    changed: Floats
    moved: Floats


def smooth_piece(piece: Track, origin_ns: int, config: LogConfig) -> Smooth | None:
    """Fit path and motion to a piece of a track; `origin_ns` is the stamp of tick 0 of the common clock.

    Returns:
        The piece on the clock, or None if fewer than three ticks lie in it.
    """
    dt = config.period
    fix_t = (piece.fix_ns - origin_ns).astype(np.float64) * 1e-9
    speed_t = (piece.speed_ns - origin_ns).astype(np.float64) * 1e-9
    first, last = int(np.ceil(fix_t[0] / dt - 1e-6)), int(np.floor(fix_t[-1] / dt + 1e-6))
    if last - first < 2:
        return None
    fix_t, speed_t = fix_t - first * dt, speed_t - first * dt
    raw = speed_of_fixes(fix_t, piece.fix)
    speed = piece.speed
    if not len(speed):
        speed_t, speed = fix_t, raw
    noise = config.position_noise or estimated_noise(piece.fix)
    ticks = dt * np.arange(last - first + 1, dtype=np.float64)
    stands = standing(ticks, fix_t, piece.fix, speed_t, speed)
    motion = Motion(stands, config)
    differs = speed - np.interp(speed_t, fix_t, raw)
    deviation = config.speed_noise or float(np.clip(white_equivalent(differs), 0.3, 3.0))
    trusted = len(piece.speed) > 0 and np.median(np.abs(differs)) <= max(DOUBTED, 5.0 * noise)
    measured = [(speed_t, speed, deviation * np.ones(len(speed)), True)] if trusted else []
    guess = layout(ticks, stands, np.interp(ticks, speed_t, speed), np.interp(ticks, fix_t, raw), fix_t)
    weight = np.ones(len(fix_t))
    for _ in range(ROUNDS):
        path = path_of(guess, piece, weight, noise)
        place, aside = path.project(guess, piece.fix)
        drive = motion.solve([*measured, (fix_t, place, noise / np.sqrt(weight), False)])
        guess = motion.place(drive, fix_t)
        weight = np.minimum(1.0, 2.0 * noise / np.maximum(exact.hypot(aside, place - guess), 1e-9))  # Huber's
    place, published = motion.at_ticks(drive)
    position, heading = path.pose(place)
    if np.ptp(place) < MOVED and not np.isfinite(piece.heading).any():
        heading = np.full(len(place), np.nan)
    return Smooth(
        first=first,
        position=position,
        heading=heading,
        speed=published,
        before=differs,
        after=published - speed_of_fixes(ticks, position),
        changed=piece.speed - np.interp(speed_t, ticks, published)[: len(piece.speed)],
        moved=exact.hypot(*(piece.fix - path.pose(guess)[0]).T),
    )


def layout(ticks: Floats, stands: Bools, speed: Floats, raw: Floats, seconds: Floats) -> Floats:
    """A first guess of the distance driven at `seconds`: its speed integrated, or that of the fixes where it is far off."""
    rate = np.where(stands, 0.0, np.where(np.abs(speed - raw) > DOUBTED, raw, speed))
    driven = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2.0 * np.diff(ticks))])
    guess: Floats = np.interp(seconds, ticks, driven)
    return guess


def path_of(guess: Floats, piece: Track, weight: Floats, noise: float) -> Path:
    """Fit the path; one too short to have a shape is straight, in the recorded heading where there is one."""
    low, high = float(guess.min()), float(guess.max())
    if high - low >= STRAIGHT:
        return fit_path(guess, piece.fix, weight, noise)
    known = piece.heading[np.isfinite(piece.heading)]
    if len(known):
        heading = float(exact.arctan2(np.median(exact.sin(known)), np.median(exact.cos(known))))
    else:  # the direction of the fixes' regression on the distance driven
        lever = guess - guess.mean()
        heading = float(exact.arctan2(*exact.matmul(lever, piece.fix - piece.fix.mean(axis=0))[::-1]))
    point = np.median(piece.fix, axis=0)
    return straight_path(point, heading, 2.0 * float(np.median(guess)) - high, high)


def speed_of_fixes(seconds: Floats, fix: Floats, window: float = 0.5) -> Floats:
    """(F,) speeds of the raw fixes over `window` seconds around each [m/s]."""
    early = np.searchsorted(seconds, seconds - window / 2.0 - 1e-9)
    late = np.searchsorted(seconds, seconds + window / 2.0 + 1e-9) - 1
    early, late = (
        np.where(late > early, early, np.maximum(early - 1, 0)),
        np.where(late > early, late, np.minimum(late + 1, len(fix) - 1)),
    )
    rate: Floats = exact.hypot(*(fix[late] - fix[early]).T) / (seconds[late] - seconds[early])
    return rate


def estimated_noise(fix: Floats) -> float:
    """Standard deviation of the fixes [m]: from their residuals about local parabolas."""
    half = min(15, (len(fix) - 1) // 2)
    if half < 3:
        return 0.5
    lag = np.arange(-half, half + 1)
    square = np.square(lag) - np.square(lag).mean()
    parabola = 1.0 / len(lag) - np.square(lag).mean() * square / np.square(square).sum()  # the fitted parabola's value at lag 0
    residual = fix[half : len(fix) - half] - exact.matmul(sliding_window_view(fix, len(lag), axis=0), parabola)
    return float(np.clip(max(white_equivalent(residual[:, 0]), white_equivalent(residual[:, 1])), 0.1, 1.5))


def white_equivalent(noise: Floats) -> float:
    """Standard deviation of the white noise that says as little about the mean as this coloured noise.

    Values beyond three robust deviations are pulled in; the deviation is then scaled by the root of the autocorrelation
    time, 1 + 2 Σ ρ_l over the lags before the first ρ_l below 0.1.
    """
    noise = noise - np.median(noise)
    limit = 3.0 * 1.4826 * float(np.median(np.abs(noise))) + 1e-3
    noise = np.clip(noise, -limit, limit)
    power, time = float(np.square(noise).sum()), 1.0
    for lag in range(1, min(20, len(noise) // 3)):
        correlation = float((noise[:-lag] * noise[lag:]).sum()) / max(power, 1e-12)
        if correlation < 0.1:
            break
        time += 2.0 * correlation
    return float(np.sqrt(power / len(noise) * time))


def standing(ticks: Floats, fix_t: Floats, fix: Floats, speed_t: Floats, speed: Floats) -> Bools:
    """Return at which ticks the vehicle stands: slow for at least a second, with fixes that stay in place.

    Args:
        ticks: (T,) seconds.
        fix_t: (F,) seconds.
        fix: (F, 2) metres.
        speed_t: (S,) seconds.
        speed: (S,) m/s.
    """
    dt = ticks[1] - ticks[0]
    half = round(0.2 / dt)
    padded = np.pad(np.interp(ticks, speed_t, speed), half, mode="edge")
    smooth = np.median(sliding_window_view(padded, 2 * half + 1), axis=1)
    stands = np.zeros(len(ticks), dtype=bool)
    for begin, end in runs(smooth < STANDS):
        still = begin + np.flatnonzero(smooth[begin:end] <= max(STILL, 1.5 * float(np.median(smooth[begin:end]))))
        begin, end = int(still[0]), int(still[-1]) + 1  # noqa: PLW2901 - rolling to the stop and away from it is no standing
        inside = fix[(fix_t >= ticks[begin]) & (fix_t <= ticks[end - 1])]
        k = max(len(inside) // 5, 1)
        if (end - begin) * dt >= 1.0 and len(inside):
            shift = np.median(inside[-k:], axis=0) - np.median(inside[:k], axis=0)
            stands[begin:end] = exact.hypot(*shift) <= CREEPS
    return stands

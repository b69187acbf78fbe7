"""Reconciling positions with measured speeds: a vehicle moves forward along a smooth path.

A track becomes a path (a curve by arc length, `path.py`) and a motion along it (place and speed over time, `motion.py`),
fitted in turn. The path is smooth in *distance*, so GPS noise does not become heading noise however slowly the vehicle
creeps; the motion is smooth in *time*, never runs backwards, keeps to the limits of a car and is still where the car stands.
So position, speed and heading agree by construction: the distance between samples is the mean of their speeds times dt, and
the heading is the path's direction, held while standing.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.signal import savgol_filter

from scenario_gen.arrays import Bools, Floats
from scenario_gen.logs.cleaning import Track
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.motion import Motion
from scenario_gen.logs.path import STRAIGHT, Path, fit_path, straight_path

STANDS = 0.3  # m/s: below this a vehicle stands, if it does so for a second and its fixes stay in place
CREEPS = 1.0  # m: fixes that move further than this while the speed is zero say that the speed is wrong
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
        after: (S,) measured speed less the published speed [m/s].
        moved: (F,) distance of the raw fixes from the published positions at their stamps [m].
    """

    first: int
    position: Floats
    heading: Floats
    speed: Floats
    before: Floats
    after: Floats
    moved: Floats


def smooth_piece(piece: Track, origin_ns: int, config: LogConfig) -> Smooth | None:
    """Fit path and motion to a piece of a track; `origin_ns` is the stamp of tick 0 of the common clock.

    Returns:
        The piece on the clock, or None if fewer than three ticks lie in it.
    """
    dt = config.period
    fix_t, speed_t = (piece.fix_ns - origin_ns) * 1e-9, (piece.speed_ns - origin_ns) * 1e-9
    first, last = int(np.ceil(fix_t[0] / dt - 1e-6)), int(np.floor(fix_t[-1] / dt + 1e-6))
    if last - first < 2:
        return None
    fix_t, speed_t = fix_t - first * dt, speed_t - first * dt
    raw = speed_of_fixes(fix_t, piece.fix)
    speed = piece.speed
    if not len(speed):
        speed_t, speed = fix_t, raw
    noise = config.position_noise or estimated_noise(piece.fix)
    motion = Motion(standing((last - first + 1, dt), fix_t, piece.fix, speed_t, speed), config)
    measured = (speed_t, speed, np.full(len(speed), config.speed_noise), True)
    # The fixes' own speed has a small say in the first layout, in case the sensor lies.
    drive = motion.solve([measured, (fix_t, raw, np.full(len(raw), 4.0 * config.speed_noise), True)])
    weight = np.ones(len(fix_t))
    for _ in range(ROUNDS):
        guess = motion.place(drive, fix_t)
        path = path_of(guess, piece, weight, noise)
        place, aside = path.project(guess, piece.fix)
        drive = motion.solve([measured, (fix_t, place, noise / np.sqrt(weight), False)])
        error = np.hypot(aside, place - motion.place(drive, fix_t))
        weight = np.minimum(1.0, 2.0 * noise / np.maximum(error, 1e-9))  # Huber's
    place, published = motion.at_ticks(drive)
    position, heading = path.pose(place)
    if np.ptp(place) < STRAIGHT and not np.isfinite(piece.heading).any() and np.ptp(place) < 0.5:
        heading = np.full(len(place), np.nan)
    ticks = dt * np.arange(len(place))
    return Smooth(
        first=first,
        position=position,
        heading=heading,
        speed=published,
        before=speed - np.interp(speed_t, fix_t, raw),
        after=speed - np.interp(speed_t, ticks, published),
        moved=np.hypot(*(piece.fix - path.pose(motion.place(drive, fix_t))[0]).T),
    )


def path_of(guess: Floats, piece: Track, weight: Floats, noise: float) -> Path:
    """Fit the path; one too short to have a shape is straight, in the recorded heading where there is one."""
    low, high = float(guess.min()), float(guess.max())
    if high - low >= STRAIGHT:
        return fit_path(guess, piece.fix, weight, noise)
    known = piece.heading[np.isfinite(piece.heading)]
    if len(known):
        heading = float(np.arctan2(np.median(np.sin(known)), np.median(np.cos(known))))
    else:  # the direction of the fixes' regression on the distance driven
        lever = guess - guess.mean()
        heading = float(np.arctan2(*(lever @ (piece.fix - piece.fix.mean(axis=0)))[::-1]))
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
    return np.hypot(*(fix[late] - fix[early]).T) / (seconds[late] - seconds[early])


def estimated_noise(fix: Floats) -> float:
    """Standard deviation of the fixes [m] from their residuals about local parabolas, doubled because GPS noise is coloured."""
    window = min(31, len(fix) - 1 + len(fix) % 2)
    if window < 7:
        return 0.5
    residual = fix - savgol_filter(fix, window, 2, axis=0)
    return float(np.clip(2.0 * 1.4826 * np.median(np.abs(residual - np.median(residual, axis=0))), 0.1, 1.5))


def standing(clock: tuple[int, float], fix_t: Floats, fix: Floats, speed_t: Floats, speed: Floats) -> Bools:
    """Return at which ticks the vehicle stands: slow for at least a second, with fixes that stay in place.

    Args:
        clock: number of ticks and their period [s].
        fix_t: (F,) seconds.
        fix: (F, 2) metres.
        speed_t: (S,) seconds.
        speed: (S,) m/s.
    """
    count, dt = clock
    ticks = dt * np.arange(count)
    width = 2 * int(round(0.2 / dt)) + 1
    slow = median_filter(np.interp(ticks, speed_t, speed), width, mode="nearest") < STANDS
    edges = np.flatnonzero(np.diff(np.concatenate([[False], slow, [False]]).astype(int)))
    stands = np.zeros(count, dtype=bool)
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        inside = fix[(fix_t >= ticks[begin]) & (fix_t <= ticks[end - 1])]
        if (end - begin) * dt < 1.0 - 1e-9:
            continue
        k = max(len(inside) // 5, 1)
        if len(inside) and np.hypot(*(np.median(inside[-k:], axis=0) - np.median(inside[:k], axis=0))) <= CREEPS:
            stands[begin:end] = True
    return stands

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Followers: who reacts to the vehicle ahead in its lane, how late and how strongly."""

from collections.abc import Sequence
import math

import numpy as np

from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.numerics.rounding import ROUNDING_S
from scenario_gen.situation.evidence import (
    closeness_confidence,
    combined_confidence,
    Evidence,
    LIMITS,
    need_confidence,
    Recording,
    smoothed_speed,
)
from scenario_gen.situation.gaps import bumper_gaps, is_behind, MIN_HEADWAY_SPEED_MPS
from scenario_gen.types import FOLLOW, Reaction


def following_evidence(recording: Recording) -> list[Evidence]:
    """Return the evidence of all vehicles that follow another one, with the nearest one ahead."""
    encounter = recording.encounter
    evidence = []
    for who in range(len(recording.tracks)):
        others = [n for n in range(len(recording.tracks)) if n != who]
        gaps = np.stack([bumper_gaps(encounter, who, n) for n in others])
        overlaps = np.array(
            [[LIMITS.overlap_share * encounter.vehicles[n].length] for n in others]
        )
        behind = np.stack([is_behind(encounter, who, n) for n in others]) & (gaps > -overlaps)
        nearest = np.where(behind, gaps, np.inf).min(axis=0)
        for whom, rows, gap in zip(others, behind & (gaps <= nearest), gaps, strict=True):
            pair = _follower(recording, who, whom, rows, gap)
            evidence += [] if pair is None else [pair]
    return evidence


def nearest_leaders(following: Sequence[Evidence]) -> dict[int, Reaction]:
    """Return one reaction per follower: the longest and most certain one."""
    leading: dict[int, Reaction] = {}
    for edge in (pair.reaction for pair in following):
        if edge is not None:
            leading[edge.who] = max(
                leading.get(edge.who, edge),
                edge,
                key=lambda each: (each.until - each.since) * each.confidence,
            )
    return leading


def _follower(
    recording: Recording, who: int, whom: int, behind: Bools, gaps: Floats
) -> Evidence | None:
    """Return the evidence of a vehicle that drives `behind` (T,) another one with `gaps` (T,) [m].

    None if it does so for too short a time, or never moves.
    """
    encounter = recording.encounter
    dt, time = encounter.dt, encounter.time
    rows = np.flatnonzero(behind)
    speed = smoothed_speed(encounter.speed[who], dt)
    leader_speed = smoothed_speed(encounter.speed[whom], dt)
    stands = len(rows) and speed[rows].max() < encounter.vehicles[who].kind.waits_below
    if len(rows) * dt < LIMITS.min_following_s - ROUNDING_S or stands:
        return None

    closing = speed[rows] - leader_speed[rows]
    slows = float(speed[rows].max() - speed[rows[-1]]) >= LIMITS.slowing_mps
    overtakes = float(closing.min()) > LIMITS.overtaking_mps and not slows
    seconds = np.sort(gaps[rows] / np.maximum(speed[rows], LIMITS.slow_follower_mps))
    time_gap = float(seconds[round(LIMITS.closest_for_s / dt)])
    lag, likeness = _best_lag(np.gradient(speed, dt), np.gradient(leader_speed, dt), behind, dt)
    closeness = closeness_confidence(time_gap, LIMITS.lane_time_s)
    need = need_confidence(recording, who, whom)
    confidence = combined_confidence(closeness, need, 0.0 if closeness else likeness)
    if confidence < LIMITS.min_confidence or overtakes:
        return Evidence(who, whom, time_gap)

    reaction = Reaction(
        FOLLOW,
        who,
        whom,
        lag,
        _gain(speed, leader_speed, rows, round(lag / dt)),
        _residual(speed[rows], gaps[rows]),
        confidence,
        float(time[rows[0]]),
        float(time[rows[-1]]),
        _headway(speed[rows], gaps[rows]),
    )
    return Evidence(who, whom, time_gap, reaction)


def _gain(speed: Floats, leader_speed: Floats, rows: Ints, steps: int) -> float:
    """How much of a leader's change of speed its follower adopts `steps` samples later."""
    delayed = rows[rows >= steps]
    led, answer = leader_speed[delayed - steps], speed[delayed]
    spread = float(np.std(led))
    if spread < LIMITS.steady_spread_mps:
        return LIMITS.gain.high
    gain = float(((led - led.mean()) * (answer - answer.mean())).mean()) / (spread * spread)
    return min(max(gain, LIMITS.gain.low), LIMITS.gain.high)


def _residual(speed: Floats, gaps: Floats) -> float:
    """The standard deviation [m] of a follower's gaps (k,) that its speeds (k,) do not explain."""
    line = np.column_stack([np.ones(len(speed)), speed])
    rest = gaps - line @ np.linalg.lstsq(line, gaps, rcond=None)[0]
    gap = max(float(np.median(gaps)), 1.0)
    low, high = LIMITS.residual_share
    return min(max(float(np.std(rest)), low * gap), high * gap)


def _headway(speed: Floats, gaps: Floats) -> tuple[float, float, float]:
    """Least, median and greatest time gap [s] of a follower while it drives."""
    moves = speed > MIN_HEADWAY_SPEED_MPS
    if not moves.any():
        moves = np.ones_like(moves)
    headway = np.sort(gaps[moves] / np.maximum(speed[moves], MIN_HEADWAY_SPEED_MPS))
    return float(headway[0]), float(headway[len(headway) // 2]), float(headway[-1])


def _best_lag(
    acceleration: Floats, leader_acceleration: Floats, behind: Bools, dt: float
) -> tuple[float, float]:
    """The most likely lag [s] of a follower, and the share of variance that its leader explains.

    The likelihood of a lag is that of the correlation at this lag, times that of human lags. The
    share is 0 if the greatest correlation may be one of independent series; its standard error is
    that of Bartlett (1946) for series with their autocorrelations.
    """
    lags, correlations = [], []
    greatest, best = 0.0, (acceleration, leader_acceleration)
    first, last = (round(lag / dt) for lag in LIMITS.lag_s)
    for steps in range(max(first, 1), last + 1):
        rows = np.flatnonzero(behind[steps:]) + steps
        if len(rows) * dt < LIMITS.min_following_s - ROUNDING_S:
            break
        a = acceleration[rows] - acceleration[rows].mean()
        b = leader_acceleration[rows - steps] - leader_acceleration[rows - steps].mean()
        size = float(np.sqrt(np.square(a).mean() * np.square(b).mean()))
        correlation = float((a * b).mean()) / size if size > 1e-4 else 0.0
        lags.append(steps * dt)
        correlations.append(correlation)
        if correlation > greatest:
            greatest, best = correlation, (a, b)
    if greatest <= 0.0:
        return LIMITS.human_lag_s, 0.0

    error = _standard_error(*best)
    explained = np.square(np.clip(correlations, 0.0, LIMITS.max_correlation))
    deviation = (np.array(lags) - LIMITS.human_lag_s) / LIMITS.human_lag_sigma_s
    likelihood = -0.5 * np.log1p(-explained) / (error * error) - 0.5 * np.square(deviation)
    is_significant = greatest > LIMITS.significance_sigmas * error
    return lags[int(np.argmax(likelihood))], greatest * greatest if is_significant else 0.0


def _standard_error(a: Floats, b: Floats) -> float:
    """The standard error of the correlation between two independent series (n,)."""
    n = len(a)
    total = 1.0
    for k in range(1, n // 2):
        weight = 1.0 - k / n
        correlation_a = (a[k:] * a[:-k]).mean() / np.square(a).mean()
        correlation_b = (b[k:] * b[:-k]).mean() / np.square(b).mean()
        total += 2.0 * weight * weight * float(correlation_a * correlation_b)
    return math.sqrt(max(total, 1.0) / n)

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which vehicles react to which: following, yielding, and the graph of all reactions."""

from collections.abc import Sequence
from dataclasses import replace
import math

import numpy as np

from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.numerics.rounding import ROUNDING_S
from scenario_gen.situation.conflicts import Conflict
from scenario_gen.situation.gaps import bumper_gaps, is_behind, MIN_HEADWAY_SPEED_MPS
from scenario_gen.situation.signal_stops import find_signal_stops, SignalExplanations
from scenario_gen.situation.tracks import Track, Wait
from scenario_gen.situation.yielding import (
    closeness_confidence,
    combined_confidence,
    Evidence,
    giving_way,
    heading_difference,
    LIMITS,
    need_confidence,
    Recording,
    smoothed_speed,
    waits_for_leader,
    yielding_evidence,
)
from scenario_gen.types import Encounter, FOLLOW, Reaction, ReactionGraph


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


def find_reactions(
    encounter: Encounter,
    tracks: Sequence[Track],
    conflicts: Sequence[Conflict],
    waits: Sequence[Wait],
) -> ReactionGraph:
    """Return the graph of reactions.

    Args:
        encounter: the recording.
        tracks: its cleaned tracks.
        conflicts: its conflicts.
        waits: its waits.
    """
    recording = Recording(encounter, tracks, conflicts, waits)
    following = following_evidence(recording)
    leading = nearest_leaders(following)
    yielding = [yielding_evidence(recording, conflict) for conflict in conflicts]
    evidence = [*following, *(pair for pair in yielding if pair is not None)]

    explained = _explained_pairs(recording, following, yielding)
    yields = [giving_way(recording, *pair) for pair in recording.pairs if pair not in explained]
    yields += [pair.reaction for pair in yielding if pair is not None]
    stops = find_signal_stops(encounter, waits) if encounter.lights else ()
    by_light = SignalExplanations(encounter, stops)
    latest: dict[tuple[int, float], Reaction] = {}
    for reaction in yields:
        if reaction is None or by_light.explain(reaction):
            continue
        if waits_for_leader(reaction, leading.get(reaction.who), waits):
            continue
        key = reaction.who, reaction.until  # the last vehicle to clear ends a wait
        latest[key] = max(
            latest.get(key, reaction), reaction, key=lambda each: (each.clears, each.confidence)
        )
    graph = without_circles([*leading.values(), *latest.values()], len(tracks))
    graph = replace(graph, stops=stops, crossings=by_light.crossings)
    return graph if graph.edges else replace(graph, why=_why_none(recording, evidence))


def _explained_pairs(
    recording: Recording,
    following: Sequence[Evidence],
    yielding: Sequence[Evidence | None],
) -> set[tuple[int, int]]:
    """Return the pairs whose behaviour a conflict or following explains."""
    explained = {(pair.who, pair.whom) for pair in following}
    explained |= {(pair.who, pair.whom) for pair in yielding if pair and pair.reaction}
    for conflict in recording.conflicts:
        passes = (conflict.first, conflict.exit_first), (conflict.second, conflict.entry_second)
        if heading_difference(recording.encounter, *passes) < LIMITS.head_on_rad:
            explained |= {(conflict.first, conflict.second), (conflict.second, conflict.first)}
    return explained


def _why_none(recording: Recording, evidence: Sequence[Evidence]) -> str:
    """Say why there is no reaction."""
    encounter = recording.encounter
    nearest = min(evidence, key=lambda pair: pair.time_gap, default=None)
    if nearest is None or nearest.time_gap == math.inf:
        standing = [
            vehicle.label
            for vehicle, speed in zip(encounter.vehicles, encounter.speed, strict=True)
            if np.all(speed < vehicle.kind.waits_below)
        ]
        why = "none drives behind another one in its lane, or crosses its path"
        if recording.conflicts:
            why = "vehicles share an area, but nothing shows that one reacts to another one"
        return f"{why}; {' and '.join(standing)} stands throughout" if standing else why
    who, whom = (encounter.vehicles[n].label for n in (nearest.who, nearest.whom))
    seconds = math.floor(10.0 * nearest.time_gap) / 10.0
    return (
        f"the nearest are {who} and {whom}, and they are never within {seconds:.1f} s of each"
        " other"
    )


def without_circles(edges: Sequence[Reaction], count: int) -> ReactionGraph:
    """Return the graph of reactions of `count` vehicles.

    Cycles are broken at their least certain reaction.
    """
    kept: list[Reaction] = []
    cut: list[Reaction] = []
    reacts_to: list[set[int]] = [set() for _ in range(count)]  # directly or through others
    for edge in sorted(edges, key=lambda edge: (-edge.confidence, edge.who, edge.whom)):
        if edge.who == edge.whom or edge.who in reacts_to[edge.whom]:
            cut.append(edge)
            continue
        kept.append(edge)
        reached = {edge.whom, *reacts_to[edge.whom]}
        for n in range(count):
            if n == edge.who or edge.who in reacts_to[n]:
                reacts_to[n] |= reached
    order = tuple(sorted(range(count), key=lambda n: (len(reacts_to[n]), n)))
    kept.sort(key=lambda edge: (order.index(edge.who), edge.whom, edge.kind, edge.until))
    return ReactionGraph(tuple(kept), order, tuple(cut))

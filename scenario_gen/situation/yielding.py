# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Yielding: a vehicle passes second at a conflict, or slows for one that it does not follow."""

from collections.abc import Sequence
import math

import numpy as np

from scenario_gen.numerics import ahead_and_left, wrap_angle
from scenario_gen.numerics.rounding import ROUNDING_S
from scenario_gen.situation.conflicts import Conflict
from scenario_gen.situation.evidence import (
    closeness_confidence,
    combined_confidence,
    Evidence,
    heading_difference,
    LIMITS,
    need_confidence,
    Recording,
)
from scenario_gen.situation.gaps import (
    HALF_LANE_M,
    is_behind,
    MAX_HEADING_DIFFERENCE_RAD,
    MIN_HEADWAY_SPEED_MPS,
    passing,
)
from scenario_gen.situation.tracks import Wait
from scenario_gen.types import Reaction, YIELD


def yielding_evidence(recording: Recording, conflict: Conflict) -> Evidence | None:
    """Return the evidence of the second vehicle at a conflict.

    None if it drives behind the first one before and after, or enters when it is first recorded.
    The reaction that an encounter was made with is certain.
    """
    encounter, who, whom = recording.encounter, conflict.second, conflict.first
    is_decided = recording.decided_yield == (who, whom)
    if not is_decided and not _comes_from_beside(recording, conflict):
        return None

    clears, enters = passing(encounter, conflict, merges=conflict.following)
    gap = enters - clears
    turned = heading_difference(encounter, (who, enters), (whom, clears))
    crosses = conflict.following or LIMITS.side_by_side_rad < turned < LIMITS.head_on_rad
    time_gap = max(gap, 0.0) if gap > -LIMITS.anticipation_s and crosses else math.inf
    since, until, stands = _slowing(recording, who, clears, enters)
    lag = until - clears
    departs = stands and lag > -LIMITS.anticipation_s
    fade = (LIMITS.crossing_time_s.high, 2.0 * LIMITS.crossing_time_s.high)
    need = need_confidence(recording, who, whom) * float(np.interp(gap, fade, [1.0, 0.0]))
    # Who drives on steadily answers only one that is close.
    is_close = since < until or time_gap <= LIMITS.crossing_time_s.low
    confidence = combined_confidence(
        closeness_confidence(time_gap, LIMITS.crossing_time_s) if is_close else 0.0,
        need,
        _answers_clearing(lag, encounter.duration) if departs else 0.0,
    )
    if confidence < LIMITS.min_confidence and not is_decided:
        return Evidence(who, whom, time_gap)
    reaction = Reaction(
        YIELD,
        who,
        whom,
        lag,
        1.0,
        LIMITS.yield_sigma_s,
        1.0 if is_decided else confidence,
        since,
        until,
        gap=gap,
        stands=stands,
        merges=conflict.following,
    )
    return Evidence(who, whom, time_gap, reaction)


def _answers_clearing(lag: float, duration: float) -> float:
    """The probability that a departure `lag` [s] behind a clearing answers it.

    The alternative is a departure at any time of the recording, which lasts `duration` [s].
    """
    sigma = LIMITS.departure_sigma_s
    deviation = (lag - LIMITS.departure_lag_s) / sigma
    density = math.exp(-0.5 * deviation * deviation) / (sigma * math.sqrt(2.0 * math.pi))
    return density / (density + 1.0 / max(duration, 1.0))


def _comes_from_beside(recording: Recording, conflict: Conflict) -> bool:
    """Whether the second vehicle enters after it is first recorded, and not behind the first."""
    encounter, who = recording.encounter, conflict.second
    k = max(int(np.searchsorted(encounter.time, conflict.entry_second)) - 1, 0)
    if k <= encounter.present[who, 0]:
        return False
    behind = conflict.following or is_behind(encounter, who, conflict.first)[k]
    return not behind or _enters_from_beside(recording, conflict)


def _enters_from_beside(recording: Recording, conflict: Conflict) -> bool:
    """Whether the second vehicle comes into the first one's lane from beside it."""
    encounter, who = recording.encounter, conflict.second
    half = 0.5 * LIMITS.entry_window_s
    is_before = np.abs(encounter.time - conflict.entry_second + half) <= half + ROUNDING_S
    rows = np.flatnonzero(encounter.is_present[who] & is_before)
    path = recording.tracks[conflict.first].curve
    station, left = path.project(encounter.position[who, rows])
    turned = np.abs(wrap_angle(path.at(station)[:, 2] - encounter.heading[who, rows]))
    is_beside = (np.abs(left) > HALF_LANE_M) | (turned > MAX_HEADING_DIFFERENCE_RAD)
    return bool(((station > 0.0) & is_beside).any())


def giving_way(recording: Recording, who: int, whom: int) -> Reaction | None:
    """Return the reaction of a vehicle that slows for another one without passing behind it.

    It stops before the other one, or lets it pass close by.
    """
    encounter = recording.encounter
    between = encounter.position[whom] - encounter.position[who]
    ahead, _ = ahead_and_left(between, encounter.heading[who])
    both = np.flatnonzero(encounter.is_present[who] & encounter.is_present[whom])
    if len(both) == 0:
        return None
    rows = np.flatnonzero(encounter.is_present[who])
    is_slow = encounter.speed[who, rows[-1]] <= MIN_HEADWAY_SPEED_MPS
    stops = bool(is_slow and ahead[both[-1]] > 0.0)
    if not stops:  # until they pass each other
        nearest = both[int(np.argmin(np.hypot(*between.T)[both]))]
        rows = rows[rows <= nearest]
    speed = encounter.speed[who, rows]
    top = int(np.argmax(speed))
    if speed[top] - speed[-1] < LIMITS.slowing_mps:
        return None
    need = need_confidence(recording, who, whom)
    if need < LIMITS.min_confidence:
        return None
    since, until = encounter.time[rows[top]], encounter.time[rows[-1]]
    return Reaction(
        YIELD,
        who,
        whom,
        0.0,
        1.0,
        LIMITS.yield_sigma_s,
        need,
        float(since),
        float(until),
        gap=math.inf,
        stands=stops,
    )


def _slowing(
    recording: Recording, who: int, clears: float, enters: float
) -> tuple[float, float, bool]:
    """Return when [s] a vehicle begins to slow before it enters, when it departs, if it stands.

    A vehicle that does not stand departs when it is slowest. Both times are its entry if it does
    not slow either.
    """
    encounter = recording.encounter
    time, position = encounter.time, encounter.position[who]
    waits = [
        wait
        for wait in recording.waits
        if wait.vehicle == who and wait.start < clears and wait.end <= enters + 1.0 + ROUNDING_S
    ]
    if waits:
        wait = waits[-1]
        entry = position[min(int(np.searchsorted(time, enters)), len(time) - 1)]
        stand = position[int(np.searchsorted(time, wait.end - ROUNDING_S))]
        if np.hypot(*(stand - entry)) < LIMITS.wait_distance_m:
            return wait.start, wait.end, True

    rows = np.flatnonzero(encounter.is_present[who] & (time <= enters))
    speed = encounter.speed[who, rows]
    low = int(np.argmin(speed))
    top = int(np.argmax(speed[: low + 1]))
    if speed[top] - speed[low] < LIMITS.slowing_mps:
        return enters, enters, False
    return float(time[rows[top]]), float(time[rows[low]]), False


def waits_for_leader(reaction: Reaction, leader: Reaction | None, waits: Sequence[Wait]) -> bool:
    """Whether a yielder stands behind its leader, which departs shortly before it."""
    if leader is None or not reaction.stands:
        return False
    if not leader.since <= reaction.until <= leader.until:
        return False
    longest = LIMITS.lag_s.high + LIMITS.queue_delay_s
    return any(
        wait.vehicle == leader.whom
        and -ROUNDING_S <= reaction.until - wait.end <= longest + ROUNDING_S
        for wait in waits
    )

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Yielding: a vehicle passes second at a conflict, or slows for one that it does not follow.

The evidence for reactions: thresholds, closeness and need.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations
import math
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from scenario_gen.numerics import ahead_and_left, angle_between, Floats, wrap_angle
from scenario_gen.numerics.boxes import footprint_gaps
from scenario_gen.numerics.rounding import ROUNDING_S
from scenario_gen.situation.conflicts import Conflict
from scenario_gen.situation.gaps import (
    HALF_LANE_M,
    is_behind,
    MAX_HEADING_DIFFERENCE_RAD,
    MIN_HEADWAY_SPEED_MPS,
    passing,
)
from scenario_gen.situation.tracks import Track, Wait
from scenario_gen.types import Encounter, Outcome, Reaction, tokens, YIELD


class Range(NamedTuple):
    """A lower and an upper value."""

    low: float
    high: float


@dataclass(frozen=True)
class ReactionThresholds:
    """Thresholds and human values; measured on drawn motions and recorded traffic.

    Attributes:
        min_confidence: below it there is no reaction.
        closeness: confidence of vehicles that are within the lower of two times.
        lane_time_s: time gaps in a lane with this confidence, and with 0.5.
        crossing_time_s: times from clearing to entry with this confidence, and with 0.5.
        anticipation_s: a driver passes at most so long before the other one has cleared.
        slow_follower_mps: slower followers count as driving so fast.
        overlap_share: of a vehicle's length, by which recordings of a queue may overlap.
        closest_for_s: a time gap counts if it lasts so long.
        min_following_s: shorter following has no reaction.
        lag_s: possible lags of a follower.
        human_lag_s, human_lag_sigma_s: lags of human followers, mean and standard deviation.
        max_correlation: greatest correlation; 1 would be infinitely likely.
        significance_sigmas: standard errors by which a correlation is significant.
        smoothing_s: width of the moving mean of speeds.
        steady_spread_mps: a leader with less spread of speed shows no gain.
        gain: limits of a follower's gain.
        residual_share: limits of a follower's residual, shares of its gap.
        head_on_rad, side_by_side_rad: angles between the headings above and below which closeness
            at a conflict is no evidence.
        foresight_s: how far a driver foresees.
        foresight_step_s: between the foreseen instants.
        foresight_period_s: between the instants at which a driver looks ahead.
        margin_m, margin_s: distances that drivers keep between footprints.
        need_confidence: confidence of a great need.
        need_time_s: relief below which there is no need, and scale of its growth.
        departure_lag_s, departure_sigma_s: departures of humans behind a clearing.
        yield_sigma_s: variation of one driver's lag.
        slowing_mps: smaller drops of speed are no slowing.
        overtaking_mps: a vehicle that is always faster than the one ahead by this, and does not
            slow down, overtakes it.
        wait_distance_m: a wait farther from the conflict area has another reason.
        entry_window_s: before an entry, in which a merging vehicle is beside the lane.
        queue_delay_s: in addition to the greatest lag, until a driver starts behind its leader.
    """

    min_confidence: float = 0.3
    closeness: float = 0.9
    lane_time_s: Range = Range(2.0, 4.0)
    crossing_time_s: Range = Range(3.0, 5.0)
    anticipation_s: float = 1.5
    slow_follower_mps: float = 4.0
    overlap_share: float = 0.25
    closest_for_s: float = 1.0
    min_following_s: float = 2.0
    lag_s: Range = Range(0.3, 3.0)
    human_lag_s: float = 1.2
    human_lag_sigma_s: float = 0.6
    max_correlation: float = 0.999
    significance_sigmas: float = 2.6
    smoothing_s: float = 1.0
    steady_spread_mps: float = 0.3
    gain: Range = Range(0.3, 1.0)
    residual_share: Range = Range(0.05, 0.15)
    head_on_rad: float = 2.6
    side_by_side_rad: float = 0.35
    foresight_s: float = 8.0
    foresight_step_s: float = 0.2
    foresight_period_s: float = 0.5
    margin_m: float = 0.5
    margin_s: float = 1.0
    need_confidence: float = 0.9
    need_time_s: float = 0.4
    departure_lag_s: float = 1.2
    departure_sigma_s: float = 1.4
    yield_sigma_s: float = 0.6
    slowing_mps: float = 1.0
    overtaking_mps: float = 2.0
    wait_distance_m: float = 25.0
    entry_window_s: float = 3.0
    queue_delay_s: float = 1.0


LIMITS = ReactionThresholds()


@dataclass(frozen=True)
class Evidence:
    """The evidence from a pair: its time gap, and a reaction if it is certain enough."""

    who: int
    whom: int
    time_gap: float
    reaction: Reaction | None = None


@dataclass(frozen=True, eq=False)
class Recording:
    """An encounter with its tracks, conflicts and waits."""

    encounter: Encounter
    tracks: Sequence[Track]
    conflicts: Sequence[Conflict]
    waits: Sequence[Wait]

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """All ordered pairs of vehicles."""
        return list(permutations(range(len(self.tracks)), 2))

    @property
    def decided_yield(self) -> tuple[int, int] | None:
        """Who yields to whom by the decision that the encounter was made with, if it has one.

        A vehicle that goes second without slowing down does not yield.
        """
        decision = self.encounter.decision
        if decision is None or decision.outcome is Outcome.GOES_SECOND:
            return None
        names = tokens(vehicle.id for vehicle in self.encounter.vehicles)
        first, second = decision.first, decision.second
        if not {first, second} <= set(names):
            return None
        return names.index(second), names.index(first)


def closeness_confidence(time_gap: float, limits: Range) -> float:
    """The confidence of a pair that comes within `time_gap` [s] of each other."""
    if time_gap > limits.high:
        return 0.0
    return float(np.interp(time_gap, limits, [LIMITS.closeness, 0.5]))


def combined_confidence(*confidences: float) -> float:
    """The confidence of independent evidence."""
    return 1.0 - math.prod(1.0 - confidence for confidence in confidences)


def need_confidence(recording: Recording, who: int, whom: int) -> float:
    """The confidence that a driver had to react, and did.

    It foresees a collision, and arrives there later than foreseen. It foresees itself on its own
    path with its present speed and an acceleration that fades within a second, and the other
    vehicle as it drives.
    """
    track, other = recording.tracks[who], recording.tracks[whom]
    rows = np.flatnonzero(track.is_present & other.is_present)
    speed = smoothed_speed(track.speed, track.dt)
    looks = rows[:: max(round(LIMITS.foresight_period_s / track.dt), 1)]
    looks = looks[speed[looks] > MIN_HEADWAY_SPEED_MPS]
    if len(looks) == 0:
        return 0.0

    ahead = np.arange(LIMITS.foresight_step_s, LIMITS.foresight_s, LIMITS.foresight_step_s)
    later = looks[:, None] + np.round(ahead / track.dt).astype(np.int64)
    gained = np.gradient(speed, track.dt)[looks, None] * (ahead - 1.0 + np.exp(-ahead))
    driven = np.maximum.accumulate(speed[looks, None] * ahead + gained, axis=1)
    poses = track.curve.at(track.progress[looks, None] + driven).reshape(-1, 3)
    gap = np.full(len(poses), np.inf)
    for shift in (-LIMITS.margin_s, 0.0, LIMITS.margin_s):
        samples = np.clip(later + round(shift / track.dt), rows[0], rows[-1]).ravel()
        others = other.poses[samples]
        shifted, _ = footprint_gaps(track.vehicle.half, poses, other.vehicle.half, others)
        gap = np.minimum(gap, shifted)

    collides = (gap.reshape(later.shape) < LIMITS.margin_m) & (later <= rows[-1])
    first = np.argmax(collides, axis=1)
    each = np.arange(len(looks))
    recorded = track.progress[np.minimum(later, rows[-1])[each, first]] - track.progress[looks]
    relief = (driven[each, first] - recorded) / speed[looks]
    greatest = max(float(relief[collides.any(axis=1)].max(initial=0.0)) - LIMITS.need_time_s, 0.0)
    return float(LIMITS.need_confidence * (1.0 - np.exp(-greatest / LIMITS.need_time_s)))


def smoothed_speed(speed: Floats, dt: float) -> Floats:
    """The moving mean of speeds (T,), twice."""
    width = 2 * round(0.5 * LIMITS.smoothing_s / dt) + 1
    once = ndimage.uniform_filter1d(speed, width, mode="nearest")
    return np.asarray(ndimage.uniform_filter1d(once, width, mode="nearest"))


def heading_difference(encounter: Encounter, *passes: tuple[int, float]) -> float:
    """The angle [rad] between the headings of two vehicles, each at a time [s] of its own."""
    first, second = (
        float(np.interp(time, encounter.time, encounter.heading[n])) for n, time in passes
    )
    return abs(angle_between(first, second))


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

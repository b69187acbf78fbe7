# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Evidence for reactions: thresholds, closeness and need."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations
import math
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from scenario_gen.numerics import angle_between, Floats
from scenario_gen.numerics.boxes import footprint_gaps
from scenario_gen.situation.conflicts import Conflict
from scenario_gen.situation.gaps import MIN_HEADWAY_SPEED_MPS
from scenario_gen.situation.tracks import Track, Wait
from scenario_gen.types import Encounter, Outcome, Reaction, tokens


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

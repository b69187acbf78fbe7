# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Decisions: encounters in which a driver goes first, rolls or stops, but did not when recorded.

A decision belongs to a conflict whose recorded first vehicle is i and whose second vehicle is j.
The *offered lag* x is the time from the instant at which j could enter the shared area to the
arrival of i, both unhindered. Lags are drawn first, x ~ N(0, σ²), then who goes first:

    P(j goes first | x) = 1 / (1 + exp(-β x)).

`sampling.offered_lag_sigma` and `sampling.decision_rate` are σ and β. Each outcome that differs
from the recorded one is a new encounter of the two vehicles on their recorded paths:

- *Goes first*: j approaches without its brake and its stand. i drives as recorded, is moved in
  time to the lag, and slows down comfortably if it would come too close.
- *Rolls* or *stops*: i drives as recorded, and j approaches freely until it has to slow down for
  i. It rolls if a least speed suffices, else it stops before the area and departs when i has left.

The result must be as human as the recording (`HumanMargins`), and carries its reaction.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
import math
from typing import NamedTuple

import numpy as np
from scipy import special

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.drives import delayed_drive, Drive, free_drive, recorded_drive
from scenario_gen.method.evaluation.law import DISTANCE, Law
from scenario_gen.method.interacting_pair import InteractingPair, pair_of
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.numerics import Floats
from scenario_gen.situation import conflict_of, EncounterKind, passing
from scenario_gen.situation.evidence import heading_difference, LIMITS
from scenario_gen.types import (
    Decided,
    Decision,
    Encounter,
    FOLLOW,
    Outcome,
    token,
    YIELD,
)

DECIDED_KINDS = (EncounterKind.CROSSING, EncounterKind.LEFT_TURN, EncounterKind.MERGING)
LAG_COUNT = 9  # offered lags, each the median of an equally likely part of their law


@dataclass(frozen=True)
class DecisionMargins:
    """What drivers decide in time; measured on recorded yields at junctions.

    Attributes:
        horizon_s: time before the shared area at which a driver decides.
        min_duration_s: of a new encounter.
        min_together_s: time for which both vehicles are present.
        max_merge_lag_s: in a merge a larger lag leaves nothing to decide.
        min_gap_s: from the first vehicle's exit to the second one's entry.
        free_gap_s: a driver who would enter later than this does not slow down.
        approach_s: time before the first entry at which a new encounter begins.
        max_braking_mps2: of any driver, unless one brakes harder in the recording.
        min_courtesy_ratio: share of its speed that a driver keeps who lets another one go first,
            or who merges from beside.
        usual_sigmas: RMS distance from the mean of a kind; four in five recordings are nearer.
        max_rarity_ratio: of a new encounter's distance from the mean to the recording's.
        behind_s: after its entry, when a vehicle has its free speed again.
    """

    horizon_s: float = 4.0
    min_duration_s: float = 5.0
    min_together_s: float = 2.0
    max_merge_lag_s: float = 1.5
    min_gap_s: float = 1.0
    free_gap_s: float = 1.2
    approach_s: float = 5.0
    max_braking_mps2: float = 3.5
    min_courtesy_ratio: float = 0.5
    usual_sigmas: float = 1.5
    max_rarity_ratio: float = 1.2
    behind_s: float = 2.0


MARGINS = DecisionMargins()


@dataclass(frozen=True)
class Decisions:
    """The decisions of an encounter.

    Attributes:
        possible: the recorded outcome first; their probabilities add up to 1. Empty without one.
        refused: outcomes with the reason why no driver would have done that.
        why: why nothing is decided; "" if something is.
    """

    possible: tuple[Decision, ...] = ()
    refused: tuple[tuple[Decision, str], ...] = ()
    why: str = ""


def goes_first_probability(lag: float, rate: float) -> float:
    """Return P(goes first) at an offered lag [s], for a rate β [1/s]."""
    return float(special.expit(rate * lag))


def offered_lags(sigma: float) -> list[float]:
    """Return the offered lags [s]: medians of equally likely parts of N(0, σ²)."""
    quantiles = (np.arange(LAG_COUNT) + 0.5) / LAG_COUNT
    return [float(lag) for lag in np.round(sigma * special.ndtri(quantiles), 2)]


def decisions_of(encounter: Encounter, sampling: SamplingConfig = SamplingConfig()) -> Decisions:
    """Return the outcomes that the decision in an encounter may have, and those it may not.

    Args:
        encounter: a recorded encounter; of more than two vehicles those that interact most decide.
        sampling: has the law of decisions.

    Example:
        >>> from scenario_gen import decisions_of, read_log
        >>> (encounter,) = read_log("my_log.csv").encounters
        >>> [str(decision.outcome) for decision in decisions_of(encounter).possible]
        ['rolls', 'stops', 'goes first']
    """
    try:
        conflict = DecidedConflict.of(encounter)
    except RefusedError as error:
        return Decisions(why=str(error))
    by_outcome: dict[Outcome, list[Decision]] = {}
    refused = []
    for offered in _offered(conflict, sampling):
        try:
            outcome = conflict.meeting(offered).outcome
        except RefusedError as error:
            refused.append((offered, str(error)))
            continue
        if outcome not in (conflict.recorded, Outcome.GOES_SECOND):
            by_outcome.setdefault(outcome, []).append(replace(offered, outcome=outcome))
    possible = [_at_median_lag(decisions) for decisions in by_outcome.values()]
    rest = 1.0 - math.fsum(decision.probability for decision in possible)
    recorded = Decision(*conflict.names, conflict.recorded, round(conflict.lag, 2), rest)
    return Decisions((recorded, *possible), tuple(refused))


def decided(encounter: Encounter, decision: Decision) -> Encounter:
    """Return the encounter with an outcome of its decision; its source names both.

    The recorded outcome leaves it unchanged. Another one has the two vehicles alone.

    Args:
        encounter: a recorded encounter.
        decision: one of `decisions_of`.

    Raises:
        RefusedError: no driver would have done that; the message says why.

    Example:
        >>> from scenario_gen import decided, decisions_of, read_log
        >>> (encounter,) = read_log("my_log.csv").encounters
        >>> decided(encounter, decisions_of(encounter).possible[-1]).decision.outcome
        <Outcome.GOES_FIRST: 'goes first'>
    """
    conflict = DecidedConflict.of(encounter)
    source = Decided(encounter.name, decision)
    if decision.outcome is conflict.recorded:
        return replace(encounter, source=source)
    name = f"{encounter.name}, {decision}, {decision.lag:.1f} s"
    made, outcome = conflict.meeting(decision)
    if outcome is not decision.outcome:
        raise RefusedError(f"at a lag of {decision.lag:g} s vehicle {decision.who} {outcome}")
    start_ns, origin = encounter.start_ns, encounter.origin
    return replace(made, name=name, start_ns=start_ns, origin=origin, source=source)


def _at_median_lag(decisions: Sequence[Decision]) -> Decision:
    """Return the decision at the median of ascending lags, with the probability of all."""
    sums = np.cumsum([decision.probability for decision in decisions])
    median = int(np.searchsorted(sums, 0.5 * sums[-1]))
    return replace(decisions[median], probability=float(sums[-1]))


def _offered(conflict: "DecidedConflict", sampling: SamplingConfig) -> Iterator[Decision]:
    """Yield who goes first at each offered lag, with the joint probability."""
    for lag in offered_lags(sampling.offered_lag_sigma):
        probability = goes_first_probability(lag, sampling.decision_rate)
        yield Decision(*conflict.names, Outcome.GOES_FIRST, lag, probability / LAG_COUNT)
        yield Decision(*conflict.names, Outcome.GOES_SECOND, lag, (1.0 - probability) / LAG_COUNT)


class Meeting(NamedTuple):
    """Two vehicles, the one that goes first first, and what the one that decides does."""

    encounter: Encounter
    outcome: Outcome


@dataclass(frozen=True, eq=False)
class DecidedConflict:
    """A conflict with a decision of its recorded second vehicle.

    Attributes:
        pair: of the recorded encounter.
        free: the second vehicle, as if it were alone.
        lag: the recorded offered lag [s].
    """

    pair: InteractingPair
    free: Drive
    lag: float

    @classmethod
    def of(cls, encounter: Encounter) -> "DecidedConflict":
        """Return the conflict of the two vehicles that interact most.

        Raises:
            RefusedError: there is nothing to decide; the message says why.
        """
        pair = pair_of(encounter)
        if pair is None:
            raise RefusedError("no two vehicles share an area")
        _refuse_undecided(pair)
        conflict, time, second = pair.conflict, encounter.time, pair.tracks[1]
        entry, leaves = np.interp(
            [conflict.entry_second, conflict.entry_second + MARGINS.behind_s],
            time,
            second.progress,
        ).tolist()
        free = free_drive(second, entry, leaves)
        lag = conflict.entry_first - _free_entry(free, entry, time)
        if pair.kind is EncounterKind.MERGING and abs(lag) > MARGINS.max_merge_lag_s:
            raise RefusedError("the vehicle ahead decides this merge")
        return cls(pair, free, lag)

    @property
    def names(self) -> tuple[str, str]:
        """ROS names of the second and of the first vehicle."""
        first, second = self.pair.tracks
        return token(second.vehicle.id), token(first.vehicle.id)

    @property
    def recorded(self) -> Outcome:
        """The recorded outcome."""
        for edge in self.pair.reactions:
            if edge.kind == YIELD and edge.who == self.pair.conflict.second:
                if edge.stands:
                    return Outcome.STOPS
                return Outcome.ROLLS if edge.since < edge.until else Outcome.GOES_SECOND
        return Outcome.GOES_SECOND

    @property
    def _merges_from_beside(self) -> bool:
        """Whether the second vehicle changes lanes: nobody stops for this in moving traffic."""
        conflict = self.pair.conflict
        entries = (conflict.first, conflict.entry_first), (conflict.second, conflict.entry_second)
        turned = heading_difference(self.pair.encounter, *entries)
        return self.pair.kind is EncounterKind.MERGING and turned < LIMITS.side_by_side_rad

    def meeting(self, decision: Decision) -> Meeting:
        """Return the two vehicles with a decision at its lag, and the outcome.

        Whether a vehicle that goes second rolls or stops follows from the lag.

        Raises:
            RefusedError: no driver would do that; the message says why.
        """
        other = recorded_drive(self.pair.tracks[0])
        if decision.outcome is Outcome.GOES_FIRST:
            meeting = _meeting(self.free, other, decision.lag, MARGINS.min_courtesy_ratio)
            meeting = meeting._replace(outcome=Outcome.GOES_FIRST)
        else:
            least = MARGINS.min_courtesy_ratio if self._merges_from_beside else 0.0
            meeting = _meeting(other, self.free, -decision.lag, least)
        self._refuse_inhuman(meeting.encounter)
        return meeting

    def _refuse_inhuman(self, encounter: Encounter) -> None:
        """Refuse two vehicles, the one that goes first first, that no drivers would be.

        Raises:
            RefusedError: it does; the message says how.
        """
        if encounter.duration < MARGINS.min_duration_s:
            raise RefusedError(f"it would last less than {MARGINS.min_duration_s:g} s")
        pair = pair_of(encounter)
        merges = self.pair.conflict.following
        if pair is None or (pair.conflict.first, pair.conflict.following) != (0, merges):
            raise RefusedError("together they would do something else")
        clears, enters = passing(encounter, pair.conflict, merges=merges)
        if pair.features[DISTANCE] <= 0.0 or enters - clears < MARGINS.min_gap_s:
            raise RefusedError("they would come too close")
        allowed = max(MARGINS.max_braking_mps2, _hardest_braking(self.pair.encounter))
        if _hardest_braking(encounter) > allowed:
            raise RefusedError("a driver would brake too hard")
        law = Law.mixed(DECIDED_KINDS)
        allowed = MARGINS.max_rarity_ratio * law.distance(self.pair.features)
        if law.distance(pair.features) > max(allowed, MARGINS.usual_sigmas):
            raise RefusedError("it would be more unusual than the recording")


def _refuse_undecided(pair: InteractingPair) -> None:
    """Refuse a pair without a decision about who goes first.

    Raises:
        RefusedError: the message says why.
    """
    encounter, conflict = pair.encounter, pair.conflict
    both = encounter.present_slice(*conflict.pair)
    if (both.stop - both.start) * encounter.dt < MARGINS.min_together_s:
        raise RefusedError(f"together for less than {MARGINS.min_together_s:g} s")
    if pair.kind not in DECIDED_KINDS:
        raise RefusedError("no vehicle crosses another one's path or merges into it")
    if _follows_before(pair):
        raise RefusedError("the second vehicle follows the first one to the shared area")
    entries = (conflict.first, conflict.entry_first), (conflict.second, conflict.entry_second)
    if any(entry <= pair.presence(n)[0] for n, entry in entries):
        raise RefusedError("a vehicle is inside the shared area when its recording begins")
    if conflict_of(_narrower(encounter), *conflict.pair) is None:
        raise RefusedError("the vehicles hardly touch each other's paths")


def _follows_before(pair: InteractingPair) -> bool:
    """Whether the second vehicle follows the first one before either has entered the area."""
    conflict = pair.conflict
    return any(
        (edge.kind, edge.who) == (FOLLOW, conflict.second) and edge.since < conflict.entry_first
        for edge in pair.reactions
    )


def _hardest_braking(encounter: Encounter) -> float:
    """Return the hardest braking [m/s²] of any vehicle of an encounter."""
    return -float(np.diff(encounter.speed).min()) / encounter.dt


def _narrower(encounter: Encounter) -> Encounter:
    """Return an encounter with vehicles of half their widths."""
    vehicles = tuple(replace(each, width=0.5 * each.width) for each in encounter.vehicles)
    return replace(encounter, vehicles=vehicles)


def _free_entry(free: Drive, entry: float, time: Floats) -> float:
    """Return when [s] a recorded vehicle would enter an area, had it driven on from its decision.

    It decides the horizon before it enters, or when its recording begins.

    Args:
        free: its drive as if it were alone.
        entry: station [m] at which it enters.
        time: (T,) of the recording.
    """
    enters, track = free.time_at(entry), free.track
    decides = float(np.interp(enters - MARGINS.horizon_s, free.time, free.station))
    first = int(track.present[0])
    decides = max(decides, float(track.progress[first]))
    row = max(int(np.searchsorted(track.progress, decides)), first)
    return float(time[row]) + enters - free.time_at(decides)


def _meeting(first: Drive, second: Drive, later: float, least: float = 0.0) -> Meeting:
    """Return the motion of two drives; the second one slows down if it is too early.

    Args:
        first: the drive that goes first.
        second: the other one.
        later: seconds from the first one's entry to the second one's, if it did not slow down.
        least: share of its speed that the second one keeps.

    Raises:
        RefusedError: they would not share an area, or the second one would brake too hard.
    """
    dt = first.track.dt
    after = int(first.time[-1] / dt) + 1
    consecutive = _together(first, second, after)
    conflict = conflict_of(consecutive, 0, 1)
    if conflict is None or conflict.first != 0:
        raise RefusedError("they would not meet")
    clears, enters = passing(consecutive, conflict, merges=conflict.following)
    enters -= after * dt
    arrives = conflict.entry_first + later
    outcome = Outcome.GOES_SECOND
    if clears + MARGINS.free_gap_s > arrives:
        entry = float(np.interp(enters, second.time, second.station))
        free = second
        second = delayed_drive(free, entry, enters + clears - arrives)
        if (second.speed < least * free.speed).any():
            who = second.track.vehicle.id
            raise RefusedError(f"vehicle {who} would have to slow down too much")
        outcome = Outcome.STOPS if second.stand else Outcome.ROLLS
    begin = round((arrives - enters) / dt)
    encounter = _together(first, second, begin)
    approach = round((conflict.entry_first - MARGINS.approach_s) / dt) + max(-begin, 0)
    start = max(int(encounter.present[:, 0].max()), approach)
    if (encounter.present[:, 1].min() - start) * dt < MARGINS.min_together_s:
        raise RefusedError("they would hardly be together")
    return Meeting(encounter.select((0, 1), start), outcome)


def _together(first: Drive, second: Drive, begin: int) -> Encounter:
    """Return two drives; the second one begins `begin` samples after the first."""
    states = first.states(), second.states()
    begins = max(-begin, 0), max(begin, 0)
    present = np.array([(k, k + len(rows) - 1) for k, rows in zip(begins, states, strict=True)])
    samples = np.arange(int(present.max()) + 1)
    rows = np.clip(samples - present[:, :1], 0, np.diff(present))
    values = np.stack([each[row] for each, row in zip(states, rows, strict=True)])
    vehicles = (first.track.vehicle, second.track.vehicle)
    position, heading, speed = values[..., :2], values[..., 2], values[..., 3]
    return Encounter.sampled(
        vehicles, first.track.dt, position, heading, speed, "two drives", present=present
    )

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Decisions: encounters in which a driver goes first, rolls or stops, but did not when recorded.

A decision belongs to a conflict at which j yields to i. The *offered lag* x is the time by which
i would enter the conflict area later than j, if both drove on freely from one instant: the first
one at which either is 4 s of free driving before the area. Nobody has decided anything by then.
Lags are drawn first, x ~ N(0, σ²), then who goes first:

    P(j goes first | x) = 1 / (1 + exp(-β x)).

`sampling.offered_lag_sigma` and `sampling.decision_rate` are σ and β. Each outcome that differs
from the recorded one is a new encounter of the two vehicles on their recorded paths:

- *Goes first*: both approach without their brakes and stands, at the lag. i slows down comfortably
  if it would come too close.
- *Rolls* or *stops*: i drives as recorded, and j approaches freely until it has to slow down for
  i. It rolls if a least speed suffices, else it stops before the area and departs when i has left.

The result must be as human as the recording (`DecisionMargins`), and carries its reaction.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import special

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.approaches import (
    approaches,
    InteractingPair,
    MARGINS,
    offered_lag_of,
    pair_of,
    two_drives,
)
from scenario_gen.method.drives import (
    delayed_drive,
    Drive,
    DRIVING,
    Stop,
)
from scenario_gen.method.evaluation.law import DISTANCE
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.situation import conflict_of, passing, Situation, Track
from scenario_gen.situation.yielding import heading_difference, LIMITS
from scenario_gen.types import (
    Decided,
    Decision,
    Encounter,
    FOLLOW,
    Outcome,
    token,
    YIELD,
)

LAG_COUNT = 9  # offered lags, each the median of an equally likely part of their law


@dataclass(frozen=True)
class Decisions:
    """The decisions of an encounter.

    Attributes:
        possible: the recorded outcome first. Empty without a decision.
        refused: outcomes with the reason why no driver would have done that; the probabilities of
            all outcomes add up to 1.
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
        ['rolls', 'goes first', 'goes second', 'stops']
    """
    try:
        conflict = DecidedConflict.of(encounter)
    except RefusedError as error:
        return Decisions(why=str(error))
    by_outcome: dict[Outcome, list[Decision]] = {conflict.recorded: []}
    refused = []
    recorded_lag = min(
        offered_lags(sampling.offered_lag_sigma), key=lambda lag: abs(lag - conflict.lag)
    )
    for offered in _offered(conflict, sampling):
        try:
            if (offered.outcome, offered.lag) == (Outcome.GOES_SECOND, recorded_lag):
                outcome = conflict.recorded
            else:
                outcome = conflict.meeting(offered).outcome
        except RefusedError as error:
            refused.append((offered, str(error)))
            continue
        by_outcome.setdefault(outcome, []).append(replace(offered, outcome=outcome))
    recorded, *others = (_at_median_lag(decisions) for decisions in by_outcome.values())
    recorded = replace(recorded, lag=round(conflict.lag, 2))
    return Decisions((recorded, *others), tuple(refused))


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
        >>> decided(encounter, decisions_of(encounter).possible[1]).decision.outcome
        <Outcome.GOES_FIRST: 'goes first'>
    """
    conflict = DecidedConflict.of(encounter)
    source = Decided(encounter.name, decision, encounter)
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
        recorded_first: the first vehicle, as recorded.
        free: the first and the second vehicle, each as if it were alone.
        stops: where they stop before the area.
        lag: the recorded offered lag [s].
    """

    pair: InteractingPair
    recorded_first: Drive
    free: tuple[Drive, Drive]
    stops: tuple[Stop, Stop]
    lag: float

    @classmethod
    def of(cls, encounter: Encounter) -> "DecidedConflict":
        """Return the conflict at which one vehicle yields to another one.

        Raises:
            RefusedError: there is nothing to decide; the message says why.
        """
        pair = _yielding_pair(encounter)
        refuse_undecided(pair)
        first, second = approaches(pair)
        lag = offered_lag_of(first, second)
        if _merges_from_beside(pair) and abs(lag) > MARGINS.max_merge_lag_s:
            raise RefusedError("the vehicle ahead decides this merge")
        return cls(pair, first.recorded, (first.free, second.free), (first.stop, second.stop), lag)

    @property
    def names(self) -> tuple[str, str]:
        """ROS names of the second and of the first vehicle."""
        first, second = self.pair.tracks
        return token(second.vehicle.id), token(first.vehicle.id)

    @property
    def recorded(self) -> Outcome:
        """The recorded outcome."""
        second = self.pair.tracks[1]
        if second.speed[second.present[0]] < second.vehicle.kind.waits_below:
            return Outcome.STOPS
        for edge in self.pair.reactions:
            if edge.kind == YIELD and edge.who == self.pair.conflict.second:
                if edge.stands:
                    return Outcome.STOPS
                return Outcome.ROLLS if edge.since < edge.until else Outcome.GOES_SECOND
        return Outcome.GOES_SECOND

    def meeting(self, decision: Decision) -> Meeting:
        """Return the two vehicles with a decision at its lag, and the outcome.

        Whether a vehicle that goes second rolls or stops follows from the lag.

        Raises:
            RefusedError: no driver would do that; the message says why.
        """
        least = MARGINS.min_courtesy_ratio if _merges_from_beside(self.pair) else 0.0
        free_first, free_second = self.free
        stop_first, stop_second = self.stops
        if decision.outcome is Outcome.GOES_FIRST:
            meeting = _meeting(free_second, free_first, stop_first, decision.lag, least)
            meeting = meeting._replace(outcome=Outcome.GOES_FIRST)
        else:
            meeting = _meeting(self.recorded_first, free_second, stop_second, -decision.lag, least)
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
        if pair is None or pair.conflict.first != 0:
            raise RefusedError("together they would do something else")
        clears, enters = passing(encounter, pair.conflict, merges=pair.conflict.following)
        if pair.features[DISTANCE] <= 0.0 or enters - clears < DRIVING.min_gap_s:
            raise RefusedError("they would come too close")
        allowed = max(MARGINS.max_braking_mps2, _hardest_braking(self.pair.encounter))
        if _hardest_braking(encounter) > allowed:
            raise RefusedError("a driver would brake too hard")


def _yielding_pair(encounter: Encounter) -> InteractingPair:
    """Return the pair of which one vehicle yields: the closest one, or that with most confidence.

    Raises:
        RefusedError: no vehicle yields and passes behind the other one.
    """
    situation = Situation.of(encounter)
    pair = pair_of(encounter)
    yields = sorted(
        (edge for edge in situation.reactions.edges if edge.kind == YIELD),
        key=lambda edge: edge.confidence,
        reverse=True,
    )
    if not yields:
        raise RefusedError("no vehicle yields to another one")
    closest = pair.conflict.pair if pair else ()
    yields.sort(key=lambda edge: {edge.who, edge.whom} != set(closest))
    for edge in yields:
        conflict = situation.conflict(edge.who, edge.whom)
        if conflict is not None and conflict.second == edge.who:
            chosen = pair_of(encounter, conflict.pair)
            if chosen is not None:
                return chosen
    who = encounter.vehicles[yields[0].who].id
    raise RefusedError(f"vehicle {who} has not yet passed when its recording ends")


def refuse_undecided(pair: InteractingPair) -> None:
    """Refuse a pair without a decision about who goes first.

    Raises:
        RefusedError: the message says why.
    """
    conflict = pair.conflict
    if _follows_before(pair):
        raise RefusedError("the second vehicle follows the first one to the conflict area")
    first, second = pair.tracks
    if conflict.entry_second <= pair.presence(conflict.second)[0]:
        raise RefusedError(
            f"vehicle {second.vehicle.id} is inside the conflict area when its recording begins"
        )
    if conflict.entry_first <= pair.presence(conflict.first)[0] and _turns_at_first(first):
        raise RefusedError(
            f"vehicle {first.vehicle.id} turns in the conflict area when its recording begins"
        )


def _turns_at_first(track: Track) -> bool:
    """Whether a path turns where its record begins."""
    begin = float(track.progress[0])
    yaw = track.curve.at(np.array([begin, begin + DRIVING.turning_m]))[:, 2]
    return bool(abs(yaw[1] - yaw[0]) > DRIVING.turning_rad)


def _merges_from_beside(pair: InteractingPair) -> bool:
    """Whether the second vehicle changes lanes: nobody stops for this in moving traffic."""
    conflict = pair.conflict
    entries = (conflict.first, conflict.entry_first), (conflict.second, conflict.entry_second)
    turned = heading_difference(pair.encounter, *entries)
    return conflict.following and turned < LIMITS.side_by_side_rad


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


def _meeting(first: Drive, second: Drive, stop: Stop, later: float, least: float = 0.0) -> Meeting:
    """Return the motion of two drives; the second one slows down if it is too early.

    Args:
        first: the drive that goes first.
        second: the other one.
        stop: where the second one stops.
        later: seconds from the first one's entry to the second one's, if it did not slow down.
        least: share of its speed that the second one keeps.

    Raises:
        RefusedError: they would not share an area, or the second one would brake too hard.
    """
    dt = first.track.dt
    after = int(first.time[-1] / dt) + 1
    consecutive = two_drives(first, second, after)
    conflict = conflict_of(consecutive, 0, 1)
    if conflict is None or conflict.first != 0:
        raise RefusedError("they would not meet")
    clears, enters = passing(consecutive, conflict, merges=conflict.following)
    enters -= after * dt
    if conflict.following:
        clears = max(clears, _way_is_free(first, second, enters))
    arrives = conflict.entry_first + later
    outcome = Outcome.GOES_SECOND
    entry = float(np.interp(enters, second.time, second.station))
    stands = np.flatnonzero((second.stand > 0.0) & (second.station < entry))
    if len(stands):  # since its recording began: it departs at the latest when the way is free
        way = enters - float(second.time[stands[-1]])
        arrives = min(arrives, clears + DRIVING.departure_lag_s + way)
        outcome = Outcome.STOPS
    if clears + MARGINS.free_gap_s > arrives:
        free = second
        second = delayed_drive(free, entry, enters + clears - arrives, stop)
        if (second.speed < least * free.speed).any():
            who = second.track.vehicle.id
            raise RefusedError(f"vehicle {who} would have to slow down too much")
        outcome = Outcome.STOPS if second.stand.any() else Outcome.ROLLS
    begin = round((arrives - enters) / dt)
    encounter = two_drives(first, second, begin)
    approach = round((conflict.entry_first - MARGINS.approach_s) / dt) + max(-begin, 0)
    start = max(int(encounter.present[:, 0].max()), approach)
    if (encounter.present[:, 1].min() - start) * dt < MARGINS.min_together_s:
        raise RefusedError("they would hardly be together")
    return Meeting(encounter.select((0, 1), start), outcome)


def _way_is_free(first: Drive, second: Drive, enters: float) -> float:
    """Return when [s] a vehicle may enter behind another one on a shared path.

    From then on it never reaches the other one, although it may be faster.

    Args:
        first: the drive ahead, which begins at 0 s.
        second: the drive behind.
        enters: when [s] the second one enters the shared path in its own drive.
    """
    after = second.time >= enters
    places, left = first.track.curve.project(second.track.curve.at(second.station[after])[:, :2])
    length = 0.5 * (first.track.vehicle.length + second.track.vehicle.length)
    shared = (np.abs(left) < MARGINS.shared_path_m) & (places + length < first.station[-1])
    leaves = np.interp(places + length, first.station, first.time)
    return float(np.max(leaves - second.time[after] + enters, where=shared, initial=-np.inf))

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""New encounters out of recorded ones: how one drove, met by how somebody else drove elsewhere.

In two encounters of one kind somebody goes first and somebody second. A new encounter has the first of the one and the second of
the other:

- One that crosses, turns or merges keeps its way and its speeds, and is moved: in space such that both firsts take the same pose
  where the paths meet, in time such that they clear it at the same instant, which is what the second waits for.
- One that follows keeps how it follows (Newell 2002): it is where its leader was a time gap τ before, less a distance,
  s(t) = s_leader(t − τ) − δ(t), with τ and δ as behind its own leader. In time it is moved to where the leaders' speeds are most
  alike.

Nothing is made up in between, so joints are as smooth as the recordings. What comes out must be of the same kind, each driver
reacting as in its own recording, without an overlap, within the limits of its type, and hardly more unusual (`evaluation.law`)
than the recorded ones. It is a template like any other: what is generated from it is checked as always.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
import math

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.evaluation.law import Law
from scenario_gen.method.evaluation.population import DISTANCE, member_of
from scenario_gen.numerics import Floats
from scenario_gen.numerics.plane import ahead_and_left, place
from scenario_gen.situation import Conflict, EncounterKind, Situation, time_gaps
from scenario_gen.types import Encounter, FOLLOW, Reaction, Recombined, YIELD

LEAST_S = 5.0  # that a new encounter lasts
TRIES = 40  # pairs that are looked at for each encounter wanted
RARER = 1.2  # times as far from the middle of the law of the kind as the rarer of the two, at most
_GAPS_S = (
    0.5,
    1.2,
    2.5,
)  # least time gap τ, that of who never drives in the leader's lane, and greatest
_OVERLAP_S, _OVERLAP_COST = (
    8.0,
    1.5,
)  # that recordings of leaders overlap, if they are so long; m/s that none of it is worth
_STEP = 2  # samples by which one is moved against the other
_ASIDE_M = 2.2  # of the follower's path, within which the leader is on it
_BACKWARDS = -0.5  # m/s: who would drive backwards faster than this does not follow


@dataclass(frozen=True, eq=False)
class Pair:
    """The two of an encounter that have most to do with each other.

    Attributes:
        situation: of the encounter, with all its vehicles.
        kind: of `scenario_gen.method.evaluation.population`; `features` (F,), too.
        conflict: of the two.
        reactions: of one of them to the other.
    """

    situation: Situation
    kind: EncounterKind
    features: Floats
    conflict: Conflict
    reactions: tuple[Reaction, ...]

    @property
    def encounter(self) -> Encounter:
        """The encounter, with all its vehicles."""
        return self.situation.encounter

    @property
    def graph(self) -> frozenset[tuple[bool, str]]:
        """Who reacts, the second one or not, and how."""
        return frozenset((edge.who == self.conflict.second, edge.kind) for edge in self.reactions)

    @property
    def follows(self) -> bool:
        """Whether the second drives behind the first, and reacts to that or to nothing."""
        return self.conflict.following and (not self.reactions or (True, FOLLOW) in self.graph)

    @property
    def clears(self) -> float:
        """When [s] the first one has cleared what the second one waits for; of a follower when the first one comes there."""
        given = [
            edge.clears
            for edge in self.reactions
            if edge.kind == YIELD and math.isfinite(edge.gap)
        ]
        return (
            given[0]
            if given
            else self.conflict.entry_first
            if self.conflict.following
            else self.conflict.exit_first
        )

    @property
    def meeting(self) -> Floats:
        """(3,) the first one's pose where the paths meet."""
        own, end = self.conflict, self.encounter.duration
        at = (
            own.entry_first
            if own.following
            else (own.entry_first + min(own.exit_first, end)) / 2.0
        )
        return self.motion(own.first, np.array([at]))[0, :3]

    def motion(self, n: int, at: Floats) -> Floats:
        """(T, 4) pose and speed of a vehicle at times (T,) [s]."""
        own = self.encounter
        columns = (*own.position[n].T, own.heading[n], own.speed[n])
        return np.column_stack([np.interp(at, own.time, column) for column in columns])

    def there(self, n: int) -> Floats:
        """(2,) when [s] a vehicle comes and goes."""
        return np.asarray(self.encounter.present[n] * self.encounter.dt)


def pair_of(encounter: Encounter) -> Pair | None:
    """Return the pair of an encounter; None if no two of it share an area."""
    situation = Situation.of(encounter)
    member = member_of(encounter, "", 0)
    if (
        member.kind is None
        or member.pair is None
        or (conflict := situation.conflict(*member.pair)) is None
    ):
        return None
    edges = tuple(
        edge for edge in situation.reactions.edges if {edge.who, edge.whom} == set(member.pair)
    )
    return Pair(situation, member.kind, member.features, conflict, edges)


def recombined(one: Encounter, other: Encounter) -> Encounter:
    """Return the first vehicle of one encounter with the second vehicle of another, on the clock and in the frame of `one`.

    Of more than two vehicles the two that have most to do with each other count.

    Raises:
        RefusedError: they are not of one kind, or what comes out is not, or reacts differently; the message says why.
    """
    a, b = pair_of(one), pair_of(other)
    if a is None or b is None or a.kind != b.kind:
        raise RefusedError("they are of different kinds")
    return _combined(a, b)


def _combined(a: Pair, b: Pair) -> Encounter:
    """Return the first vehicle of one pair with the second vehicle of another of its kind."""
    one, other = a.encounter, b.encounter
    begin, motion = _following(a, b) if b.follows else _meeting(a, b)
    first, second = one.vehicles[a.conflict.first], other.vehicles[b.conflict.second]
    second = replace(second, id=f"{second.id}_2") if second.id == first.id else second
    rows = np.stack([a.motion(a.conflict.first, begin + one.time[: len(motion)]), motion])
    start = one.start_ns + round(begin / one.dt) * one.dt_ns
    source = Recombined(one.name, other.name)
    made = Encounter.sampled(
        (first, second),
        one.dt,
        rows[..., :2],
        rows[..., 2],
        rows[..., 3],
        source.name,
        start,
        source=source,
    )
    found, change = pair_of(made), np.diff(made.speed[1]) / made.dt
    if found is None or found.kind != a.kind or found.conflict.second != 1:
        raise RefusedError("together they are of another kind")
    if found.graph != {own for own in a.graph if not own[0]} | {own for own in b.graph if own[0]}:
        raise RefusedError("together they react differently")
    if found.features[DISTANCE] <= 0.0:
        raise RefusedError("together they overlap")
    law = Law.of(a.kind, [a.features, b.features])
    if law.distance(found.features) > RARER * max(
        law.distance(a.features), law.distance(b.features)
    ):
        raise RefusedError("together they are more unusual than each of the recorded")
    if (
        change.max() > second.kind.dynamics.max_acceleration
        or -change.min() > second.kind.dynamics.max_deceleration
    ):
        raise RefusedError("the second one would brake or accelerate too hard")
    return made


def recombinations(
    encounters: Sequence[Encounter], most: int, seed: int = 0
) -> tuple[list[Encounter], Counter[str]]:
    """Return new encounters of pairs of recorded ones that are of one kind and not the same, and why pairs gave none.

    Pairs of all are tried in a random order, forty for each encounter wanted at most.

    Args:
        encounters: recorded ones.
        most: new ones wanted.
        seed: of the order.
    """
    count, made, refused = len(encounters), list[Encounter](), Counter[str]()
    pairs = [pair_of(encounter) for encounter in encounters]
    for number in (
        np.random.default_rng(seed)
        .choice(count**2, min(count**2, TRIES * most), replace=False)
        .tolist()
    ):
        a, b = (pairs[k] for k in divmod(number, count))
        if (
            not (a and b)
            or a.kind != b.kind
            or np.array_equal(a.features, b.features)
            or len(made) == most
        ):
            continue
        try:
            made.append(_combined(a, b))
        except RefusedError as error:
            refused[str(error)] += 1
    return made, refused


def _meeting(a: Pair, b: Pair) -> tuple[float, Floats]:
    """When the two begin [s], and the motion (T, 4) of the second of `b`, moved to the first of `a`."""
    second, later = b.conflict.second, a.clears - b.clears
    at = _common(a, a.there(a.conflict.first), b.there(second) + later)
    motion = b.motion(second, at - later)
    here, there = a.meeting, b.meeting
    ahead, left = ahead_and_left(motion[:, :2] - there[:2], there[2])
    motion[:, :2] = place(here[None], ahead, left)[:, :2]
    motion[:, 2] += here[2] - there[2]
    return float(at[0]), motion


def _following(a: Pair, b: Pair) -> tuple[float, Floats]:
    """When the two begin [s], and the motion (T, 4) of the second of `b` behind the first of `a`."""
    gaps = time_gaps(b.situation.lane_gaps, b.conflict.second, b.conflict.first)
    least, usual, most = _GAPS_S
    tau = min(max(float(np.median(gaps)) if len(gaps) else usual, least), most)
    later = _alike(a, b)
    own, led = b.there(b.conflict.second) + later, b.there(b.conflict.first) + later + tau
    span = np.array([max(own[0], led[0]), min(own[1], led[1])])
    at = _common(a, a.there(a.conflict.first) + np.array([tau, 0.0]), span)
    leader, follower = (
        b.situation.tracks[b.conflict.first],
        b.situation.tracks[b.conflict.second],
    )
    track = a.situation.tracks[a.conflict.first]
    theirs, ours = b.encounter.time, a.encounter.time
    speed = np.interp(at - tau, ours, track.speed) - np.interp(
        at - later - tau, theirs, leader.speed
    )
    speed += np.interp(at - later, theirs, follower.speed)
    if speed.min() < _BACKWARDS:
        raise RefusedError("the second one would drive backwards")
    behind = np.interp(at - later - tau, theirs, _on_path(b)) - np.interp(
        at - later, theirs, follower.progress
    )
    driven = np.maximum.accumulate(np.interp(at - tau, ours, _on_path(a)) - behind)
    return float(at[0]), np.column_stack([_way(a, driven), np.maximum(speed, 0.0)])


def _common(a: Pair, own: Floats, moved: Floats) -> Floats:
    """(T,) the instants of a's clock between the later begin and the earlier end of two spans (2,) [s]."""
    dt = a.encounter.dt
    first, last = (
        math.ceil(max(own[0], moved[0]) / dt - 1e-6),
        math.floor(min(own[1], moved[1]) / dt + 1e-6),
    )
    if (last - first) * dt < LEAST_S:
        raise RefusedError(f"together they last less than {LEAST_S:g} s")
    return np.arange(first, last + 1) * dt


def _alike(a: Pair, b: Pair) -> float:
    """By how much [s] b's clock is moved, such that the leaders' speeds are most alike for a long time."""
    dt = a.encounter.dt
    ours, theirs = (_led(pair, dt) for pair in (a, b))
    shorter = min(len(ours), len(theirs))
    least = min(round(_OVERLAP_S / dt), shorter)
    best = (math.inf, 0)
    for move in range(least - len(theirs), len(ours) - least + 1, _STEP):
        begin, end = max(0, move), min(len(ours), len(theirs) + move)
        off = float(np.sqrt(np.square(ours[begin:end] - theirs[begin - move : end - move]).mean()))
        best = min(
            best, (round(off + _OVERLAP_COST * (1.0 - (end - begin) / shorter), 6), move)
        )  # ties on any CPU
    return best[1] * dt + float(a.there(a.conflict.first)[0] - b.there(b.conflict.first)[0])


def _led(pair: Pair, dt: float) -> Floats:
    """(T,) the speeds [m/s] of the first one, every dt [s] from when it comes until it goes."""
    comes, goes = pair.there(pair.conflict.first).tolist()
    return pair.motion(
        pair.conflict.first, comes + dt * np.arange(int((goes - comes) / dt + 1e-6) + 1)
    )[:, 3]


def _way(pair: Pair, station: Floats) -> Floats:
    """(T, 3) the poses at distances (T,) on the path of the second one, beyond its end beside that of the first."""
    ahead, own = (
        pair.situation.tracks[n].curve for n in (pair.conflict.first, pair.conflict.second)
    )
    poses, over = own.at(station), station - own.length
    join, aside = (float(value[0]) for value in ahead.project(own.points[-1:, :2]))
    beyond = (over > 0.0) & (abs(aside) < _ASIDE_M)
    poses[beyond] = ahead.beside(join + over[beyond], aside)
    return poses


def _on_path(pair: Pair) -> Floats:
    """(T,) how far [m] the first one is on the path of the second, at the samples of their encounter."""
    curve, track = (
        pair.situation.tracks[pair.conflict.second].curve,
        pair.situation.tracks[pair.conflict.first],
    )
    station, aside = curve.project(pair.encounter.position[pair.conflict.first])
    on = track.is_present & (station > 0.0) & (station < curve.length) & (np.abs(aside) < _ASIDE_M)
    if not on.any():
        raise RefusedError("the first one is never on the second one's path")
    return np.asarray(track.progress + np.median((station - track.progress)[on]))

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""New encounters from recorded ones: one driver meets another driver, who was recorded elsewhere.

A new encounter has the first vehicle of one encounter and the second vehicle of another encounter
of the same kind:

- A vehicle that crosses, turns or merges keeps its path and its speeds, and is moved: in space so
  that both first vehicles have the same pose where the paths meet, in time so that they clear this
  place at the same instant.
- A follower keeps its way of following (Newell 2002): s(t) = s_leader(t - τ) - δ(t), with τ and δ
  as behind its own leader. In time it is moved to where the speeds of the leaders are most alike.

Nothing is invented in between, so the motions are as smooth as the recordings. The result must be
of the same kind, each driver must react as in its own recording, without overlap and within the
limits of its type, and it must not be much more unusual (`evaluation.law`) than the recordings.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
import math

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.evaluation.encounter_features import DISTANCE, features_of
from scenario_gen.method.evaluation.law import Law
from scenario_gen.numerics import Floats
from scenario_gen.numerics.plane import ahead_and_left, place
from scenario_gen.situation import Conflict, EncounterKind, Situation, time_gaps, Track
from scenario_gen.types import Encounter, FOLLOW, Reaction, Recombined, YIELD

MIN_DURATION_S = 5.0
ATTEMPTS_PER_ENCOUNTER_COUNT = 40
MAX_RARITY_RATIO = 1.2  # of the distance from the mean, to that of the rarer recording
MIN_TIME_GAP_S = 0.5
USUAL_TIME_GAP_S = 1.2  # of a follower that was never recorded in its leader's lane
MAX_TIME_GAP_S = 2.5
MIN_OVERLAP_S = 8.0  # of the recordings of two leaders, unless one is shorter
NO_OVERLAP_COST = 1.5  # in m/s, for recordings that do not overlap
ON_PATH_M = 2.2  # from the follower's path, within which its leader is on it
MAX_REVERSE_MPS = 0.5  # a follower that drives backwards faster is refused


@dataclass(frozen=True, eq=False)
class InteractingPair:
    """The two vehicles of an encounter that interact most.

    Attributes:
        situation: of the encounter, with all its vehicles.
        kind: what they do.
        features: (F + J,) as in `EncounterFeatures.every`.
        conflict: between the two.
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
        """The reactions: whether the second vehicle reacts, and how."""
        return frozenset((edge.who == self.conflict.second, edge.kind) for edge in self.reactions)

    @property
    def follows(self) -> bool:
        """Whether the second vehicle drives behind the first, and has no other reaction."""
        return self.conflict.following and (not self.reactions or (True, FOLLOW) in self.graph)

    @property
    def clears(self) -> float:
        """When [s] the first vehicle has cleared the place that the second one waits for.

        If the second one follows, when the first one arrives there.
        """
        for edge in self.reactions:
            if edge.kind == YIELD and math.isfinite(edge.gap):
                return edge.clears
        conflict = self.conflict
        return conflict.entry_first if conflict.following else conflict.exit_first

    @property
    def meeting_pose(self) -> Floats:
        """(3,) the pose of the first vehicle where the paths meet."""
        conflict = self.conflict
        time = conflict.entry_first
        if not conflict.following:
            time = (time + min(conflict.exit_first, self.encounter.duration)) / 2.0
        return self.states(conflict.first, np.array([time]))[0, :3]

    @property
    def tracks(self) -> tuple[Track, Track]:
        """The tracks of the first and of the second vehicle."""
        tracks = self.situation.tracks
        return tracks[self.conflict.first], tracks[self.conflict.second]

    def states(self, n: int, time: Floats) -> Floats:
        """Return pose and speed (T, 4) of a vehicle at times (T,) [s]."""
        states = self.encounter.at(time)
        return np.column_stack([states.position[n], states.heading[n], states.speed[n]])

    def presence(self, n: int) -> Floats:
        """Return when [s] a vehicle appears and disappears, (2,)."""
        return np.asarray(self.encounter.time[self.encounter.present[n]])


def pair_of(encounter: Encounter) -> InteractingPair | None:
    """Return the pair of an encounter; None if no two vehicles share an area."""
    situation = Situation.of(encounter)
    member = features_of(encounter, "", 0)
    conflict = None if member.pair is None else situation.conflict(*member.pair)
    if member.kind is None or conflict is None:
        return None
    edges = situation.reactions.edges
    reactions = tuple(edge for edge in edges if {edge.who, edge.whom} == set(conflict.pair))
    return InteractingPair(situation, member.kind, member.every, conflict, reactions)


def recombined(first: Encounter, second: Encounter) -> Encounter:
    """Return the first vehicle of one encounter with the second vehicle of another.

    The clock and the frame are those of `first`. Of more than two vehicles, those that interact
    most are used.

    Raises:
        RefusedError: they are of different kinds, or the result is of another kind, overlaps,
            reacts differently or is too unusual; the message says which.

    Example:
        >>> from scenario_gen import read_log, recombined
        >>> first, second = read_log("crossings.csv").encounters
        >>> recombined(first, second).source.name
        'crossings-1 + crossings-2'
    """
    leader, follower = pair_of(first), pair_of(second)
    if leader is None or follower is None or leader.kind != follower.kind:
        raise RefusedError("they are of different kinds")
    return _combined(leader, follower)


def recombinations(
    encounters: Sequence[Encounter], most: int, seed: int = 0
) -> tuple[list[Encounter], Counter[str]]:
    """Return new encounters from pairs of recorded ones, and the refused pairs by reason.

    Pairs of the same kind are tried in random order, up to forty for each requested encounter.

    Args:
        encounters: recorded encounters.
        most: largest number of new encounters.
        seed: of the order.
    """
    created: list[Encounter] = []
    refused: Counter[str] = Counter()
    pairs = [pair_of(encounter) for encounter in encounters]
    count = len(pairs) ** 2
    attempts = min(count, ATTEMPTS_PER_ENCOUNTER_COUNT * most)
    rng = np.random.default_rng(seed)
    for number in rng.choice(count, attempts, replace=False).tolist():
        a, b = (pairs[k] for k in divmod(number, len(pairs)))
        if len(created) == most:
            break
        if a is None or b is None or a.kind != b.kind or np.array_equal(a.features, b.features):
            continue
        try:
            created.append(_combined(a, b))
        except RefusedError as error:
            refused[str(error)] += 1
    return created, refused


def _combined(a: InteractingPair, b: InteractingPair) -> Encounter:
    """Return the first vehicle of one pair with the second vehicle of another of its kind."""
    recording = a.encounter
    begin, second_states = _following(a, b) if b.follows else _meeting(a, b)
    first = recording.vehicles[a.conflict.first]
    second = b.encounter.vehicles[b.conflict.second]
    if second.id == first.id:
        second = replace(second, id=f"{second.id}_2")
    first_states = a.states(a.conflict.first, begin + recording.time[: len(second_states)])
    states = np.stack([first_states, second_states])
    source = Recombined(recording.name, b.encounter.name)
    created = Encounter.sampled(
        (first, second),
        recording.dt,
        states[..., :2],
        states[..., 2],
        states[..., 3],
        source.name,
        recording.start_ns + round(begin / recording.dt) * recording.dt_ns,
        source=source,
    )
    _refuse_unlike(created, a, b)
    return created


def _refuse_unlike(created: Encounter, a: InteractingPair, b: InteractingPair) -> None:
    """Refuse a new encounter that differs too much from its recordings.

    Raises:
        RefusedError: it does; the message says how.
    """
    pair = pair_of(created)
    if pair is None or pair.kind != a.kind or pair.conflict.second != 1:
        raise RefusedError("together they are of another kind")
    reactions = {edge for edge in a.graph if not edge[0]} | {edge for edge in b.graph if edge[0]}
    if pair.graph != reactions:
        raise RefusedError("together they react differently")
    if pair.features[DISTANCE] <= 0.0:
        raise RefusedError("together they overlap")
    law = Law.of(a.kind, [a.features, b.features])
    rarer = max(law.distance(a.features), law.distance(b.features))
    if law.distance(pair.features) > MAX_RARITY_RATIO * rarer:
        raise RefusedError("together they are more unusual than each of the recorded")
    acceleration = np.diff(created.speed[1]) / created.dt
    dynamics = created.vehicles[1].kind.dynamics
    too_strong = acceleration.max() > dynamics.max_acceleration
    if too_strong or -acceleration.min() > dynamics.max_deceleration:
        raise RefusedError("the second one would brake or accelerate too hard")


def _meeting(a: InteractingPair, b: InteractingPair) -> tuple[float, Floats]:
    """Return the begin [s] and the states (T, 4) of b's second vehicle, moved to a's first."""
    second, delay = b.conflict.second, a.clears - b.clears
    time = _common_times(a, a.presence(a.conflict.first), b.presence(second) + delay)
    states = b.states(second, time - delay)
    target, source = a.meeting_pose, b.meeting_pose
    ahead, left = ahead_and_left(states[:, :2] - source[:2], source[2])
    states[:, :2] = place(target[None], ahead, left)[:, :2]
    states[:, 2] += target[2] - source[2]
    return float(time[0]), states


def _following(a: InteractingPair, b: InteractingPair) -> tuple[float, Floats]:
    """Return the begin [s], and the states (T, 4) of b's second vehicle behind a's first one."""
    gaps = time_gaps(b.situation.lane_gaps, b.conflict.second, b.conflict.first)
    usual = float(np.median(gaps)) if len(gaps) else USUAL_TIME_GAP_S
    tau = min(max(usual, MIN_TIME_GAP_S), MAX_TIME_GAP_S)
    delay = _alignment(a, b)
    follower_span = b.presence(b.conflict.second) + delay
    leader_span = b.presence(b.conflict.first) + delay + tau
    begin, end = max(follower_span[0], leader_span[0]), min(follower_span[1], leader_span[1])
    presence = a.presence(a.conflict.first) + np.array([tau, 0.0])
    time = _common_times(a, presence, np.array([begin, end]))

    (new_leader, _), (leader, follower) = a.tracks, b.tracks
    recorded, new = b.encounter.time, a.encounter.time
    led = time - delay - tau  # on the clock of b, when the leader's motion counts
    speed = np.interp(time - tau, new, new_leader.speed) - np.interp(led, recorded, leader.speed)
    speed += np.interp(time - delay, recorded, follower.speed)
    if speed.min() < -MAX_REVERSE_MPS:
        raise RefusedError("the second one would drive backwards")
    distance = np.interp(led, recorded, _leader_stations(b))
    distance -= np.interp(time - delay, recorded, follower.progress)
    station = np.interp(time - tau, new, _leader_stations(a)) - distance
    poses = _poses_behind(a, np.maximum.accumulate(station))
    return float(time[0]), np.column_stack([poses, np.maximum(speed, 0.0)])


def _common_times(a: InteractingPair, span: Floats, other: Floats) -> Floats:
    """(T,) the samples of a's clock within two spans (2,) [s].

    Raises:
        RefusedError: they are too few.
    """
    dt = a.encounter.dt
    first = math.ceil(max(span[0], other[0]) / dt - 1e-6)
    last = math.floor(min(span[1], other[1]) / dt + 1e-6)
    if (last - first) * dt < MIN_DURATION_S:
        raise RefusedError(f"together they last less than {MIN_DURATION_S:g} s")
    return np.arange(first, last + 1) * dt


def _alignment(a: InteractingPair, b: InteractingPair) -> float:
    """The shift [s] of b's clock for which the speeds of the leaders are most alike."""
    dt = a.encounter.dt
    speed, other = _leader_speed(a, dt), _leader_speed(b, dt)
    shorter = min(len(speed), len(other))
    least = min(round(MIN_OVERLAP_S / dt), shorter)
    smallest, best = math.inf, 0
    for shift in range(least - len(other), len(speed) - least + 1, 2):
        begin, end = max(0, shift), min(len(speed), len(other) + shift)
        difference = speed[begin:end] - other[begin - shift : end - shift]
        missing = 1.0 - (end - begin) / shorter
        cost = float(np.sqrt(np.square(difference).mean())) + NO_OVERLAP_COST * missing
        cost = round(cost, 6)  # ties are the same on any processor
        if cost < smallest:
            smallest, best = cost, shift
    start, other_start = (pair.presence(pair.conflict.first)[0] for pair in (a, b))
    return best * dt + float(start - other_start)


def _leader_speed(pair: InteractingPair, dt: float) -> Floats:
    """(T,) the speeds [m/s] of the first vehicle, every dt [s] while it is present."""
    first, last = pair.presence(pair.conflict.first).tolist()
    time = first + dt * np.arange(int((last - first) / dt + 1e-6) + 1)
    return pair.states(pair.conflict.first, time)[:, 3]


def _poses_behind(pair: InteractingPair, station: Floats) -> Floats:
    """(T, 3) poses at stations (T,) of the second path, which the first path continues."""
    leader, follower = (track.curve for track in pair.tracks)
    poses, beyond = follower.at(station), station - follower.length
    join, left = (float(value[0]) for value in leader.project(follower.points[-1:, :2]))
    if abs(left) < ON_PATH_M:
        rows = beyond > 0.0
        poses[rows] = leader.at_offset(join + beyond[rows], left)
    return poses


def _leader_stations(pair: InteractingPair) -> Floats:
    """(T,) stations [m] of the first vehicle on the path of the second one.

    Raises:
        RefusedError: it is never on that path.
    """
    leader, follower = pair.tracks
    curve = follower.curve
    station, left = curve.project(pair.encounter.position[pair.conflict.first])
    inside = (station > 0.0) & (station < curve.length) & (np.abs(left) < ON_PATH_M)
    rows = leader.is_present & inside
    if not rows.any():
        raise RefusedError("the first one is never on the second one's path")
    return np.asarray(leader.progress + np.median((station - leader.progress)[rows]))

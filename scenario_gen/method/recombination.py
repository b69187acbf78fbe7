# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""New encounters from recorded ones: one driver meets another driver, who was recorded elsewhere.

A new encounter has the first vehicle of one encounter and the second vehicle of another encounter
of the same kind (`scenario_gen.situation.kind`):

- A vehicle that crosses, turns or merges keeps its path and its speeds, and is moved: in space so
  that the shared areas lie on each other, along the paths of the first vehicles, in time so that
  both first vehicles clear this place at the same instant.
- A follower keeps its way of following (Newell 2002): s(t) = s_leader(t - τ) - δ(t), with τ and δ
  as behind its own leader. In time it is moved to where the speeds of the leaders are most alike.
  Before its recording a leader drives at its first speed.

Each vehicle is present as long as its recording lasts. Nothing is invented in between, so the
motions are as smooth as the recordings. The result must be of the same kind, who yields must do so
in its own recording, too, and it must not come closer, brake harder or be much more unusual
(`evaluation.law`) than the recordings.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
import math

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.evaluation.encounter_features import FEATURES, features_of
from scenario_gen.method.evaluation.law import Law
from scenario_gen.numerics import Floats
from scenario_gen.numerics.plane import ahead_and_left, place
from scenario_gen.situation import (
    Conflict,
    EncounterKind,
    passing,
    Situation,
    time_gaps,
    Track,
)
from scenario_gen.types import Encounter, Reaction, Recombined, YIELD

MIN_DURATION_S = 5.0
MIN_TOGETHER_S = 2.0  # in which both vehicles are present
ATTEMPTS_PER_ENCOUNTER_COUNT = 40
MAX_RARITY_RATIO = 1.2  # of a decided encounter: its distance from the mean, to the recording's
MAX_RECOMBINED_RARITY_RATIO = 2.0
"""Distance from the mean, to that of the rarer recording, in a law of these two. Of three recorded
encounters of a kind, the third is nearer in three cases of four."""
CRITICAL = [FEATURES.index("distance"), FEATURES.index("time to collision")]
USUAL_DISTANCE_M = 1.0  # nearer comes only who was recorded so
USUAL_COLLISION_TIME_S = 1.5
USUAL_STRONGEST_MPS2 = 3.0  # braking and acceleration of any driver
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
    def follows(self) -> bool:
        """Whether the second vehicle drives behind the first one from the beginning."""
        return self.kind is EncounterKind.FOLLOWING

    @property
    def graph(self) -> frozenset[tuple[bool, str]]:
        """The reactions of the kind: whether the second vehicle reacts, and how.

        Who crosses, turns or merges yields; whether it also follows depends on the recording's
        duration behind the shared area.
        """
        return frozenset(
            (edge.who == self.conflict.second, edge.kind)
            for edge in self.reactions
            if self.follows or edge.kind == YIELD
        )

    @property
    def clears(self) -> float:
        """When [s] the first vehicle has cleared the place that the second one waits for."""
        conflict = self.conflict
        return passing(self.encounter, conflict, merges=conflict.following)[0]

    @property
    def meeting_pose(self) -> Floats:
        """(3,) the pose of the first vehicle's path in the middle of the shared area."""
        conflict, track = self.conflict, self.tracks[0]
        leaves = conflict.entry_first if conflict.following else conflict.exit_first
        stations = np.interp([conflict.entry_first, leaves], self.encounter.time, track.progress)
        return track.curve.at(stations.mean())

    @property
    def tracks(self) -> tuple[Track, Track]:
        """The tracks of the first and of the second vehicle."""
        tracks = self.situation.tracks
        return tracks[self.conflict.first], tracks[self.conflict.second]

    @property
    def join(self) -> tuple[float, float]:
        """Station and offset [m] of the end of the second path on the first path."""
        leader, follower = (track.curve for track in self.tracks)
        station, left = leader.project(follower.points[-1:, :2])
        return float(station[0]), float(left[0])

    @property
    def common_presence(self) -> Floats:
        """When [s] both vehicles are present, (2,)."""
        spans = np.array([self.presence(n) for n in self.conflict.pair])
        return np.array([spans[:, 0].max(), spans[:, 1].min()])

    def first_speeds(self, span: Floats, dt: float) -> Floats:
        """(T,) the speeds [m/s] of the first vehicle, every dt [s] of a span (2,) [s]."""
        time = span[0] + dt * np.arange(int((span[1] - span[0]) / dt + 1e-6) + 1)
        return self.states(self.conflict.first, time)[:, 3]

    def drive(self, number: int, time: Floats) -> Floats:
        """(2, T) progress [m] and speed [m/s] of the first (0) or the second (1) vehicle.

        Before its recording it drives at its first speed, after it at its last one.
        """
        track, recorded = self.tracks[number], self.encounter.time
        inside = np.clip(time, *recorded[track.present])
        speed = np.interp(inside, recorded, track.speed)
        progress = np.interp(inside, recorded, track.progress)
        return np.stack([progress + speed * (time - inside), speed])

    def leader(self, time: Floats) -> Floats:
        """(2, T) stations [m] on the second path, and speeds [m/s], of the first vehicle.

        Raises:
            RefusedError: it does not drive on that path.
        """
        join, left = self.join
        if abs(left) > ON_PATH_M:
            raise RefusedError("the first one is never on the second one's path")
        progress, speed = self.drive(0, time)
        return np.stack([progress + self.tracks[1].curve.length - join, speed])

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
        RefusedError: they are of different kinds, or the result is of another kind,
            reacts differently, comes too close or is too unusual; the message says which.

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
    for a, b in _alike(encounters, ATTEMPTS_PER_ENCOUNTER_COUNT * most, seed):
        if len(created) == most:
            break
        try:
            created.append(_combined(a, b))
        except RefusedError as error:
            refused[str(error)] += 1
    return created, refused


def _alike(
    encounters: Sequence[Encounter], most: int, seed: int
) -> Iterator[tuple[InteractingPair, InteractingPair]]:
    """Yield two pairs of the same kind each, in random order; no pair with itself."""
    pairs = [pair for pair in map(pair_of, encounters) if pair is not None]
    groups = [[pair for pair in pairs if pair.kind is kind] for kind in EncounterKind]
    ends = np.cumsum([len(group) ** 2 for group in groups])
    count = int(ends[-1])
    rng = np.random.default_rng(seed)
    for number in rng.choice(max(count, 1), min(count, most), replace=False).tolist():
        group = groups[int(np.searchsorted(ends, number, side="right"))]
        a, b = (group[k % len(group)] for k in divmod(number, len(group)))
        if not np.array_equal(a.features, b.features):
            yield a, b


def _combined(a: InteractingPair, b: InteractingPair) -> Encounter:
    """Return the first vehicle of one pair with the second vehicle of another of its kind.

    It begins when both are present, and ends with the later one.
    """
    recording = a.encounter
    begin, states = (_behind if b.follows else _moved)(a, b)
    first = recording.vehicles[a.conflict.first]
    second = b.encounter.vehicles[b.conflict.second]
    if second.id == first.id:
        second = replace(second, id=f"{second.id}_2")

    last = begin + len(states) - 1
    presence = np.array([recording.present[a.conflict.first], (begin, last)])
    start, end = int(presence[:, 0].max()), int(presence[:, 1].max())
    if (end - start) * recording.dt < MIN_DURATION_S:
        raise RefusedError(f"together they last less than {MIN_DURATION_S:g} s")
    if (presence[:, 1].min() - start) * recording.dt < MIN_TOGETHER_S:
        raise RefusedError(f"they are together for less than {MIN_TOGETHER_S:g} s")

    rows = np.clip(np.arange(start, end + 1), presence[:, :1], presence[:, 1:])
    first_states = a.states(a.conflict.first, recording.time[rows[0]])
    both = np.stack([first_states, states[rows[1] - begin]])
    source = Recombined(recording.name, b.encounter.name)
    created = Encounter.sampled(
        (first, second),
        recording.dt,
        both[..., :2],
        both[..., 2],
        both[..., 3],
        source.name,
        recording.start_ns + start * recording.dt_ns,
        present=np.maximum(presence - start, 0),
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
    if pair is None:
        raise RefusedError("together they share no area")
    if pair.kind != a.kind or pair.conflict.second != 1:
        raise RefusedError("together they are of another kind")
    reactions = {edge for edge in a.graph if not edge[0]} | {edge for edge in b.graph if edge[0]}
    if pair.graph != reactions:
        raise RefusedError("together they react differently")
    recorded = np.minimum(a.features, b.features)[CRITICAL]
    usual = USUAL_DISTANCE_M, USUAL_COLLISION_TIME_S
    if (pair.features[CRITICAL] < np.minimum(recorded, usual)).any():
        raise RefusedError("together they come too close")
    law = Law.of(a.kind, [a.features, b.features])
    rarer = max(law.distance(a.features), law.distance(b.features))
    if law.distance(pair.features) > MAX_RECOMBINED_RARITY_RATIO * rarer:
        raise RefusedError("together they are more unusual than each of the recorded")
    strongest = max(_strongest(b.encounter, b.conflict.second), USUAL_STRONGEST_MPS2)
    if _strongest(created, 1) > strongest:
        raise RefusedError("the second one would brake or accelerate too hard")


def _strongest(encounter: Encounter, n: int) -> float:
    """Return the strongest braking or acceleration [m/s²] of a vehicle."""
    speed = encounter.speed[n, encounter.present_slice(n)]
    return float(np.abs(np.diff(speed)).max()) / encounter.dt


def _moved(a: InteractingPair, b: InteractingPair) -> tuple[int, Floats]:
    """Return the first sample on a's clock, and the states (T, 4) of b's second vehicle.

    The shared areas lie on each other, and are cleared at the same instant.
    """
    delay = a.clears - b.clears
    first, time = _samples(b.presence(b.conflict.second) + delay, a.encounter.dt)
    states = b.states(b.conflict.second, time - delay)
    target, source = a.meeting_pose, b.meeting_pose
    ahead, left = ahead_and_left(states[:, :2] - source[:2], source[2])
    states[:, :2] = place(target[None], ahead, left)[:, :2]
    states[:, 2] += target[2] - source[2]
    return first, states


def _behind(a: InteractingPair, b: InteractingPair) -> tuple[int, Floats]:
    """Return the first sample on a's clock, and the states (T, 4) of b's follower.

    Raises:
        RefusedError: a first one is not on the path of its second one, or the follower would
            drive backwards.
    """
    gaps = time_gaps(b.situation.lane_gaps, b.conflict.second, b.conflict.first)
    usual = float(np.median(gaps)) if len(gaps) else USUAL_TIME_GAP_S
    tau = min(max(usual, MIN_TIME_GAP_S), MAX_TIME_GAP_S)
    delay = _alignment(a, b)
    leader_span, other_span = a.presence(a.conflict.first), b.common_presence + delay
    span = np.maximum(leader_span[0], other_span[0]), np.minimum(leader_span[1], other_span[1])
    first, time = _samples(np.array(span), a.encounter.dt)
    station, speed = a.leader(time - tau)
    other_station, other_speed = b.leader(time - delay - tau)
    progress, own_speed = b.drive(1, time - delay)
    speed = speed - other_speed + own_speed
    if speed.min() < -MAX_REVERSE_MPS:
        raise RefusedError("the second one would drive backwards")
    poses = _poses_behind(a, np.maximum.accumulate(station - other_station + progress))
    return first, np.column_stack([poses, np.maximum(speed, 0.0)])


def _samples(span: Floats, dt: float) -> tuple[int, Floats]:
    """Return the first sample of a clock within a span (2,) [s], and all their times (T,) [s].

    Raises:
        RefusedError: it is too short.
    """
    first, last = math.ceil(span[0] / dt - 1e-6), math.floor(span[1] / dt + 1e-6)
    if (last - first) * dt < MIN_TOGETHER_S:
        raise RefusedError(f"they are together for less than {MIN_TOGETHER_S:g} s")
    return first, np.asarray(np.arange(first, last + 1) * dt, dtype=np.float64)


def _alignment(a: InteractingPair, b: InteractingPair) -> float:
    """The shift [s] of b's clock for which the speeds of the leaders are most alike."""
    dt = a.encounter.dt
    span, other_span = a.presence(a.conflict.first), b.common_presence
    speed, other = a.first_speeds(span, dt), b.first_speeds(other_span, dt)
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
    return best * dt + float(span[0] - other_span[0])


def _poses_behind(pair: InteractingPair, station: Floats) -> Floats:
    """(T, 3) poses at stations (T,) of the second path, which the first path continues."""
    leader, follower = (track.curve for track in pair.tracks)
    poses, beyond = follower.at(station), station - follower.length
    join, left = pair.join
    rows = beyond > 0.0
    poses[rows] = leader.at_offset(join + beyond[rows], left)
    return poses

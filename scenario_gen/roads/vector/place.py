# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""All ways of placing a recording on the lanes of a map, the best first."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations, islice
import math

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats, frozen
from scenario_gen.roads.vector.lane_graph import lane_graph, LaneGraph, LanePath
from scenario_gen.roads.vector.match import Match, match
from scenario_gen.roads.vector.rules import RuleCheck
from scenario_gen.roads.vector.search import (
    crossing_placements,
    placement_at,
    rigid_placements,
    RigidPlacement,
)
from scenario_gen.roads.vector.street import street_matches
from scenario_gen.situation import (
    Conflict,
    find_conflicts,
    PairConflicts,
    separate,
    Track,
    track_conflicts,
)
from scenario_gen.types import LaneNetwork, LEVEL_SPACING_M, Motion, Note, NoteKind

MATCHED_PLACEMENTS_COUNT = 15
"""Rigid placements that are matched with lanes at a time."""
_HOME_COST_M2 = 1.0  # of a rigid placement that is where the recording was made
_MAX_COST_M2 = 40.0  # of a match
_MAX_FORCED_LATERAL_MPS2 = (
    4.2  # a little less than scenarios may have; else other scales are tried
)
_BOX_MARGIN_M = 12.0  # around the driven paths
_BOX_LEAD_M = 20.0  # along the lanes before and after the driven paths
_OVERLAP_M = 5.0  # between two vehicles of which one may be above the other


class NoPlaceError(RefusedError):
    """A map has no place for a recording."""


def placements(
    graph: LaneGraph,
    tracks: tuple[Track, ...],
    lanes: Sequence[int] | None = None,
    scales: Sequence[float] = (1.0, 0.9, 1.1),
) -> Iterator[tuple[Match, float]]:
    """Yield the ways of placing a recording on lanes, with their scales.

    The place where it was recorded comes first, then those that resemble it most. Places come
    earlier where all vehicles whose paths cross or merge meet and, if the map has rights of way,
    where a vehicle that must give way does so. Places that break a rule are left out if the
    network's rules are kept. Last come the places with bends that cannot be driven at the first
    and last recorded speeds; at a smaller scale, the recording is slower, too.

    Args:
        graph: of a map or a part of it.
        tracks: of all recorded vehicles.
        lanes: a vehicle is put onto one of these; None: onto any lane.
        scales: s of eq 9; the first one with a place is used.

    Raises:
        NoPlaceError: there is none. The message has the reason where it was recorded, and the
            reason at the place that is nearest to being usable.
    """
    search = _Search(graph, tracks, scales)
    home = search.at_home() if lanes is None else None
    home_refusal = "" if home is None else home.refusal
    has_place = home is not None and not home_refusal
    if home is not None and has_place:
        yield home.match, 1.0

    streets = street_matches(graph, tracks, lanes)
    for candidates in search.batches(lanes):
        for placed in search.near(candidates, list(islice(streets, 8))):
            has_place = True
            yield placed
        if not has_place:
            raise NoPlaceError(_refusal(search, home_refusal))


def _refusal(search: "_Search", at_home: str) -> str:
    """Return the message for a recording without a place."""
    network = search.graph.network
    _, _, reason = min(search.failures, default=(True, 0.0, "no lanes have its directions"))
    reasons = [f"where it was recorded, {at_home}; elsewhere, {reason}" if at_home else reason]
    kind = "road" if network.drawn else "map"
    if network.drawn:
        reasons += map(str, network.notes)
    return f"the recording does not fit {kind} {network.name}: {'; '.join(reasons)}"


@dataclass(frozen=True, eq=False)
class _JudgedMatch:
    """A match with the motion that it gives, its conflicts and the rules that it breaks."""

    match: Match
    search: "_Search"

    @cached_property
    def motion(self) -> Motion:
        """The recorded motion on the lanes, unchecked."""
        placed = tracks_on(self.match, self.search.tracks)
        poses = np.stack([track.poses for track in placed])
        return Motion(
            vehicles=tuple(track.vehicle for track in placed),
            time=frozen(np.arange(poses.shape[1]) * placed[0].dt),
            position=poses[..., :2],
            heading=poses[..., 2],
            speed=np.stack([track.speed for track in placed]),
            present=np.stack([track.present for track in placed]),
        )

    @cached_property
    def conflicts(self) -> tuple[Conflict, ...]:
        """The conflicts in this motion."""
        return find_conflicts(self.motion)

    @cached_property
    def refusal(self) -> str:
        """Why it cannot be used; "" if it can."""
        if self.match.reason:
            return self.match.reason
        if self.search.graph.network.has_levels and (above := self._stacked_vehicles()):
            return above
        check = self.search.check
        if not check.rules:
            return ""
        breach = next(iter(check.breaches(self.motion, self.conflicts)), None)
        if breach is None:
            return ""
        vehicle = self.motion.vehicles[breach.vehicles[0]].id
        return f"vehicle {vehicle} {breach.message}; road.traffic_rules=ignored allows it"

    @cached_property
    def lost_meetings(self) -> int:
        """How many pairs meet in the recording, but not on the lanes."""
        if not self.search.crossing_pairs:
            return 0
        return len(self.search.crossing_pairs - {conflict.pair for conflict in self.conflicts})

    @cached_property
    def yields(self) -> bool:
        """Whether a vehicle gives way that has to by the rules."""
        check = self.search.check
        return bool(check.rules) and bool(check.kept_orders(self.motion, self.conflicts))

    @property
    def is_comfortable(self) -> bool:
        """Whether the bends can be driven at the first and last recorded speeds."""
        return self.match.forced_lateral <= _MAX_FORCED_LATERAL_MPS2

    @property
    def rank(self) -> tuple[float, ...]:
        """Order by lost meetings, reserved lanes on drawn roads, right of way, and cost."""
        off_reserved = self.search.graph.network.drawn and self.match.off_reserved_cost > 0.0
        cost = round(self.match.cost + self.match.off_reserved_cost, 3)
        return self.lost_meetings, off_reserved, not self.yields, cost

    def _stacked_vehicles(self) -> str:
        """Return which two vehicles would be above each other, as on a bridge; "" if none."""
        lanes = self.search.graph.network.lanes
        driven = []
        for path in self.match.paths:
            count = max(math.ceil((path.end - path.start) / 2.0), 1) + 1  # every two metres
            places = path.curve.at(np.linspace(path.start, path.end, count))[:, :2]
            centres = KDTree(np.concatenate([lanes[k].centre for k in path.lanes]))
            heights = np.concatenate([lanes[k].height for k in path.lanes])
            driven.append((places, heights[centres.query(places)[1]]))
        for i, j in combinations(range(len(driven)), 2):
            (places, height), (other_places, other_height) = driven[i], driven[j]
            on_two_levels = np.abs(height[:, None] - other_height) > LEVEL_SPACING_M
            if (on_two_levels & (cdist(places, other_places) < _OVERLAP_M)).any():
                first, second = (self.search.tracks[n].vehicle.id for n in (i, j))
                return (
                    f"vehicles {first} and {second} would be above each other, as on a bridge, "
                    "and not meet"
                )
        return ""


@dataclass(frozen=True, eq=False)
class _Search:
    """The search for places.

    Attributes:
        graph, tracks, scales: as in `placements`.
        failures: of each match that cannot be used: whether it is none, its cost, and the reason.
    """

    graph: LaneGraph
    tracks: tuple[Track, ...]
    scales: Sequence[float]
    failures: list[tuple[bool, float, str]] = field(default_factory=list)

    @cached_property
    def check(self) -> RuleCheck:
        """The traffic rules."""
        return RuleCheck(self.graph.network)

    @cached_property
    def met(self) -> PairConflicts:
        """The recorded conflicts."""
        return track_conflicts(self.tracks)

    @cached_property
    def crossing_pairs(self) -> set[tuple[int, int]]:
        """The pairs that cross or merge in the recording."""
        return {pair for pair, conflict in self.met.items() if not conflict.following}

    @cached_property
    def has_reserved(self) -> bool:
        """Whether a vehicle has lanes that are closed to cars."""
        return any(map(self.graph.reserved_for, self.tracks))

    @cached_property
    def drawn_place(self) -> RigidPlacement | None:
        """Where the road was drawn for the recording; None if it was not."""
        drawn_for = self.graph.network.drawn_for
        if drawn_for is None or len(drawn_for.lanes) != len(self.tracks):
            return None
        return placement_at(self.graph, self.tracks, drawn_for.frame)

    def at_home(self) -> _JudgedMatch | None:
        """Return the match where the recording was made, if lanes of its directions are there."""
        home = placement_at(self.graph, self.tracks, np.zeros(3))
        if home.cost > _HOME_COST_M2 or (self.graph.network.drawn and self.has_reserved):
            return None
        return _JudgedMatch(next(match(self.graph, self.tracks, self.met, home)), self)

    def batches(self, lanes: Sequence[int] | None) -> Iterator[list[RigidPlacement]]:
        """Yield the rigid placements to be matched, some at a time, the best first."""
        rigid = rigid_placements(self.graph, self.tracks, lanes)
        crossed = crossing_placements(self.graph, self.tracks) if lanes is None else []
        first = [] if self.drawn_place is None else [self.drawn_place]
        size = MATCHED_PLACEMENTS_COUNT
        for k in range(0, max(len(rigid), len(crossed), 1), size):
            yield [*first, *rigid[k : k + size], *crossed[k : k + size]]
            first = []

    def near(
        self, rigid: Sequence[RigidPlacement], streets: Sequence[Match]
    ) -> Iterator[tuple[Match, float]]:
        """Yield the usable matches near rigid placements and on streets, with their scales."""
        others: list[tuple[_JudgedMatch, float]] = []
        for scale in self.scales:
            matches = list(streets) if scale == 1.0 else []
            for placement in rigid:
                stop_if_cancelled()
                matches += self._matches_near(placement, scale)
            usable = sorted(self._usable(matches), key=lambda judged: judged.rank)
            good = [each for each in usable if each.is_comfortable and not each.lost_meetings]
            others += [(each, scale) for each in usable if each not in good]
            yield from ((each.match, scale) for each in good)
            if good:
                break
        others.sort(key=lambda other: (not other[0].is_comfortable, other[0].lost_meetings))
        yield from ((each.match, scale) for each, scale in others)

    def _matches_near(self, placement: RigidPlacement, scale: float) -> Iterator[Match]:
        """Yield the matches that resemble a rigid placement; the others become failures."""
        is_drawn_place = placement is self.drawn_place
        drawn_for = self.graph.network.drawn_for
        ends = drawn_for.lanes if is_drawn_place and drawn_for is not None else ()
        for prefer_reserved in (True, False) if self.has_reserved else (False,):
            for each in match(
                self.graph,
                self.tracks,
                self.met,
                placement,
                scale,
                ends,
                prefer_reserved=prefer_reserved,
            ):
                reason = each.reason
                if not reason and each.cost > _MAX_COST_M2 and not is_drawn_place:
                    reason = "the vehicles would be too far from their recorded positions"
                if reason:
                    self.failures.append((True, each.cost, reason))
                else:
                    yield each

    def _usable(self, matches: Sequence[Match]) -> Iterator[_JudgedMatch]:
        """Yield the matches that break no rule; the others become failures."""
        for each in matches:
            judged = _JudgedMatch(each, self)
            if judged.refusal:
                self.failures.append((False, each.cost, judged.refusal))
            else:
                yield judged


def tracks_on(match: Match, tracks: Sequence[Track]) -> tuple[Track, ...]:
    """Return the recorded tracks on their lane paths."""
    placed = []
    for path, track in zip(match.paths, tracks, strict=True):
        driven = float(path.progress[-1])
        curve = path.curve.cut(path.start, path.start + max(driven, 1.0), 0.25)
        progress = path.progress * (curve.length / driven if driven > 1.0 else 1.0)
        on_curve = frozen(np.minimum(progress, curve.length))
        placed.append(replace(track, curve=curve, progress=on_curve, lane=path.curve))
    return tuple(placed)


@dataclass(frozen=True, eq=False)
class Place:
    """A place for a recording on a map.

    Attributes:
        box: (2, 2) [m] lowest and highest x, y of the part of the map around it.
        where: the junctions or the lane there.
        cost: [m²] 0 where it was recorded, more where it resembles the recording less.
        paths: of each vehicle, (M, 2) [m] along the lanes.
    """

    box: Floats
    where: str
    cost: float
    paths: tuple[Floats, ...]

    @property
    def part(self) -> str:
        """The part of the map, to be appended to its name."""
        return f"#box={','.join(f'{value:g}' for value in self.box.ravel())}"


def places(
    network: LaneNetwork, tracks: tuple[Track, ...], lanes: Sequence[int] | None = None
) -> Iterator[Place]:
    """Yield the places for a recording on a map, the best first; see `placements`.

    Raises:
        NoPlaceError: there is none.
    """
    graph = lane_graph(network, users_of(tracks))
    reason, has_place = "", False
    for each, _ in placements(graph, tracks, lanes):
        try:
            separate(tracks_on(each, tracks), 0.0, 3.0, sideways=0.0)
        except RefusedError as error:
            reason = reason or f"{error}: more lanes side by side are needed"
            continue
        has_place = True
        yield _place_of(graph.network, each)
    if not has_place:
        raise NoPlaceError(f"the recording does not fit map {network.name}: {reason}")


def _place_of(network: LaneNetwork, match: Match) -> Place:
    paths = tuple(_with_lead(path) for path in match.paths)
    points = np.concatenate(paths)
    low, high = points.min(axis=0) - _BOX_MARGIN_M, points.max(axis=0) + _BOX_MARGIN_M
    lanes = [network.lanes[k] for path in match.paths for k in path.lanes]
    junctions = dict.fromkeys(lane.junction for lane in lanes if lane.junction)
    where = ", ".join(f"junction {name}" for name in junctions) or f"lane {lanes[0].id}"
    return Place(frozen(np.round(np.stack((low, high)))), where, match.cost, paths)


def _with_lead(path: LanePath) -> Floats:
    """Return points (200, 2) [m] along a lane path, from before its start to beyond its end."""
    stations = np.linspace(path.start - _BOX_LEAD_M, path.end + _BOX_LEAD_M, 200)
    return path.curve.at(stations)[:, :2]


def users_of(tracks: Sequence[Track]) -> frozenset[str]:
    """Return the kinds of lane users among the recorded vehicles."""
    return frozenset().union(*(track.vehicle.kind.lane_user for track in tracks))


def best_part(
    network: LaneNetwork, tracks: tuple[Track, ...], lanes: Sequence[int] | None = None
) -> tuple[Floats, Note]:
    """Return the box (2, 2) [m] around the best place for a recording, and a note on it.

    Raises:
        NoPlaceError: there is no place for it.
    """
    best = next(places(network, tracks, lanes))
    note = Note.of(NoteKind.BEST_PLACE, place=best.where, part=best.part, cost=best.cost)
    return best.box, note

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The places for a recording on the lanes of a map or of a drawn road, the best first.

A candidate is a lane path and a start on it for every vehicle, and a scale. The first ones lose
nothing of the encounter (`situation.find_losses`); of several, the one that resembles the
recording most is the first.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import chain, islice
import math

import numpy as np

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats, frozen
from scenario_gen.roads.room import max_repair
from scenario_gen.roads.vector.candidate import Candidate, PlaceLimits, PlacingTask
from scenario_gen.roads.vector.hypotheses import (
    crossing_hypotheses,
    Hypothesis,
    hypothesis_at,
    rigid_hypotheses,
    street_hypotheses,
)
from scenario_gen.roads.vector.lane_graph import lane_graph, LaneGraph, LanePath
from scenario_gen.roads.vector.match import Match, match
from scenario_gen.situation import (
    drivers_of,
    pair_crossings,
    to_frenet,
    Track,
)
from scenario_gen.types import LaneNetwork, Note, NoteKind, Road

MATCHED_COUNT = 15
"""Rigid hypotheses that are matched with lanes at a time."""
_MATCHED_STREETS_COUNT = 8
_JUDGED_COUNT = 40  # candidates with all losses before others are not looked for
_LOSING_COUNT = 6  # candidates that lose something and are compared
_SCALED_COUNT = 16  # hypotheses of a batch that are tried with other scales
_SHORT_BATCHES_COUNT = 2  # of hypotheses, where the recording is too long
_TRIED_ROOM_COUNT = 12  # candidates whose room is looked at
_HOME_COST_M2 = 1.0  # of a hypothesis that is where the recording was made
_MAX_COST_M2 = 40.0  # of a match
_MAX_REPAIR_M = 0.3  # of a candidate that is used at once
_TOO_FAR = "the vehicles would be too far from their recorded positions"
_BOX_MARGIN_M = 12.0  # around the driven paths
_BOX_LEAD_M = 20.0  # along the lanes before and after the driven paths


class NoPlaceError(RefusedError):
    """A map has no place for a recording."""


@dataclass(frozen=True, eq=False)
class _Search(PlacingTask):
    """The search for places.

    Attributes:
        failures: of each match that cannot be used: whether it is none, its cost, and the reason.
        losing: candidates that are not good.
        unscaled: hypotheses that may be good with another scale.
    """

    failures: list[tuple[bool, float, str]] = field(default_factory=list)
    losing: list[Candidate] = field(default_factory=list)
    unscaled: list[Hypothesis] = field(default_factory=list)

    def home(self) -> list[Hypothesis]:
        """Return where the recording was made, if lanes of its directions are there."""
        if self.graph.network.drawn and self.has_reserved:
            return []
        home = hypothesis_at(self.graph, self.drivers, np.zeros(3))
        return [home] if home.cost <= _HOME_COST_M2 else []

    def drawn_place(self) -> list[Hypothesis]:
        """Return where the road was drawn for the recording, if it was."""
        drawn_for = self.graph.network.drawn_for
        if drawn_for is None or len(drawn_for.lanes) != len(self.drivers):
            return []
        at = hypothesis_at(self.graph, self.drivers, drawn_for.frame)
        return [replace(at, ends=drawn_for.lanes)]

    def batches(
        self, lanes: Sequence[int] | None
    ) -> Iterator[tuple[list[Hypothesis], tuple[float, ...]]]:
        """Yield the hypotheses to be matched, some at a time, the best first, and their scales."""
        scales = self.limits.scales or (1.0,)
        if lanes is None and (home := self.home()):
            yield home, (1.0,)
        streets: list[Hypothesis] = []
        try:
            streets = street_hypotheses(self.graph, self.drivers, lanes, self.limits.scale_low)
        except RefusedError as error:
            self.failures.append((True, 0.0, str(error)))
        rigid = rigid_hypotheses(self.graph, self.drivers, lanes)
        crossed = crossing_hypotheses(self.graph, self.drivers) if lanes is None else []
        first, size = self.drawn_place(), MATCHED_COUNT
        for n in range(math.ceil(max(len(rigid), len(crossed), 1) / size)):
            part = slice(n * size, (n + 1) * size)
            along = streets[n * _MATCHED_STREETS_COUNT : (n + 1) * _MATCHED_STREETS_COUNT]
            yield [*first, *along, *rigid[part], *crossed[part]], scales
            first = []

    def matches(self, hypothesis: Hypothesis) -> Iterator[Match]:
        """Yield the matches that resemble a hypothesis."""
        stop_if_cancelled()
        for prefer_reserved in (True, False) if self.has_reserved else (False,):
            yield from match(
                self.graph, self.drivers, self.met, hypothesis, prefer_reserved=prefer_reserved
            )

    def candidates(self, hypothesis: Hypothesis) -> Iterator[Candidate]:
        """Yield the matches that can be used; the others become failures."""
        for each in self.matches(hypothesis):
            reason = each.reason
            if each.cost > _MAX_COST_M2 and not hypothesis.ends:
                reason = reason or _TOO_FAR
            elif reason:
                self.unscaled.append(hypothesis)
            if reason:
                self.failures.append((True, each.cost, reason))
            else:
                yield Candidate(each, hypothesis, self)

    def good_ones(self, batch: Sequence[Hypothesis]) -> Iterator[Candidate]:
        """Yield the candidates near some hypotheses that are good, in order of `rank`."""
        self.unscaled.clear()
        candidates = [candidate for each in batch for candidate in self.candidates(each)]
        for each in sorted(candidates, key=lambda candidate: candidate.rank):
            if not each.surely_lost and each.refusal:
                self.failures.append((False, each.match.cost, each.refusal))
            elif each.is_good:
                yield each
            else:
                self.losing.append(each)
                if each.depends_on_scale:
                    self.unscaled.append(each.hypothesis)

    def good_at_scales(
        self, batch: Sequence[Hypothesis], scales: Sequence[float]
    ) -> Iterator[Candidate]:
        """Yield the good candidates near some hypotheses with the first scale that has any."""
        unscaled: list[Hypothesis] = []
        for scale in scales:
            tried = batch if scale == 1.0 else self.scaled(unscaled, scale)
            is_good = False
            for each in self.good_ones(tried):
                is_good = True
                yield each
            if is_good:
                return
            if scale == 1.0:
                unscaled = list(dict.fromkeys(self.unscaled))

    def scaled(self, batch: Sequence[Hypothesis], scale: float) -> list[Hypothesis]:
        """Return the first hypotheses with a further scale, as far as it is accepted."""
        scaled = [replace(each, scale=each.scale * scale) for each in batch[:_SCALED_COUNT]]
        return [each for each in scaled if each.scale >= self.limits.scale_low]

    def best_losing(self) -> list[Candidate]:
        """Return some candidates that are not good, the one with the fewest losses first."""
        ranked = sorted(self.losing, key=lambda candidate: candidate.rank)
        usable = (each for each in ranked if not each.refusal)
        return sorted(islice(usable, _LOSING_COUNT), key=lambda each: each.score)


def find_places(
    graph: LaneGraph,
    tracks: tuple[Track, ...],
    limits: PlaceLimits = PlaceLimits(),
    lanes: Sequence[int] | None = None,
) -> Iterator[Candidate]:
    """Yield the places for a recording, those that lose nothing first.

    Places come earlier where, if the map has rights of way, a vehicle that must give way does so.
    Places that break a rule are left out if the network's rules are kept.

    Args:
        graph: of a map or a part of it.
        tracks: of all recorded road users.
        limits: what may change.
        lanes: a vehicle is put onto one of these; None: onto any lane.

    Raises:
        NoPlaceError: there is none. The message has the reason at the place that is nearest to
            being usable.
        RefusedError: the recording needs a junction, and the drawn road has none.
    """
    search = _Search(graph, tracks, limits)
    if graph.network.drawn and not any(lane.junction for lane in graph.network.lanes):
        to_frenet(search.drivers)
    has_place = False
    for batch, scales in search.batches(lanes):
        for each in search.good_at_scales(batch, scales):
            has_place = True
            yield each
        if sum(not each.surely_lost for each in search.losing) >= _JUDGED_COUNT:
            break
    losing = search.best_losing()
    yield from losing
    if not has_place and not losing:
        raise NoPlaceError(_refusal(search))


def windows_on_lanes(network: LaneNetwork, tracks: tuple[Track, ...]) -> list[Floats]:
    """Return in which time the tracks of a recording are on lanes that are too short for it.

    Returns:
        Windows (N, 2) [s], the longest first, then those of the place that resembles it most.
    """
    search = _Search(lane_graph(network, users_of(drivers_of(tracks))), tracks, PlaceLimits())
    row_of = {track.vehicle.id: row for row, track in enumerate(tracks)}
    rows = [row_of[track.vehicle.id] for track in search.drivers]
    whole = np.array([track.present * track.dt for track in tracks])
    ranked: list[tuple[int, float, float, Floats]] = []
    for batch, _ in islice(search.batches(None), _SHORT_BATCHES_COUNT):
        partly = [replace(each, may_begin_before=True) for each in batch]
        for each in chain.from_iterable(map(search.matches, partly)):
            if each.windows is not None and each.cost <= _MAX_COST_M2:
                windows = whole.copy()
                windows[rows] = np.clip(each.windows, whole[rows, :1], whole[rows, 1:])
                lost = float(np.abs(windows - whole).sum())
                ranked.append((each.lost_crossings, round(lost), each.cost, windows))
    return [windows for *_, windows in sorted(ranked, key=lambda row: row[:3])]


def _refusal(search: _Search) -> str:
    """Return the message for a recording without a place."""
    network = search.graph.network
    no_match = (True, 0.0, "no lanes have its directions")
    has_no_lanes, _, reason = min(search.failures, default=no_match)
    if has_no_lanes:
        reason = _missing_crossing(search) or reason
    kind = "road" if network.drawn else "map"
    notes = "".join(f"; {note}" for note in network.notes if network.drawn)
    return f"the recording does not fit {kind} {network.name}: {reason}{notes}"


def _missing_crossing(search: _Search) -> str:
    """Return whose paths cross, if no lanes do."""
    pair = next(pair_crossings(search.drivers), None)
    if pair is None or len(search.graph.crossings[0]):
        return ""
    second, first, _ = pair
    names = [search.drivers[n].vehicle.id for n in (first, second)]
    return f"the paths of vehicles {' and '.join(names)} cross, and no lanes do"


@lru_cache(maxsize=4)  # a map's part is chosen by it, and the recording fitted
def best_place(
    road: Road, tracks: tuple[Track, ...], limits: PlaceLimits = PlaceLimits()
) -> Candidate:
    """Return the best place for a recording on a road's lanes, with room for all vehicles.

    Raises:
        NoPlaceError: there is none; the message has the reason of the best attempt.
        RefusedError: as `find_places`.
    """
    assert road.lanes is not None
    graph = lane_graph(road.lanes, users_of(drivers_of(tracks)))
    reason, best, lowest = "", None, math.inf
    for candidate in islice(find_places(graph, tracks, limits), _TRIED_ROOM_COUNT):
        try:
            repair = max_repair(candidate.separation.tracks, road, limits.max_move)
        except RefusedError as error:
            reason = reason or str(error)
            continue
        if repair > _MAX_REPAIR_M and candidate.shared_lanes:
            reason = reason or f"{candidate.shared_lanes[0].message}, with too little room"
            continue
        rank = len(candidate.refused_losses) + 0.5 * (repair > _MAX_REPAIR_M)
        if rank < lowest:
            lowest, best = rank, candidate
        if rank == 0.0 or candidate.refused_losses:  # the next ones lose as much
            break
    if best is None:
        raise NoPlaceError(f"the recording does not fit the lanes of road {road.name}: {reason}")
    return best


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

    @property
    def note(self) -> Note:
        """The note that this part of the map is used."""
        return Note.of(NoteKind.BEST_PLACE, place=self.where, part=self.part, cost=self.cost)


def places(
    network: LaneNetwork, tracks: tuple[Track, ...], lanes: Sequence[int] | None = None
) -> Iterator[Place]:
    """Yield the places for a recording on a map, the best first; see `find_places`.

    Of those that lose something there is only the best.

    Raises:
        NoPlaceError: there is none.
    """
    graph = lane_graph(network, users_of(drivers_of(tracks)))
    for candidate in find_places(graph, tracks, lanes=lanes):
        yield _place_of(graph.network, candidate.match)
        if not candidate.is_good:
            break


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


def users_of(drivers: Sequence[Track]) -> frozenset[str]:
    """Return the kinds of lane users among the recorded drivers."""
    return frozenset().union(*(track.vehicle.kind.lane_user for track in drivers))

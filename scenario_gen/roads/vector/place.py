# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Where on a map a template goes: all ways of laying it on lanes, the best first, and the part of the map around one."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import chain, combinations, islice
import math

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats, frozen
from scenario_gen.roads.vector.match import Chains, Match, match
from scenario_gen.roads.vector.rules import RuleCheck
from scenario_gen.roads.vector.search import crossing_spots, find_spots, Spot, spot_at
from scenario_gen.roads.vector.street import along_streets
from scenario_gen.situation import find_conflicts, PairConflicts, separate, Track, track_conflicts
from scenario_gen.types import (
    LaneNetwork,
    lanes_for,
    LEVEL,
    Note,
    NoteKind,
    once_per_object,
    Scenario,
)

_HOME = 1.0  # m²: where lanes of its directions lie so near the recorded paths, the template is at home
_SPOTS = 15  # placements as one piece, and
_STREETS = 8  # stretches of road that are looked at closely
_SCALES = (1.0, 0.9, 1.1)
_WORST = 40.0  # m²: what resembles the template less is no place for it
_PRESSED = 4.2  # m/s² across, a little less than scenarios may have: where more is forced, another scale is tried first
_BESIDE = 12.0  # metres of the map around what is driven, and
_FORTH = 20.0  # metres of the lanes before and after it
_LOOK, _OVER = (
    2.0,
    5.0,
)  # metres between places at which heights are compared; between two of which one may lie above the other
_SHIFT = 3.0  # metres by which paths may be shifted to be clear of each other


class NoPlaceError(RefusedError):
    """A map has no place for a template."""


@lru_cache(
    maxsize=4
)  # `once_per_object` would keep a network for good, for its chains refer to it
def chains_of(network: LaneNetwork) -> Chains:
    """Return the chains of a network, the same for the same network."""
    return Chains(network)


def placements(
    network: LaneNetwork,
    tracks: tuple[Track, ...],
    lanes: Sequence[int] | None = None,
    scales: Sequence[float] = _SCALES,
) -> Iterator[tuple[Match, float]]:
    """Yield the ways of laying a template on lanes, with their scales: at home first, then those that resemble it most.

    Those come first on which all whose paths cross or merge meet; of these, where the map has rights of way, those on which
    somebody gives way who has to. Those that break a rule are left out, if the network's rules are kept. Those come last whose
    bends cannot be driven at the template's first and last speeds: smaller, it is slower too.

    Args:
        network: a map or a part of it.
        tracks: of the template, all vehicles.
        lanes: a vehicle is laid onto one of these; None: anywhere.
        scales: s of eq 9, tried in this order where none before could be had.

    Raises:
        NoPlaceError: there is none; says what stands against the template where it was recorded, else where it came farthest.
    """
    chains = chains_of(network)
    home = spot_at(network, tracks, np.zeros(3))
    met = track_conflicts(tracks)
    judged = _Judged(network, tracks, met)
    drawn_for = network.drawn_for
    sized = (
        None
        if drawn_for is None or len(drawn_for.lanes) != len(tracks)
        else spot_at(network, tracks, drawn_for.frame)
    )
    search = _Search(
        chains,
        tracks,
        met,
        scales,
        judged,
        sized,
        drawn_for.lanes if drawn_for is not None else (),
    )
    found, recorded = False, ""
    owns = any(
        map(chains.own_of, tracks)
    )  # who has lanes of its own on a drawn road is not at home on those of cars
    if lanes is None and home.cost <= _HOME and not (network.drawn and owns):
        own = next(match(chains, tracks, met, home))
        broken = own.reason or judged.broken(own)
        if not broken:
            found = True
            yield own, 1.0
        recorded = f"where it was recorded, {broken}; elsewhere, " if broken else ""
    spots = find_spots(network, tracks, lanes)
    crossed = crossing_spots(network, tracks) if lanes is None else []
    streets = along_streets(chains, tracks, lanes)
    for k in range(
        0, max(len(spots), len(crossed), 1), _SPOTS
    ):  # where nobody takes the first ones, the next are looked at
        if k and not found:
            break
        first = [sized] if sized is not None and k == 0 else []
        some = [*first, *spots[k : k + _SPOTS], *crossed[k : k + _SPOTS]]
        for placed in search.near(some, list(islice(streets, _STREETS))):
            found = True
            yield placed
    if not found:
        what, why = ("road", network.notes) if network.drawn else ("map", ())
        *_, reason = min(search.failures, default=("it has no lanes of its directions",))
        raise NoPlaceError(
            f"the recording fits no place on {what} {network.name}: {'; '.join((recorded + reason, *map(str, why)))}"
        )


@dataclass(frozen=True, eq=False)
class _Search:
    """What is laid where.

    Attributes:
        chains, tracks, scales: as of `placements`.
        met: conflicts of the tracks by their vehicles, see `track_conflicts`.
        judged: whether a placement keeps the rules.
        sized: where the road was drawn for the template, None if it was not.
        ends: the lanes that it was drawn with, for each vehicle.
        failures: whether it is no match at all, its cost, and the reason.
    """

    chains: Chains
    tracks: tuple[Track, ...]
    met: PairConflicts
    scales: Sequence[float]
    judged: "_Judged"
    sized: Spot | None
    ends: tuple[tuple[str, str], ...]
    failures: list[tuple[bool, float, str]] = field(default_factory=list)

    def near(self, spots: Sequence[Spot], along: Sequence[Match]) -> Iterator[tuple[Match, float]]:
        """Yield the placements near some spots and along some stretches of road, the best first, with their scales."""
        others: list[tuple[Match, float]] = []
        for scale in self.scales:
            matches = list(along) if scale == 1.0 else []
            for spot in spots:
                stop_if_cancelled()
                ends, owns = (
                    self.ends if spot is self.sized else (),
                    any(map(self.chains.own_of, self.tracks)),
                )
                variants = (
                    match(self.chains, self.tracks, self.met, spot, scale, ends, own=own)
                    for own in (True, False)[not owns :]
                )
                for placement in chain.from_iterable(variants):
                    far = placement.cost > _WORST and spot is not self.sized
                    if placement.reason or far:
                        reason = (
                            placement.reason or "vehicles would be too far from where they are"
                        )
                        self.failures.append((True, placement.cost, reason))
                    else:
                        matches.append(placement)
            broken_by = [self.judged.broken(placement) for placement in matches]
            self.failures.extend(
                (False, p.cost, broken)
                for p, broken in zip(matches, broken_by, strict=True)
                if broken
            )
            matches = [
                placement
                for placement, broken in zip(matches, broken_by, strict=True)
                if not broken
            ]
            matches.sort(key=self._order)
            placed = [p for p in matches if p.aside <= _PRESSED and self.judged.rank(p)[0] == 0]
            others += [(p, scale) for p in matches if p not in placed]
            yield from ((placement, scale) for placement in placed)
            if placed:
                break
        yield from sorted(
            others, key=lambda other: (other[0].aside > _PRESSED, self.judged.rank(other[0])[0])
        )

    def _order(self, placement: Match) -> tuple[float, ...]:
        """What comes first: meetings kept, on a drawn road lanes of one's own, right of way given, resemblance."""
        lost, unkept = self.judged.rank(placement)
        off_own = self.chains.network.drawn and placement.off_own > 0.0
        return lost, off_own, unkept, round(placement.cost + placement.off_own, 3)


class _Judged:
    """Whether placements keep the traffic rules of a network, and lie on one level where vehicles meet."""

    def __init__(
        self, network: LaneNetwork, tracks: tuple[Track, ...], met: PairConflicts
    ) -> None:
        self._network = network
        self._check = RuleCheck(network)
        self._tracks = tracks
        self._met = {pair for pair, conflict in met.items() if not conflict.following}

    def broken(self, placement: Match) -> str:
        """Return what a placement breaks; "" if nothing."""
        if self._network.has_levels and (above := self._above(placement)):
            return above
        if not self._check.rules:
            return ""
        motion = _laid(placement, self._tracks)
        breach = next(iter(self._check.breaches(motion, find_conflicts(motion))), None)
        if breach is None:
            return ""
        return f"vehicle {motion.vehicles[breach.vehicles[0]].id} {breach.message}; road.traffic_rules=ignored allows it"

    def _above(self, placement: Match) -> str:
        """Say which two vehicles a placement lays above each other, as on a bridge and under it; "" if none."""
        lanes = self._network.lanes
        driven = []
        for course in placement.courses:
            count = max(math.ceil((course.end - course.start) / _LOOK), 1) + 1
            places = course.curve.at(np.linspace(course.start, course.end, count))[:, :2]
            middles = KDTree(np.concatenate([lanes[k].centre for k in course.lanes]))
            height = np.concatenate([lanes[k].height for k in course.lanes])[
                middles.query(places)[1]
            ]
            driven.append((places, height))
        for (i, (one, low)), (j, (other, high)) in combinations(enumerate(driven), 2):
            apart = np.abs(low[:, None] - high) > LEVEL
            if (apart & (cdist(one, other) < _OVER)).any():
                first, second = (self._tracks[n].vehicle.id for n in (i, j))
                return f"vehicles {first} and {second} would be above each other, as on a bridge, and not meet"
        return ""

    def rank(self, placement: Match) -> tuple[int, bool]:
        """Return how many that meet in the template do not, and whether nobody gives way who has to."""
        if not self._met and not self._check.rules:
            return 0, True
        motion = _laid(placement, self._tracks)
        conflicts = find_conflicts(motion)
        lost = self._met - {met.pair for met in conflicts}
        return len(lost), not self._check.kept_orders(motion, conflicts)


@once_per_object
def _laid(placement: Match, tracks: tuple[Track, ...]) -> Scenario:
    """The motion of a template at a placement, as it is, unchecked."""
    laid = tracks_on(placement, tracks)
    poses = np.stack([track.poses for track in laid])
    return Scenario(
        vehicles=tuple(track.vehicle for track in laid),
        time=frozen(np.arange(poses.shape[1]) * laid[0].dt),
        position=poses[..., :2],
        heading=poses[..., 2],
        speed=np.stack([track.speed for track in laid]),
        acceleration=np.zeros(poses.shape[:2]),
        present=np.stack([track.present for track in laid]),
    )


def tracks_on(placement: Match, tracks: Sequence[Track]) -> tuple[Track, ...]:
    """The template's tracks on their courses."""
    placed = []
    for course, track in zip(placement.courses, tracks, strict=True):
        driven = float(course.progress[-1])
        curve = course.curve.cut(course.start, course.start + max(driven, 1.0), 0.25)
        progress = course.progress * (curve.length / driven if driven > 1.0 else 1.0)
        placed.append(
            replace(
                track,
                curve=curve,
                progress=frozen(np.minimum(progress, curve.length)),
                lane=course.curve,
            )
        )
    return tuple(placed)


@dataclass(frozen=True, eq=False)
class Place:
    """Where a template fits on a map.

    Attributes:
        box: (2, 2) [m] lowest and highest x, y of the part of the map around it.
        where: the junctions or the lane there.
        cost: [m²] how little it resembles the template; 0 is at home.
        paths: of each vehicle, (M, 2) [m] its way along the lanes.
    """

    box: Floats
    where: str
    cost: float
    paths: tuple[Floats, ...]

    @property
    def part(self) -> str:
        """The part of the map, to be put behind its name."""
        return f"#box={','.join(f'{value:g}' for value in self.box.ravel())}"


def places(
    network: LaneNetwork, tracks: tuple[Track, ...], lanes: Sequence[int] | None = None
) -> Iterator[Place]:
    """Yield the places of a template on a map, the best first; arguments as of `placements`.

    Raises:
        NoPlaceError: there is none.
    """
    network = lanes_for(network, users_of(tracks))
    reason, found = "", False
    for placement, _ in placements(network, tracks, lanes):
        try:
            separate(tracks_on(placement, tracks), 0.0, _SHIFT, sideways=0.0)
        except RefusedError as error:
            reason = reason or str(error)
            continue
        found = True
        paths = tuple(
            c.curve.at(np.linspace(c.start - _FORTH, c.end + _FORTH, 200))[:, :2]
            for c in placement.courses
        )
        points = np.concatenate(paths)
        box = np.round(np.stack((points.min(axis=0) - _BESIDE, points.max(axis=0) + _BESIDE)))
        names = dict.fromkeys(
            network.lanes[k].junction for course in placement.courses for k in course.lanes
        )
        first = network.lanes[placement.courses[0].lanes[0]]
        where = ", ".join(f"junction {name}" for name in names if name) or f"lane {first.id}"
        yield Place(frozen(box), where, placement.cost, paths)
    if not found:
        raise NoPlaceError(f"the recording fits no place on map {network.name}: {reason}")


def users_of(tracks: Sequence[Track]) -> frozenset[str]:
    """Return as what the vehicles of a template may use lanes."""
    return frozenset().union(*(track.vehicle.kind.lane_user for track in tracks))


def best_part(
    network: LaneNetwork, tracks: tuple[Track, ...], lanes: Sequence[int] | None = None
) -> tuple[Floats, Note]:
    """Return the box (2, 2) [m] around the best place of a template on a map, and a note on it.

    Raises:
        NoPlaceError: there is no place for it.
    """
    best = next(places(network, tracks, lanes))
    return (
        best.box,
        Note.of(NoteKind.BEST_PLACE, place=best.where, part=best.part, cost=best.cost),
    )

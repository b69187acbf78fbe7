# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The best place for a template in a whole map: where its paths lie along lanes, in their directions, as one piece.

Every placement that lays one of a few instants of the template onto a lane is tried: the cost of a placement is the mean
squared distance of the template's samples from the nearest lane of their direction. The best are refined.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
import math

import numpy as np

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats, Ints, wrap_angle
from scenario_gen.numerics.curve import crossings, Curve
from scenario_gen.numerics.pattern_search import pattern_search
from scenario_gen.numerics.plane import place
from scenario_gen.roads.vector.network import crossing_lanes
from scenario_gen.situation import pair_crossings, Track
from scenario_gen.types import LaneNetwork, once_per_object

_CELL = 1.0  # metres
_MOST_CELLS = 30_000_000  # of a map: a larger one is looked at in larger cells
_MOST_SEARCHED = 300_000  # sections, a metre of lane each, of a map that is searched as a whole
_AT_ONCE = 20_000  # sections
_REACH = 4.0  # metres from a lane beyond which a sample counts as off the road
_BINS = 16  # of directions
_ALIKE = math.radians(35.0)  # a sample may be turned from its lane by this
_NUDGE = 1e-6  # cells and bins: a sample on the edge between two is in the same one on every CPU
_EVERY = 2  # sections of a lane between placements
_SPACING = 2.0  # metres between a path's samples
_MOST_SAMPLES = 40  # of a path
_REFINED = 60  # placements
_ELSEWHERE = 15.0  # metres and
_TURNED = math.radians(30.0)  # by which placements differ that are not the same
_PAIRS = 3  # of vehicles whose crossing is laid onto one of lanes
_ANGLE = math.radians(50.0)  # by which the angle of a crossing may differ
_LEAST_ANGLE = math.radians(15.0)  # of two lanes that cross
_TOGETHER = 2_000_000  # samples looked up at once


@dataclass(frozen=True)
class Spot:
    """A placement of the template as one piece: its cost [m²]; where on the map the template's own frame lies [m, m, rad]."""

    cost: float
    x: float
    y: float
    yaw: float

    def moved(self, points: Floats) -> Floats:
        """Points (P, 2) [m] of the template on the map."""
        return place(np.array([self.x, self.y, self.yaw]), *points.T)


@once_per_object
def _field(network: LaneNetwork) -> "_Field":
    return _Field(network)


class _Field:
    """How far each cell lies from the nearest lane of each direction, as far as `_REACH`."""

    def __init__(self, network: LaneNetwork) -> None:
        points, yaws = _sections(network)
        if len(points) > _MOST_SEARCHED:
            raise RefusedError(
                f"map {network.name} has {len(points)} sections of lanes; at most {_MOST_SEARCHED} are searched for a place: "
                "choose a part with #box=x0,y0,x1,y1"
            )
        low, high = points.min(axis=0) - _REACH, points.max(axis=0) + _REACH
        self.cell = max(_CELL, math.sqrt(float(np.prod(high - low)) / _MOST_CELLS))
        self.low = low
        size = np.ceil((high - low) / self.cell).astype(np.int64) + 1
        reach = math.ceil(_REACH / self.cell)
        offsets = np.stack(
            np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1)), axis=-1
        ).reshape(-1, 2)

        def around(part: slice) -> tuple[Floats, Ints]:
            """Distances and cells (P, O) about some sections."""
            at = np.floor((points[part] - low) / self.cell).astype(np.int64)
            cells = np.clip(at[:, None] + offsets, 0, size - 1)
            centres = low + (cells + 0.5) * self.cell
            distance = np.hypot(
                centres[..., 0] - points[part, None, 0], centres[..., 1] - points[part, None, 1]
            )
            return distance, cells[..., 1] * size[0] + cells[..., 0]

        parts = [slice(k, k + _AT_ONCE) for k in range(0, len(points), _AT_ONCE)]
        seen = np.zeros(int(size[0] * size[1]), dtype=np.bool_)
        for part in parts:
            seen[around(part)[1]] = True
        known = np.flatnonzero(seen)
        self.index = np.full(int(size[0] * size[1]), len(known), dtype=np.int32)
        self.index[known] = np.arange(len(known))
        self.size = size
        self.table = np.full((len(known) + 1, _BINS), _REACH)
        for part in parts:
            distance, flat = around(part)
            own = self.index[flat]
            for k in range(_BINS):
                near = np.abs(wrap_angle(yaws[part] - 2.0 * np.pi * k / _BINS)) <= _ALIKE
                np.minimum.at(self.table[:, k], own[near].ravel(), distance[near].ravel())

    def squared(self, points: Floats, yaws: Floats) -> Floats:
        """Squared distance [m²] of poses (..., 2), (...) from the nearest lane of their direction."""
        cell = np.floor((points - self.low) / self.cell + _NUDGE).astype(np.int64)
        inside = ((cell >= 0) & (cell < self.size)).all(axis=-1)
        flat = np.where(inside, cell[..., 1] * self.size[0] + cell[..., 0], 0)
        which = np.where(inside, self.index[flat], len(self.table) - 1)
        turn: Ints = np.round(yaws / (2.0 * np.pi / _BINS) + _NUDGE).astype(np.int64) % _BINS
        return np.asarray(np.square(self.table[which, turn]))


def _sections(
    network: LaneNetwork, every: int = 1, lanes: Sequence[int] | None = None
) -> tuple[Floats, Floats]:
    """Middles (P, 2) [m] and directions (P,) [rad] of the lanes' sections."""
    chosen = network.lanes if lanes is None else [network.lanes[k] for k in lanes]
    return np.concatenate([lane.middle[::every] for lane in chosen]), np.concatenate(
        [lane.yaw[::every] for lane in chosen]
    )


def find_spots(
    network: LaneNetwork, tracks: tuple[Track, ...], lanes: Sequence[int] | None = None
) -> list[Spot]:
    """Return the best placements, the best first, each at another place or turned otherwise.

    Args:
        network: a whole map.
        tracks: of the template, all vehicles.
        lanes: a vehicle is laid onto one of these; None: onto any lane.
    """
    field = _field(network)
    poses, weight = _samples(tracks)
    points, yaws = _sections(network, _EVERY, lanes)
    spots: list[Spot] = []
    step = max(_TOGETHER // len(poses), 1)
    for anchor in _anchors(tracks):
        placements = _laid_onto(anchor[:2], points, yaws - anchor[2])
        parts = [placements[k : k + step] for k in range(0, len(placements), step)]
        cost = np.concatenate([_costs(field, poses, weight, part) for part in parts])
        stop_if_cancelled()
        best = np.argsort(np.round(cost, 9), kind="stable")[: 4 * _REFINED]
        spots += [Spot(*row) for row in np.column_stack((cost, placements))[best].tolist()]
    centre = poses[:, :2].mean(axis=0)
    chosen = _distinct(spots, centre, _REFINED)
    return _distinct([_refined(field, poses, weight, spot) for spot in chosen], centre, _REFINED)


def crossing_spots(network: LaneNetwork, tracks: tuple[Track, ...]) -> list[Spot]:
    """Return placements that lay the place where two paths cross onto one where two lanes do so at about that angle, best first.

    Roads of another width shift paths against each other: such a place need not be among those that resemble all paths most.
    """
    point, yaw = _lane_crossings(network)
    placements = []
    for a, b, crossing in islice(pair_crossings(tracks), _PAIRS):
        own, other = tracks[a].curve.at(crossing.first), tracks[b].curve.at(crossing.second)
        turn = wrap_angle(yaw - np.array([own[2], other[2]]))  # of each of both
        apart = wrap_angle(turn[:, 1] - turn[:, 0])
        alike = np.abs(apart) <= _ANGLE
        placements.append(_laid_onto(own[:2], point[alike], turn[alike, 0] + apart[alike] / 2.0))
    moved = np.concatenate([np.zeros((0, 3)), *placements])
    if not len(moved):
        return []
    poses, weight = _samples(tracks)
    cost = _costs(_field(network), poses, weight, moved)
    spots = [Spot(*row) for row in np.column_stack((cost, moved)).tolist()]
    return _distinct(spots, poses[:, :2].mean(axis=0), _REFINED)


@once_per_object
def _lane_crossings(network: LaneNetwork) -> tuple[Floats, Floats]:
    """Points (C, 2) [m] where two lanes cross, and the directions (C, 2) [rad] of both; each crossing in both orders."""
    points, yaws = [np.zeros((0, 2))], [np.zeros((0, 2))]
    for k, j in sorted({(min(pair), max(pair)) for pair in crossing_lanes(network)}):
        one, other = (Curve.through(network.lanes[n].centre) for n in (k, j))
        for along, along_other in crossings(one, other, _LEAST_ANGLE).tolist():
            first, second = one.at(along), other.at(along_other)
            points += [first[None, :2], first[None, :2]]
            yaws += [np.array([[first[2], second[2]]]), np.array([[second[2], first[2]]])]
    return np.concatenate(points), np.concatenate(yaws)


def spot_at(network: LaneNetwork, tracks: tuple[Track, ...], frame: Floats) -> Spot:
    """The template where its frame (3,) x, y [m], yaw [rad] lies; the cost says whether lanes of its directions are there."""
    poses, weight = _samples(tracks)
    cost = float(_costs(_field(network), poses, weight, frame[None])[0])
    return Spot(cost, *frame.tolist())


def _laid_onto(point: Floats, places: Floats, turn: Floats) -> Floats:
    """Placements (M, 3) turned by so much (M,) [rad] that lay a point (2,) [m] of the template onto places (M, 2) [m]."""
    return np.column_stack((place(np.column_stack((places, turn)), -point[0], -point[1]), turn))


def _samples(tracks: tuple[Track, ...]) -> tuple[Floats, Floats]:
    """Poses (P, 3) along all paths, and their weights (P,), whose sum is one for all vehicles alike."""
    poses, weight = [], []
    for track in tracks:
        count = (
            1
            if track.still
            else min(max(math.ceil(track.travelled / _SPACING), 1) + 1, _MOST_SAMPLES)
        )
        poses.append(track.curve.at(np.linspace(0.0, track.travelled, count)))
        weight.append(np.full(count, 1.0 / (count * len(tracks))))
    return np.concatenate(poses), np.concatenate(weight)


def _anchors(tracks: tuple[Track, ...]) -> list[Floats]:
    """Poses of the template that are laid onto lanes: where paths cross, and the begin, middle and end of the longest paths."""
    anchors: list[Floats] = []
    for a, b, crossing in islice(pair_crossings(tracks), 2):
        anchors += [tracks[a].curve.at(crossing.first), tracks[b].curve.at(crossing.second)]
    for track in sorted(tracks, key=lambda track: -track.travelled)[:2]:
        anchors += [track.curve.at(share * track.travelled) for share in (0.05, 0.5, 0.95)]
    return anchors


def _costs(field: _Field, poses: Floats, weight: Floats, placements: Floats) -> Floats:
    """Costs (M,) [m²] of placements (M, 3): where the origin lies and how far all is turned."""
    points = place(placements[:, None], *poses[:, :2].T)
    return np.asarray(
        (field.squared(points, poses[:, 2] + placements[:, 2, None]) * weight).sum(axis=1)
    )


def _refined(field: _Field, poses: Floats, weight: Floats, spot: Spot) -> Spot:
    """The best placement near one, by moves and turns about the template's middle."""
    centre = poses[:, :2].mean(axis=0)
    local = poses - np.array([*centre, 0.0])
    begin, step = (
        np.array([*spot.moved(centre), spot.yaw]),
        np.array([2.0, 2.0, math.radians(4.0)]),
    )
    state, cost = pattern_search(
        lambda trials: _costs(field, local, weight, trials), begin, step, 0.2
    )
    return Spot(cost, *_laid_onto(centre, state[None, :2], state[2:])[0].tolist())


def _distinct(spots: list[Spot], centre: Floats, most: int) -> list[Spot]:
    """The best of those that are alike, at most `most`, the best first."""
    kept: list[Spot] = []
    places = np.empty((0, 3))
    for spot in sorted(
        spots,
        key=lambda spot: (
            round(spot.cost, 6),
            round(spot.yaw, 6),
            round(spot.x, 3),
            round(spot.y, 3),
        ),
    ):
        own = np.array([*spot.moved(centre), spot.yaw])
        off = np.abs(places - own)
        turned = np.abs(wrap_angle(places[:, 2] - own[2]))
        if not ((off[:, 0] < _ELSEWHERE) & (off[:, 1] < _ELSEWHERE) & (turned < _TURNED)).any():
            kept.append(spot)
            places = np.vstack((places, own))
            if len(kept) == most:
                break
    return kept

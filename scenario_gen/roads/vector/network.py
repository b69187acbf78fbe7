# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""From borders to lanes: cross-sections, junctions that a map does not name, and the part of a network inside a box."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
import math

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Bools, Floats, runs
from scenario_gen.errors import InputError
from scenario_gen.types.lanes import Lane, LaneNetwork

_SECTION = 1.0  # metres between cross-sections at most
_SHORTEST = 0.05  # metres of a border
MOST_SECTIONS = 2_000_000  # of a whole map


@dataclass(frozen=True, eq=False)
class Draft:
    """A lane as a reader finds it; neighbours by id.

    Attributes:
        id: the lane's name.
        left: (A, 2) metres, left border in driving direction.
        right: (B, 2) metres, right border.
        successors: names of lanes.
        beside: names of lanes to which one may change.
        speed_limit: m/s or NaN.
        junction: its junction or "".
        place: file and line, for messages.
        paired: left and right are cross-sections already.
    """

    id: str
    left: Floats
    right: Floats
    successors: tuple[str, ...]
    beside: tuple[str, ...]
    speed_limit: float
    junction: str
    place: str
    paired: bool = False


def network_of(name: str, drafts: Sequence[Draft], notes: Iterable[str]) -> LaneNetwork:
    """Return the network of what a reader found; neighbours that are no lanes for cars are left out.

    Raises:
        InputError: there is no lane, an id is there twice, or a border is no line.
    """
    if not drafts:
        raise InputError(f"map {name}: no lane that cars may use")
    index: dict[str, int] = {}
    for k, draft in enumerate(drafts):
        if draft.id in index:
            raise InputError(f"{draft.place}: lane {draft.id} is there twice, first at {drafts[index[draft.id]].place}")
        index[draft.id] = k
    lanes, total = [], 0
    for draft in drafts:
        left, right = (draft.left, draft.right) if draft.paired else cross_sections(draft.left, draft.right, draft.place)
        total += len(left)
        if total > MOST_SECTIONS:
            raise InputError(f"map {name}: lanes of more than {MOST_SECTIONS * _SECTION / 1000.0:g} km; cut the map")
        after, beside = (
            tuple(dict.fromkeys(index[other] for other in names if other in index)) for names in (draft.successors, draft.beside)
        )
        lanes.append(Lane(draft.id, left, right, after, beside, draft.speed_limit, draft.junction))
    network = LaneNetwork(name, tuple(lanes), tuple(notes))
    return network if any(lane.junction for lane in lanes) else with_junctions(network)


def cross_sections(left: Floats, right: Floats, where: str) -> tuple[Floats, Floats]:
    """Two borders (A, 2) and (B, 2) [m] at common shares of their lengths, (M, 2) each; every vertex of both is kept.

    Raises:
        InputError: a border has no length.
    """
    borders, shares, longest = [], [], 0.0
    for name, border in (("left", left), ("right", right)):
        step = exact.hypot(*np.diff(border, axis=0).T) if len(border) > 1 else np.zeros(0)
        keep = np.concatenate(([True], step > 1e-6)) if len(border) else np.zeros(0, dtype=np.bool_)
        points = border[keep]
        length = np.concatenate(([0.0], np.cumsum(exact.hypot(*np.diff(points, axis=0).T)))) if len(points) > 1 else np.zeros(1)
        if length[-1] < _SHORTEST:
            raise InputError(f"{where}: the {name} border has {len(border)} point(s) and no length; a line is needed")
        borders.append(points)
        shares.append(length / length[-1])
        longest = max(longest, float(length[-1]))
    if longest > MOST_SECTIONS * _SECTION:
        raise InputError(f"{where}: a border of {longest / 1000.0:.0f} km; check the coordinates")
    even = np.linspace(0.0, 1.0, math.ceil(longest / _SECTION) + 1)
    share = np.unique(np.concatenate((*shares, even)))
    share = share[np.concatenate(([True], np.diff(share) > 1e-9))]
    share[-1] = 1.0
    first, second = (
        np.column_stack([np.interp(share, own, points[:, axis]) for axis in (0, 1)])
        for own, points in zip(shares, borders, strict=True)
    )
    return first, second


def with_junctions(network: LaneNetwork) -> LaneNetwork:
    """Name the junctions of a map that names none: lanes whose middles cross, and those that part from the same lane, are one.

    They are numbered 1, 2, … in the order of their first lanes.
    """
    lanes = network.lanes
    low = np.array([lane.centre.min(axis=0) for lane in lanes])
    high = np.array([lane.centre.max(axis=0) for lane in lanes])
    root = list(range(len(lanes)))

    def find(k: int) -> int:
        while root[k] != k:
            root[k] = root[root[k]]
            k = root[k]
        return k

    crossing: set[int] = set()
    for a in range(len(lanes)):
        near = np.flatnonzero((low[a] <= high[a + 1 :]).all(axis=1) & (low[a + 1 :] <= high[a]).all(axis=1)) + a + 1
        for b in near.tolist():
            if _cross(lanes[a].centre, lanes[b].centre):
                crossing |= {a, b}
                root[find(b)] = find(a)
    for before in network.lanes:  # who parts from a lane that crosses others turns at the same junction
        inner = [k for k in before.successors if k in crossing]
        for k in before.successors if inner else ():
            if k not in crossing:
                crossing.add(k)
                root[find(k)] = find(inner[0])
    first: dict[int, str] = {}
    named = []
    for k, lane in enumerate(lanes):
        name = first.setdefault(find(k), str(len(first) + 1)) if k in crossing else ""
        named.append(replace(lane, junction=name))
    return replace(network, lanes=tuple(named))


def _cross(a: Floats, b: Floats) -> bool:
    """Whether two polylines cross between their ends."""
    u, v = np.diff(a, axis=0), np.diff(b, axis=0)
    w = b[None, :-1] - a[:-1, None]
    det = u[:, None, 0] * v[None, :, 1] - u[:, None, 1] * v[None, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (w[..., 0] * v[None, :, 1] - w[..., 1] * v[None, :, 0]) / det
        q = (w[..., 0] * u[:, None, 1] - w[..., 1] * u[:, None, 0]) / det
    hit = (t >= 0.0) & (t < 1.0) & (q >= 0.0) & (q < 1.0)
    hit[0, 0] = hit[-1, -1] = False  # they part, or meet, there
    return bool(hit.any())


def part_of(network: LaneNetwork, box: Floats, note: str) -> LaneNetwork:
    """Return the part of a network inside a box (2, 2) [m]: lanes are cut where their centre lines leave it.

    Raises:
        InputError: no lane is in the box.
    """
    pieces: list[tuple[int, Floats, Floats, bool]] = []  # lane, borders, whether its end is there
    begins: dict[int, int] = {}
    for k, lane in enumerate(network.lanes):
        last = len(lane.left) - 1
        for first, stop in runs(_inside(lane.centre, box)):
            low = max(first - _cut(lane.centre, first, first - 1, box), 0.0)
            high = min(stop - 1 + _cut(lane.centre, stop - 1, stop, box), float(last))
            if high - low < 1e-6:
                continue
            at = np.unique(np.concatenate(([low], np.arange(math.ceil(low), math.floor(high) + 1), [high])))
            borders = [
                np.column_stack([np.interp(at, np.arange(last + 1), b[:, j]) for j in (0, 1)]) for b in (lane.left, lane.right)
            ]
            if low == 0.0:
                begins[k] = len(pieces)
            pieces.append((k, borders[0], borders[1], high == last))
    if not pieces:
        raise InputError(
            f"map {network.name}: no lane in the box {box[0, 0]:g},{box[0, 1]:g},{box[1, 0]:g},{box[1, 1]:g}; {extent(network)}"
        )
    some = {k: piece for piece, (k, *_) in reversed(list(enumerate(pieces)))}  # of a lane in several pieces, the first
    lanes = []
    for k, left, right, has_end in pieces:
        lane = network.lanes[k]
        after = tuple(begins[other] for other in lane.successors if other in begins) if has_end else ()
        beside = tuple(some[other] for other in lane.beside if other in some)
        lanes.append(replace(lane, left=left, right=right, successors=after, beside=beside))
    return LaneNetwork(network.name, tuple(lanes), (*network.notes, note))


def extent(network: LaneNetwork) -> str:
    """Say how far a network reaches."""
    (x0, y0), (x1, y1) = network.box.tolist()
    return f"its {len(network.lanes)} lanes reach from {x0:.1f},{y0:.1f} to {x1:.1f},{y1:.1f}"


def _inside(points: Floats, box: Floats) -> Bools:
    return np.asarray(((points >= box[0]) & (points <= box[1])).all(axis=1))


def _cut(points: Floats, inner: int, outer: int, box: Floats) -> float:
    """Which share of the edge from point `inner`, in the box, to point `outer`, beyond it, lies in the box."""
    if not 0 <= outer < len(points):
        return 0.0
    step = points[outer] - points[inner]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(step > 0.0, (box[1] - points[inner]) / step, np.where(step < 0.0, (box[0] - points[inner]) / step, 1.0))
    return float(np.clip(share.min(), 0.0, 1.0))


def lane_ends(network: LaneNetwork) -> tuple[Floats, Floats]:
    """Entries (E, 3) and exits (X, 3): x, y [m], yaw [rad] of the centre line at the begin or end of those lanes."""

    def pose(lane: Lane, at: int, edge: int) -> list[float]:
        step = lane.centre[edge + 1] - lane.centre[edge]
        return [*lane.centre[at].tolist(), float(exact.arctan2(step[1], step[0]))]

    entries = [pose(network.lanes[k], 0, 0) for k in network.entries]
    exits = [pose(network.lanes[k], -1, len(network.lanes[k].centre) - 2) for k in network.exits]
    return np.array(entries).reshape(-1, 3), np.array(exits).reshape(-1, 3)

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Is what was published valid? Asked again of an independent checker, on every recorded encounter and road.

Footprints against each other and against the road by conservative advancement with shapely's distances (`_recheck_motion`);
passing orders and waits found anew in template and scenario; end states and limits by plain differences.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations
import sys
from typing import Any

import numpy as np
import shapely

from benchmarks._recheck_motion import advance, boxes_at, Lanes, Paces, SLOT, TOUCH
from benchmarks._sampling_cases import cases, Prepared
from scenario_gen.method.validity import Limits
from scenario_gen.numerics.arrays import Bools, Floats, Ints
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import BoundaryStates, Scenario

OF_TYPE = (
    "max_speed",
    "max_acceleration",
    "max_deceleration",
    "max_lateral_acceleration",
    "sharpest",
)
ALIKE = 0.5  # rad, headings of vehicles on the same path
FOLLOWING = 3.0  # vehicle lengths of shared path that are following
ROOMS = (1.0, 0.5, 0.2)  # m
COARSE, FINE = (
    2.0,
    0.05,
)  # m, between the poses of a sweep; the fine one decides where the coarse one leaves it open
TIE = 0.02  # s, entries nearer to each other than this have no order


@dataclass
class Account:
    """What was looked at and what was found: violations by cause, conflicts with their order, waits."""

    scenarios: int = 0
    vehicles: int = 0
    instants: int = 0
    orders: int = 0
    ties: int = 0
    absent: int = 0
    waits: int = 0
    found: Counter[str] = field(default_factory=Counter)
    first: dict[str, str] = field(default_factory=dict)

    def add(self, cause: str, sentence: str) -> None:
        """Count a violation."""
        self.found[cause] += 1
        self.first.setdefault(cause, sentence)


class Recheck:
    """Re-checks the scenarios of one template on one road."""

    def __init__(
        self, encounter: Encounter, road: Road, asked: BoundaryStates, has_changepoints: bool
    ) -> None:
        self.asked, self.limits = asked, Limits()
        walks = np.array([vehicle.type == "pedestrian" for vehicle in encounter.vehicles])
        self.grounds = [
            (own, *_ground(road, on_foot))
            for on_foot, own in ((False, ~walks), (True, walks))
            if own.any()
        ]
        time = encounter.time
        self.template = Scenario(
            encounter.vehicles,
            time,
            encounter.position,
            encounter.heading,
            encounter.speed,
            0.0 * encounter.speed,
            present=encounter.present,
        )
        self.orders = {pair: order for pair, order in _orders(self.template) if order}
        self.waits = _waits(encounter) if has_changepoints else [(0, 0)] * len(encounter.vehicles)

    def check(self, scenarios: Sequence[Scenario], account: Account) -> None:
        """Check a batch and count what is found."""
        n = len(scenarios[0].vehicles)
        account.scenarios += len(scenarios)
        account.vehicles += n * len(scenarios)
        lanes = Lanes.of(scenarios)
        longer = Lanes.of(scenarios, self.limits.presence_margin)
        account.instants += self._roads(lanes, n, account) + self._pairs(longer, n, account)
        for scenario in scenarios:
            self._states(scenario, account)
            self._passing(scenario, account)
            self._standing(scenario, account)

    def _roads(self, lanes: Lanes, n: int, account: Account) -> int:
        fast = np.hypot(*np.moveaxis(lanes.hodograph(), -1, 0)).max(axis=1)
        reach = np.hypot(*lanes.half.T)[np.floor(lanes.key[:-1] / SLOT).astype(int)]
        paces = Paces.of(lanes.key, fast + lanes.turning() * reach)

        def distance(lane: Ints, time: Floats) -> tuple[Floats, Bools]:
            gap, out = np.zeros(len(lane)), np.zeros(len(lane), dtype=np.bool_)
            for own, area, edges in self.grounds:
                rows = np.flatnonzero(own[lane % n])
                gap[rows], out[rows] = _off_ground(area, edges, lanes, lane[rows], time[rows])
            return gap, out

        bad, looked = advance(lanes.begin, lanes.end, paces, distance)
        for lane in np.flatnonzero(bad).tolist():
            account.add("off_road", f"vehicle {lane % n} of scenario {lane // n} of the batch")
        return looked

    def _pairs(self, lanes: Lanes, n: int, account: Account) -> int:
        looked, hodograph, turning = 0, lanes.hodograph(), lanes.turning()
        count = len(lanes.end) // n
        samples = np.searchsorted(lanes.key, SLOT * np.arange(n * count + 1))
        for a, b in combinations(range(n), 2):
            rows = [
                np.concatenate(
                    [np.arange(samples[s * n + v], samples[s * n + v + 1]) for s in range(count)]
                )
                for v in (a, b)
            ]
            one, two = (np.minimum(r[:-1], len(turning) - 1) for r in rows)
            fast = np.hypot(*np.moveaxis(hodograph[one] - hodograph[two], -1, 0)).max(axis=1)
            radius = [float(np.hypot(*lanes.half[v])) for v in (a, b)]
            key = np.mod(lanes.key[rows[0]], SLOT) + SLOT * np.floor(lanes.key[rows[0]] / SLOT / n)
            paces = Paces.of(key, fast + turning[one] * radius[0] + turning[two] * radius[1])

            def distance(task: Ints, time: Floats, a: int = a, b: int = b) -> tuple[Floats, Bools]:
                gap = shapely.distance(
                    lanes.boxes(task * n + a, time), lanes.boxes(task * n + b, time)
                )
                return gap, gap <= 0.0

            both = (
                np.maximum(lanes.begin[a::n], lanes.begin[b::n]),
                np.minimum(lanes.end[a::n], lanes.end[b::n]),
            )
            bad, more = advance(*both, paces, distance)
            looked += more
            for task in np.flatnonzero(bad).tolist():
                account.add("overlap", f"vehicles {a} and {b} of scenario {task} of the batch")
        return looked

    def _states(self, s: Scenario, account: Account) -> None:
        """End states, and the limits of the motion."""
        one = self.limits
        top, speeding, braking, sideways, bend = np.array(
            [[getattr(one.of(v.type), name) for v in s.vehicles] for name in OF_TYPE]
        )
        for k, asked in ((0, self.asked.start), (-1, self.asked.end)):
            driven, gained = _unseen(s, k)
            far = (
                np.linalg.norm(s.position[:, k] - asked[:, :2], axis=1)
                - self.asked.relaxed[:, k, 0]
                - driven
            ).max()
            other = (
                np.abs(s.speed[:, k] - asked[:, 3]) - self.asked.relaxed[:, k, 1] - gained
            ).max()
            if far > one.position_tolerance or other > one.speed_tolerance:
                account.add(
                    "boundary_state", f"{far:.3f} m, {other:.3f} m/s in scenario {s.index}"
                )
        h, slack = np.diff(s.time), 1e-5
        rate = np.diff(s.speed, axis=1) / h
        turn = np.abs(np.diff(s.heading, axis=1))
        way = np.hypot(*np.moveaxis(np.diff(s.position, axis=1), -1, 0))
        pace = np.maximum(s.speed[:, 1:], s.speed[:, :-1])
        high = np.maximum(rate.max(axis=1), s.acceleration.max(axis=1))
        low = np.minimum(rate.min(axis=1), s.acceleration.min(axis=1))
        broken = {
            "speed": s.speed.min() < 0.0 or (s.speed.max(axis=1) > top).any(),
            "longitudinal_acceleration": (
                (high > speeding + slack) | (-low > braking + slack)
            ).any(),
            "lateral_acceleration": ((pace * turn / h).max(axis=1) > sideways + slack).any(),
            "curvature": bool(
                (turn > np.nan_to_num(bend[:, None], posinf=1e9) * way + 1.1e-4).any()
            ),
        }
        for cause in (name for name, wrong in broken.items() if wrong):
            account.add(cause, f"scenario {s.index}")

    def _passing(self, s: Scenario, account: Account) -> None:
        found = dict(_orders(s, self.orders))
        for pair, first in self.orders.items():
            order = found.get(pair, 0)
            if order == 0:
                if pair in found:
                    account.ties += 1
                else:
                    account.absent += 1
                continue
            account.orders += 1
            if order != first:
                account.add("passing_order", f"vehicles {pair} in scenario {s.index}")

    def _standing(self, s: Scenario, account: Account) -> None:
        """As many stands, and as many slow stretches in all, as the template has, one second for each."""
        for v, (standing, every) in enumerate(self.waits):
            account.waits += every
            for wanted, limit in (
                (standing, self.limits.stand_speed),
                (every, self.limits.creep_speed),
            ):
                if wanted and sum(int(length + 1e-6) for length in _stands(s, v, limit)) < wanted:
                    account.add("stop_not_kept", f"vehicle {v} in scenario {s.index}")
                    break


def _unseen(s: Scenario, end: int) -> tuple[Floats, Floats]:
    """Return metres (N,) driven and m/s (N,) gained or lost in the step in which a vehicle comes (0) or goes (-1).

    It is the step between its first or last instant and the one at which it is not there; 0 where there is none.
    """
    at, rows = s.present[:, end], np.arange(len(s.vehicles))
    beyond = at + (1 if end else -1)
    there = (beyond < 0) | (beyond >= len(s.time)) | (at == 0) | (at == len(s.time) - 1)
    step = np.where(there, 0.0, np.abs(s.time[np.where(there, at, beyond)] - s.time[at]))
    return step * s.speed[rows, at], step * np.abs(s.acceleration[rows, at])


def _off_ground(
    area: Any, edges: shapely.STRtree, lanes: Lanes, lane: Ints, time: Floats
) -> tuple[Floats, Bools]:
    """How far [m] footprints are from the edges of an area at least, and whether they are not inside."""
    gap, open_ = np.zeros(len(lane)), np.arange(len(lane))
    for room in ROOMS:  # a footprint that is on the road when grown by so much is as far from its edge: quickly asked
        free = shapely.covers(area, lanes.boxes(lane[open_], time[open_], -room))
        gap[open_[free]] = room
        open_ = open_[~free]
    if len(open_):
        (at, _), left = edges.query_nearest(
            lanes.boxes(lane[open_], time[open_]), all_matches=False, return_distance=True
        )
        gap[open_[at]] = left
    # an edge may be touched; who starts inside and crosses none stays inside
    near = (gap <= TOUCH) | (time == lanes.begin[lane])
    out = np.zeros(len(lane), dtype=np.bool_)
    out[near] = ~shapely.covers(area, lanes.boxes(lane[near], time[near], TOUCH))
    return gap, out


def _ground(road: Road, on_foot: bool) -> tuple[Any, shapely.STRtree]:
    """Where road users may be, and its edges: drivable cells; on foot, on a road with lanes, all cells but obstacles."""
    cells = road.drivable
    if on_foot and road.lanes is not None:
        cells = np.ones_like(cells) if road.obstructed is None else ~road.obstructed
    area = _union(road, cells)
    lines = shapely.get_parts(shapely.segmentize(shapely.boundary(area), 50.0))
    return area, shapely.STRtree(_segments(lines))


def _union(road: Road, free: Bools) -> Any:
    """Union of the cells of a road that are free, each run of a row as one rectangle."""
    boxes = []
    for row, cells in enumerate(free):
        edges = np.flatnonzero(np.diff(np.concatenate(([0], cells.astype(np.int64), [0]))))
        low = road.origin[1] + road.resolution * row
        for a, b in (road.origin[0] + road.resolution * edges.reshape(-1, 2)).tolist():
            boxes.append(shapely.box(a, low, b, low + road.resolution))
    area = shapely.simplify(shapely.union_all(boxes, grid_size=1e-9), 0.0)
    shapely.prepare(area)
    return area


def _segments(lines: Any) -> Any:
    """All segments of some lines, one by one."""
    parts = []
    for line in shapely.get_parts(lines):
        at = shapely.get_coordinates(line)
        parts.append(np.stack([at[:-1], at[1:]], axis=1))
    return shapely.linestrings(np.concatenate(parts))


def _orders(s: Scenario, only: Any = None) -> Iterator[tuple[tuple[int, int], int]]:
    """For each pair whose sweeps meet: 1 if the lower one goes first, -1 if the other does, 0 if neither (a tie)."""
    for pair in combinations(range(len(s.vehicles)), 2):
        if only is None or pair in only:
            order = _order(s, *pair)
            if order is not None:
                yield pair, order


def _order(s: Scenario, a: int, b: int, step: float | None = None) -> int | None:
    """The order of one pair; None without a conflict. Entries too near to each other are looked at more closely."""
    time, poses = zip(*(_sampled(s, v, step) for v in (a, b)), strict=True)
    moved = [_distinct(p, COARSE if step is None else FINE) for p in poses]
    boxes = [
        boxes_at(
            p[m], np.repeat([[0.5 * v.length - TOUCH, 0.5 * v.width - TOUCH]], len(m), axis=0)
        )
        for p, m, v in zip(poses, moved, (s.vehicles[a], s.vehicles[b]), strict=True)
    ]
    i, j = shapely.STRtree(boxes[1]).query(boxes[0], predicate="intersects")
    if not len(i):
        return None
    times = [t[m] for t, m in zip(time, moved, strict=True)]
    lead = _lead(
        poses[0][moved[0]],
        poses[1][moved[1]],
        times,
        (i, j),
        max(s.vehicles[a].length, s.vehicles[b].length),
    )
    if lead:
        return lead
    entry = times[0][i.min()], times[1][j.min()]
    unsure = sum(t[k] - t[max(k - 1, 0)] for t, k in zip(times, (i.min(), j.min()), strict=True))
    if step is None and abs(entry[0] - entry[1]) <= unsure and max(entry) > 0.0:
        return _order(s, a, b, 0.01)
    if abs(entry[0] - entry[1]) < TIE:
        return 1 if max(entry) == 0.0 else 0  # both inside from the start: by index
    return 1 if entry[0] < entry[1] else -1


def _sampled(s: Scenario, v: int, step: float | None) -> tuple[Floats, Floats]:
    """Times (M,) and poses (M, 3) of a vehicle while it is there."""
    first, last = s.present[v]
    if step is None:
        own = slice(first, last + 1)
        return s.time[own], np.column_stack([s.position[v, own], s.heading[v, own]])
    time = np.arange(s.time[first], s.time[last], step)
    return time, Lanes.of([s]).poses(np.full(len(time), v), time)


def _distinct(poses: Floats, apart: float) -> Ints:
    """Indices of poses about so many metres (or radians) of way apart; the first and the last too."""
    step = np.abs(np.diff(poses, axis=0)).sum(axis=1)
    part = np.floor(np.concatenate([[0.0], np.cumsum(step)]) / apart)
    kept = np.concatenate([[True], np.diff(part) > 0.0])
    kept[-1] = True
    return np.flatnonzero(kept)


def _lead(
    a: Floats, b: Floats, times: list[Floats], hits: tuple[Ints, Ints], length: float
) -> int:
    """Who leads where the two share a path in the same direction for more than three vehicle lengths; 0 if they do not."""
    i, j = hits
    same = np.cos(a[i, 2] - b[j, 2]) > np.cos(ALIKE)
    i, j = i[same], j[same]
    if not len(i):
        return 0
    nearest = np.lexsort((np.hypot(*(a[i, :2] - b[j, :2]).T), i))
    first = np.unique(i[nearest], return_index=True)[1]
    i, j = i[nearest][first], j[nearest][first]
    way = np.concatenate([[0.0], np.hypot(*np.diff(a[:, :2], axis=0).T)])[i]
    if way.sum() < FOLLOWING * length:
        return 0
    return int(np.sign((way * np.sign(times[1][j] - times[0][i])).sum()))


def _waits(encounter: Encounter) -> list[tuple[int, int]]:
    """How often each vehicle of the template stands while it waits, and waits: smoothed over 0.5 s below 0.5 m/s for 1 s or more.

    Pedestrians wait below 0.2 m/s.

    It stands if between the first and the last sample of at most 0.1 m/s there is 1 s or more.
    """
    reach = round(0.25 / encounter.dt)
    counts = []
    for vehicle, row, (first, last) in zip(
        encounter.vehicles, encounter.speed, encounter.present, strict=True
    ):
        speed, least = row[first : last + 1], 0.2 if vehicle.type == "pedestrian" else 0.5
        padded = np.pad(speed, reach, mode="edge")
        smooth = np.convolve(padded, np.full(2 * reach + 1, 1.0 / (2 * reach + 1)), mode="valid")
        slow = np.concatenate([[0], (smooth < least).astype(np.int64), [0]])
        begin, end = np.flatnonzero(np.diff(slow) == 1), np.flatnonzero(np.diff(slow) == -1)
        long = [
            (a, b)
            for a, b in zip(begin, end, strict=True)
            if (b - 1 - a) * encounter.dt >= 1.0 - 1e-9
        ]
        still = [np.flatnonzero(speed[a:b] <= 0.1) for a, b in long]
        standing = sum(
            bool(len(k)) and float(k[-1] - k[0]) * encounter.dt >= 1.0 - 1e-9 for k in still
        )
        counts.append((standing, len(long)))
    return counts


def _stands(s: Scenario, v: int, limit: float) -> list[float]:
    """Lengths [s] of the stretches in which speed and displacement stay below `limit` [m/s]."""
    there = slice(s.present[v, 0], s.present[v, 1] + 1)
    time, speed = s.time[there], s.speed[v, there]
    way = np.hypot(*np.diff(s.position[v, there], axis=0).T) / np.diff(time)
    slow = (speed[1:] < limit) & (speed[:-1] < limit) & (way < limit)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], slow.astype(np.int64), [0]])))
    return [float(time[b] - time[a]) for a, b in edges.reshape(-1, 2).tolist()]


def batches(scenarios: Sequence[Scenario], size: int = 400) -> Iterator[Sequence[Scenario]]:
    """Split a set, so that memory stays small."""
    for k in range(0, len(scenarios), size):
        yield scenarios[k : k + size]


def recheck_published(count: int) -> tuple[Account, int]:
    """Re-check `count` published scenarios, every case with the same share of driven time; also how many cases there were."""
    planned = [case for case in cases() if isinstance(case, Prepared)]
    share = np.array(
        [1.0 / (case.encounter.duration * len(case.encounter.vehicles)) for case in planned]
    )
    account = Account()
    for case, wanted in zip(
        planned, np.ceil(count * share / share.sum()).astype(int).tolist(), strict=True
    ):
        recheck = Recheck(
            case.encounter,
            case.road,
            case.fit.requested,
            bool(case.segmentation.changepoints.size),
        )
        for batch in batches(case.sample(wanted).scenarios):
            recheck.check(batch, account)
        told = f"{case.name} on {case.road_name}: {wanted}, {account.scenarios} in all, {dict(account.found)}"
        print(told, file=sys.stderr, flush=True)
    return account, len(planned)

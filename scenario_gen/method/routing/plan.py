# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The planning stage: one route per vehicle through its fitted anchors."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
import itertools
from typing import Any

import numpy as np

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import RefusedError
from scenario_gen.method.routing.config import PLANNERS, PlanningConfig
from scenario_gen.method.routing.connections import candidates, direct
from scenario_gen.method.routing.distance import distances_to_line, farthest
from scenario_gen.method.routing.search.planner import (  # fmt: skip
    BlockedError,
    Budget,
    BudgetSpentError,
    NoWayError,
    plan_with_retry,
    Planner,
    Query,
)
from scenario_gen.method.routing.search.pose_planner import PlansPoses, PoseQuery, Wishes
from scenario_gen.method.routing.search.sweep import sweep_is_free
from scenario_gen.method.routing.smooth import (
    Curve,
    Guess,
    monotone_matching,
    smooth,
    squared_gaps,
    Targets,
)
from scenario_gen.method.routing.tight import off_road, too_tight
from scenario_gen.numerics import Bools, Floats, wrap_angle
from scenario_gen.numerics.plane import edge_lengths, edge_yaws
from scenario_gen.roads import (
    clearance_field,
    footprint_fits,
    ground_for,
    nearest_pose_with_room,
    own_ground,
)
from scenario_gen.types import Fit, FittedVehicle, Road, Route, TypeLimits, Vehicle

STANDS = 0.05  # [m] a vehicle whose start and end are nearer than this has no path
CLOSE = 0.3  # [m] anchors nearer to each other than this are one waypoint
SHORTEST = 0.1  # [m] what a moving primitive covers at least, else it is a dwell
DENSE = 0.05  # metres between places of a curve at which an anchor may lie,
MOST_DENSE = 20_000  # so many at most: each is compared with each anchor
SHARP = np.deg2rad(100.0)  # a waypoint farther off the heading than this lies behind
SOFT_WEIGHT = 0.1  # weight of an anchor that is no waypoint
FIRMNESS = (
    (1.0, 12),
    (10.0, 12),
    (100.0, 12),
    (1000.0, 24),
)  # by which a guess is held, ever more firmly, and rounds for each
OWN_HOLD, DIRECT_HOLD, PATH_HOLD = 1.0, 0.3, 0.1
ON_PATH = 0.05  # [m] an anchor nearer to the fitted path than this is on it
GUIDE_STRIDE = 10  # poses of a guide that are left out between two
AGAINST = 3.0  # times as dear as the other way it is to leave a leg's direct line towards oncoming traffic
HALF_LANE = 1.75  # [m] that far towards it is one's own side
LACK = 1.0  # price of a metre without the room wished for, beside the metre itself
ROOMY = 0.05  # [m] more on every side than a footprint needs
TIGHTEST = (
    0.97,
    0.9,
    0.8,
)  # shares of the largest curvature that a search may use, one after another: smoothing needs some
OWN_SHARE = 0.1  # of the iterations, in which a way is looked for that stays on its own side: there is one at once, or none
EASE, FARTHEST = 0.15, 1.0  # [m] room around a waypoint that is eased, and how far it may be moved
PATIENCE = 20  # times the iterations in which a search goes on for a first path
SLACK = 1.5  # how much more curvature than allowed a waypoint may ask for before it is softened


@dataclass(frozen=True, eq=False)
class _Task:
    """One vehicle's share: everything that its route depends on."""

    road: Road
    vehicle: Vehicle
    fitted: FittedVehicle
    config: PlanningConfig
    planner: Planner
    seed: int
    max_curvature: float
    tightest: float = TIGHTEST[0]

    @property
    def anchors(self) -> Floats:
        """(A, 3) poses."""
        return self.fitted.anchors

    def name(self, k: int) -> str:
        """Anchor k in words."""
        last = len(self.anchors) - 1
        which = "start" if k == 0 else "end" if k == last else f"changepoint {k}"
        x, y = self.anchors[k, :2]
        return f"the {which} of vehicle {self.vehicle.id} (anchor {k}, at {x:.2f}, {y:.2f} m)"


def plan_routes(
    road: Road,
    fit: Fit,
    config: PlanningConfig = PlanningConfig(),
    seed: int = 0,
    limits: TypeLimits = TypeLimits(),
) -> tuple[Route, ...]:
    """Plan one route per vehicle through its anchors.

    Source: paper III-B, between consecutive changepoints.

    Start and end are met exactly, with their headings; interior anchors are strong but soft targets (see `deviations`).
    In drivable mode the footprint stays on the road along the whole route and the curvature within the limit.

    Args:
        road: the target road.
        fit: where every vehicle's anchors stand on it.
        config: see `PlanningConfig`.
        seed: same seed, same routes.
        limits: each type's, for the curvature.

    Returns:
        N routes, geometry only.

    Raises:
        RefusedError: a start or end is blocked, no route leads from anchor to anchor, the planner's budget is spent, or no
            drivable curve was found; the message names the vehicle and the anchor.
    """
    planner = make_planner(config)
    tasks = []
    for n, (vehicle, fitted) in enumerate(zip(fit.vehicles, fit.fitted, strict=True)):
        sharpest = limits.of(vehicle.type).planned.max_curvature
        tasks.append(
            _Task(
                ground_for(road, vehicle),
                vehicle,
                fitted,
                config,
                planner,
                seed + 7919 * n,
                sharpest,
            )
        )
    return tuple(_on_own_lanes(task) for task in tasks)


def _on_own_lanes(task: _Task) -> Route:
    """The route on the vehicle's own lanes, where lanes are known; on the whole road where none is on them (an obstacle)."""
    ground = own_ground(task.road, task.fitted.path, task.vehicle)
    if ground is not task.road:
        try:
            return _route(replace(task, road=ground))
        except RefusedError:
            pass
    try:
        return _route(task)
    except RefusedError as error:
        tight = too_tight(task.road, task.vehicle, task.fitted.path, task.max_curvature)
        raise RefusedError("; ".join(filter(None, (str(error), tight)))) from error


def deviations(route: Route, fitted: FittedVehicle) -> Floats:
    """How far [m] the route passes from each anchor: (K + 2,)."""
    return np.asarray(np.hypot(*(route.points[route.anchor, :2] - fitted.anchors[:, :2]).T))


def make_planner(config: PlanningConfig) -> Planner:
    """The geometric planner that `config` names."""
    make = PLANNERS[config.planner]
    with PLANNERS.running(config.planner):
        planner = make(config)
        if not (hasattr(planner, "plan") or hasattr(planner, "plan_poses")):
            raise TypeError(f"it returned {type(planner).__name__}, which has no method `plan`")
        return planner


def _found(task: _Task, find: Callable[[], Any], name: str, columns: int) -> Floats:
    """Return the path (P, columns) of this name in the plan that a planner finds; one of a plugin may return anything."""
    with PLANNERS.running(task.config.planner):
        path = np.asarray(getattr(find(), name), dtype=np.float64)
        if (
            path.ndim != 2
            or len(path) < 2
            or path.shape[1] < columns
            or not np.isfinite(path).all()
        ):
            raise ValueError(
                f"its path is no array of two or more finite rows of {columns} numbers"
            )
        return path


def _route(task: _Task) -> Route:
    anchors = task.anchors
    for k in (0, len(anchors) - 1):
        if not footprint_fits(
            task.road, anchors[k][None], task.vehicle.length, task.vehicle.width
        )[0]:
            raise RefusedError(
                f"{task.name(k)} is blocked: its footprint, {task.vehicle.length:.2f} m by {task.vehicle.width:.2f} m, "
                f"has no room there on road {task.road.name!r}"
            )
    if task.fitted.stands.all() or np.hypot(*(anchors[-1] - anchors[0])[:2]) < STANDS:
        return Route(
            anchors[:1], np.zeros(len(anchors), dtype=np.int64), np.zeros(1), joined=0, searched=0
        )
    waypoints = _waypoints(anchors, task.fitted.stands, task.max_curvature)
    if not task.config.drivable:
        return _polyline(task, waypoints)
    failed: RefusedError | None = None
    for share in TIGHTEST:
        try:
            smoothed = _smoothed(replace(task, tightest=share), waypoints)
        except RefusedError as error:  # none is found as gentle as that
            raise failed or error from None
        if isinstance(smoothed, Route):
            return smoothed
        failed = failed or smoothed.reason
        if not smoothed.searched:
            break
    assert failed is not None
    raise failed


@dataclass(frozen=True, eq=False)
class _Rough:
    """A way was found, and no drivable curve along it: why, and whether it was searched for (another search may find another)."""

    reason: RefusedError
    searched: bool


def _smoothed(task: _Task, waypoints: list[int]) -> Route | _Rough:
    """The route through waypoints (indices of anchors), or what stands against it."""
    anchors = task.anchors
    legs, waypoints, left_out = _legs(task, waypoints)
    weights = _weights(anchors, waypoints)
    targets = Targets(anchors[weights > 0.0, :2], weights[weights > 0.0])
    guess, searched = (
        _joined([leg.guess for leg in legs]),
        len([leg for leg in legs if leg.searched]),
    )
    curve: Curve | None = None
    for firmness, rounds in FIRMNESS:
        stop_if_cancelled()
        held = Guess(guess.points, guess.hold * firmness)
        curve = smooth(
            task.road,
            task.vehicle,
            (anchors[0], anchors[-1]),
            targets,
            held,
            task.config,
            task.max_curvature,
            rounds,
        )
        if curve.curvature <= task.max_curvature and not len(curve.off_road):
            route = _sampled(task, curve.poses, curve.length)
            far = farthest(route.points, task.fitted.path)
            return replace(
                route,
                joined=len(legs) - searched,
                searched=searched,
                left_out=left_out,
                farthest=far,
            )
    assert curve is not None
    return _Rough(RefusedError(_reason(task, curve)), searched > 0)


@dataclass(frozen=True, eq=False)
class _Leg:
    """The way between two waypoints, free for the footprint, and whether it had to be searched for."""

    guess: Guess
    searched: bool


def _legs(task: _Task, waypoints: list[int]) -> tuple[list[_Leg], list[int], tuple[int, ...]]:
    """A leg between each two neighbouring waypoints, the waypoints, and those left out because no free way leads through them.

    A waypoint between that cannot be passed as it stands (one at the road's edge that heads off it, say) is eased first.

    Raises:
        RefusedError: there is no route from start to end.
    """
    kept, legs, eased = list(waypoints), list[_Leg](), set[int]()
    poses = task.anchors.copy()
    k = 0
    while k < len(kept) - 1:
        stop_if_cancelled()
        try:
            legs.append(_leg(task, kept[k], kept[k + 1], poses, last=len(kept) == 2))
            k += 1
            continue
        except RefusedError:
            if len(kept) == 2:
                raise
        ends = [w for w in (kept[k], kept[k + 1]) if w not in (kept[0], kept[-1])]
        failing = next((w for w in ends if w not in eased), None)
        if failing is None:
            failing = ends[-1]
            at = kept.index(failing)
            kept.remove(failing)
        else:
            at = kept.index(failing)
            eased.add(failing)
            poses[failing] = _eased(task, poses[kept[at - 1]], poses[failing], poses[kept[at + 1]])
        k = min(k, at - 1)  # what led to it is to be found anew
        del legs[k:]
    return legs, kept, tuple(w for w in waypoints if w not in kept)


def _eased(task: _Task, before: Floats, pose: Floats, after: Floats) -> Floats:
    """A pose (3,) near to `pose` that heads from the waypoint before to the one after it, with some room around it."""
    onward = (after - before)[:2]
    turned = np.array([pose[0], pose[1], np.arctan2(onward[1], onward[0])])
    length, width = task.vehicle.length + 2.0 * EASE, task.vehicle.width + 2.0 * EASE
    roomy = nearest_pose_with_room(task.road, turned, length, width, FARTHEST)
    return pose if roomy is None else roomy[0]


def _waypoints(anchors: Floats, stands: Bools, limit: float) -> list[int]:
    """The anchors that the first guess goes through: start, end, and those between that can be driven in their order."""
    kept = [0]
    last = len(anchors) - 1
    for k in range(1, last):
        if not stands[k - 1] and _leads(anchors[kept[-1]], anchors[k], limit):
            kept.append(k)
    while len(kept) > 1 and not _leads(anchors[kept[-1]], anchors[last], limit):
        kept.pop()
    return [*kept, last]


def _leads(start: Floats, end: Floats, limit: float) -> bool:
    """Whether `end` lies ahead of `start`, both seen from their headings, without a turn much sharper than `limit`."""
    dx, dy = (end - start)[:2]
    chord = float(np.hypot(dx, dy))
    if chord < CLOSE:
        return False
    for yaw in (start[2], end[2]):
        off = abs(float((np.arctan2(dy, dx) - yaw + np.pi) % (2.0 * np.pi) - np.pi))
        if off > SHARP or 2.0 * np.sin(min(off, 0.5 * np.pi)) / chord > SLACK * limit:
            return False
    return True


def _weights(anchors: Floats, waypoints: list[int]) -> Floats:
    """How strongly each anchor (A,) draws the route: waypoints fully, others weakly if they lie between their neighbours."""
    weight = np.zeros(len(anchors))
    weight[waypoints[1:-1]] = 1.0
    for a, b in itertools.pairwise(waypoints):
        chord = (anchors[b] - anchors[a])[:2]
        for k in range(a + 1, b):
            from_a, to_b = (anchors[k] - anchors[a])[:2], (anchors[b] - anchors[k])[:2]
            between = from_a @ chord > 0.0 and to_b @ chord > 0.0
            if between and min(np.hypot(*from_a), np.hypot(*to_b)) > CLOSE:
                weight[k] = SOFT_WEIGHT
    return weight


def _leg(task: _Task, a: int, b: int, poses: Floats, *, last: bool) -> _Leg:
    """The way from anchor a to anchor b, at `poses` (A, 3): a direct curve, else one that is searched for; `last`: patiently."""
    start, end = poses[a], poses[b]
    own = _fitted_piece(task, start, end)
    if own is not None:
        return _Leg(Guess(own[:, :2], np.full(len(own), OWN_HOLD)), searched=False)
    curve = direct(task.road, task.vehicle, start, end, task.max_curvature)
    if curve is not None:
        return _Leg(Guess(curve[:, :2], np.full(len(curve), DIRECT_HOLD)), searched=False)
    if isinstance(task.planner, PlansPoses):
        points = _searched_poses(
            task, task.planner, (a, b), (start, end), PATIENCE if last else 1
        )[:, :2]
    else:
        points = _searched(task, a, b)
    return _Leg(Guess(points, np.full(len(points), PATH_HOLD)), searched=True)


def _fitted_piece(task: _Task, start: Floats, end: Floats) -> Floats | None:
    """Poses (P, 3) of the fitted path from pose to pose, if both are on it and it can be driven; None if not."""
    path = task.fitted.path
    if len(path) < 2:
        return None
    first, last = (int(np.argmin(np.hypot(*(path - pose)[:, :2].T))) for pose in (start, end))
    if last - first < 2:
        return None
    poses = np.vstack([start[None], path[first + 1 : last], end[None]])
    if max(distances_to_line(np.stack([start, end]), path)) > ON_PATH:
        return None
    step = edge_lengths(poses[:, :2])
    bend = np.abs(wrap_angle(np.diff(path[first : last + 1, 2]))) / edge_lengths(
        path[first : last + 1, :2]
    )
    if bend.max() > task.max_curvature or step.min() < 1e-6:
        return None
    free = sweep_is_free(task.road, poses, task.vehicle.length, task.vehicle.width)[:, 0] > 0.0
    return poses if free.all() else None


def _searched_poses(
    task: _Task,
    planner: PlansPoses,
    anchors: tuple[int, int],
    ends: tuple[Floats, Floats],
    patience: int,
) -> Floats:
    """A path (P, 3) between two anchors, whose poses (3,) are `ends`, for the vehicle itself.

    First with more room than the footprint, which the smoothing can use; then with the footprint alone.
    """
    (a, b), (start, end), config, vehicle = anchors, ends, task.config, task.vehicle
    guide = next(candidates(start, end, task.max_curvature))[::GUIDE_STRIDE]
    free = Wishes(
        config.margin, LACK, guide, *_sides(config, config.keep_side * AGAINST, config.keep_side)
    )
    most_left, most_right = _sides(config, HALF_LANE, np.inf)
    own = replace(free, about=_own_side(guide, config), most_left=most_left, most_right=most_right)
    own_iterations = max(int(OWN_SHARE * config.iterations), 1)
    attempts = [(free, ROOMY, config.iterations), (free, 0.0, config.iterations)]
    if config.keep_side > 0.0:
        attempts.insert(0, (own, ROOMY, own_iterations))
    where = f"between {task.name(a)} and {task.name(b)}"
    limit = task.tightest * task.max_curvature
    error: RefusedError | None = None
    for wishes, extra, iterations in attempts:
        query = PoseQuery(
            start, end, vehicle.length + 2.0 * extra, vehicle.width + 2.0 * extra, limit
        )
        try:
            try:
                search = partial(
                    planner.plan_poses, task.road, query, Budget(iterations), task.seed + a, wishes
                )
                return _found(task, search, "poses", 3)
            except BudgetSpentError:
                if extra or patience == 1:
                    raise
                budget = Budget(patience * config.iterations, first=True)
                return _found(
                    task,
                    partial(planner.plan_poses, task.road, query, budget, task.seed + a, wishes),
                    "poses",
                    3,
                )
        except NoWayError as reason:
            error = RefusedError(f"{where}: {reason}")
        except BudgetSpentError:
            error = RefusedError(
                f"no drivable route for vehicle {vehicle.id} on road {task.road.name!r} {where}: none with a curvature of at "
                f"most {limit:.3f} 1/m (limits.{vehicle.type}.max_curvature) was found in {patience * config.iterations} "
                f"iterations{off_road(task.road, vehicle, task.fitted.path)}"
            )
        except BlockedError as reason:  # of the larger footprint: the anchors themselves have room
            error = RefusedError(
                f"{task.name(a if reason.end == 'start' else b)} is blocked: {reason}"
            )
    assert error is not None
    raise error


def _sides(config: PlanningConfig, against: float, away: float) -> tuple[float, float]:
    """What holds left and right, of what holds towards oncoming traffic and away from it."""
    return (against, away) if config.traffic_side == "right" else (away, against)


def _own_side(guide: Floats, config: PlanningConfig) -> Floats:
    """Poses on a guide (G, 3), and some metres beside it, away from oncoming traffic."""
    sign = 1.0 if config.traffic_side == "right" else -1.0
    aside = sign * np.column_stack(
        (np.sin(guide[:, 2]), -np.cos(guide[:, 2]), np.zeros(len(guide)))
    )
    return np.concatenate([guide + metres * aside for metres in (0.0, 1.0, 2.0, 3.0)])


def _radius(task: _Task, start: Floats, end: Floats) -> float:
    """Half the width and the margin, or what room there is at the ends of the leg if that is less."""
    row, column, _ = task.road.cells(np.stack((start, end))[:, :2])
    room = float(clearance_field(task.road)[row, column].min()) - task.road.resolution
    return max(min(0.5 * task.vehicle.width + task.config.margin, room), 0.0)


def _searched(task: _Task, a: int, b: int) -> Floats:
    """The geometric planner's path (P, 2) from anchor a to anchor b, for a disc as wide as the vehicle."""
    start, end = task.anchors[a], task.anchors[b]
    query = Query(start[:2], end[:2], _radius(task, start, end))
    try:
        search = partial(
            plan_with_retry, task.planner, task.road, query, task.config.iterations, task.seed + a
        )
        return _found(task, search, "path", 2)
    except BlockedError as error:
        raise RefusedError(
            f"{task.name(a if error.end == 'start' else b)} is blocked: {error}"
        ) from error
    except RefusedError as error:
        raise RefusedError(f"between {task.name(a)} and {task.name(b)}: {error}") from error


def _joined(legs: list[Guess]) -> Guess:
    """Legs end to end."""
    points = [legs[0].points] + [leg.points[1:] for leg in legs[1:]]
    hold = [legs[0].hold] + [leg.hold[1:] for leg in legs[1:]]
    return Guess(np.concatenate(points), np.concatenate(hold))


def _sampled(task: _Task, poses_at: Callable[[Floats], Floats], total: float) -> Route:
    """A curve of length `total` at points at most `spacing` apart, one of them beside every anchor."""
    dense = np.linspace(0.0, total, min(int(np.ceil(total / DENSE)), MOST_DENSE) + 1)
    stops = _stops(task, dense, poses_at(dense))
    for k in range(1, len(stops)):  # what hardly moves is a dwell
        if stops[k] - stops[k - 1] < SHORTEST:
            stops[k] = stops[k - 1]
    stops[stops > total - SHORTEST] = total
    places, anchor = [np.zeros(1)], [0]
    for before, after in itertools.pairwise(stops):
        pieces = int(np.ceil((after - before) / task.config.spacing * 1.001))
        places.append(np.linspace(before, after, pieces + 1)[1:])
        anchor.append(anchor[-1] + pieces)
    length = np.concatenate(places)
    points = poses_at(length)
    points[0], points[-1] = task.anchors[0], task.anchors[-1]
    return Route(points, np.array(anchor), length)


def _stops(task: _Task, length: Floats, poses: Floats) -> Floats:
    """Arc length (A,) at which the curve passes each anchor, never going back; a dwell has one for both its ends.

    Args:
        task: the vehicle.
        length: (M,) arc lengths of a dense curve.
        poses: (M, 3) the curve there.
    """
    group = np.concatenate(([0], np.cumsum(~task.fitted.stands)))
    square = squared_gaps(task.anchors[:, :2], poses[:, :2])
    per_group = np.zeros((group[-1] + 1, len(poses)))
    np.add.at(per_group, group, square)
    per_group[0, 1:] = np.inf
    per_group[-1, :-1] = np.inf
    nearest = monotone_matching(per_group)
    offset = task.anchors[:, :2] - poses[nearest[group], :2]
    yaw = poses[nearest[group], 2]
    ahead = np.bincount(
        group, offset[:, 0] * np.cos(yaw) + offset[:, 1] * np.sin(yaw)
    ) / np.bincount(group)
    step = length[1] if len(length) > 1 else 0.0
    refined = length[nearest] + np.clip(ahead, -step, step)  # between the dense points
    refined[0], refined[-1] = 0.0, length[-1]
    return np.maximum.accumulate(np.clip(refined, 0.0, length[-1]))[group]


def _polyline(task: _Task, waypoints: list[int]) -> Route:
    """The planner's bare path through the waypoints: shortest, with corners; only its ends have the requested headings."""
    legs = [_searched(task, a, b) for a, b in itertools.pairwise(waypoints)]
    path = np.concatenate([legs[0]] + [leg[1:] for leg in legs[1:]])
    at = np.concatenate(([0.0], np.cumsum(edge_lengths(path))))
    yaw = np.unwrap(edge_yaws(path))

    def poses_at(length: Floats) -> Floats:
        which = np.clip(np.searchsorted(at, length, side="right") - 1, 0, len(yaw) - 1)
        return np.column_stack(
            (np.interp(length, at, path[:, 0]), np.interp(length, at, path[:, 1]), yaw[which])
        )

    return _sampled(task, poses_at, float(at[-1]))


def _reason(task: _Task, curve: Curve) -> str:
    """Why a curve cannot be driven, and next to which anchor."""
    reasons = []
    where = curve.sharpest
    if curve.curvature > task.max_curvature:
        reasons.append(
            f"its curvature reaches {curve.curvature:.3f} 1/m at ({where[0]:.2f}, {where[1]:.2f}) m, "
            f"the limit is {task.max_curvature:.3f} (9/10 of limits.{task.vehicle.type}.max_curvature)"
        )
    if len(curve.off_road):
        where = curve.off_road[len(curve.off_road) // 2, :2]
        reasons.append(f"its footprint leaves the road at ({where[0]:.2f}, {where[1]:.2f}) m")
    nearest = task.name(int(np.argmin(np.hypot(*(task.anchors[:, :2] - where).T))))
    return (
        f"no drivable route for vehicle {task.vehicle.id} on road {task.road.name!r} near {nearest}: "
        + "; ".join(reasons)
    )

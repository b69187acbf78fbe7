# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The first guess of a route: waypoints, joined by smooth direct curves, else by a search."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
import itertools
import math

import numpy as np

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import RefusedError
from scenario_gen.method.routing.config import PLANNERS, PlanningConfig
from scenario_gen.method.routing.search.dubins import arc_poses, dubins_poses
from scenario_gen.method.routing.search.planner import (
    BlockedError,
    Budget,
    BudgetSpentError,
    NoWayError,
    Plan,
    PoseQuery,
    Preferences,
)
from scenario_gen.method.routing.search.sweep import sweep_is_free
from scenario_gen.method.routing.smooth import Guess
from scenario_gen.method.routing.task import distances_to_line, off_road, VehicleTask
from scenario_gen.numerics import (
    ahead_and_left,
    angle_between,
    Bools,
    edge_lengths,
    Floats,
    unit,
    unit_left,
    wrap_angle,
)
from scenario_gen.roads import nearest_pose_with_room
from scenario_gen.types import Road, Vehicle

MIN_CHORD_M = 0.3  # between two waypoints
MAX_TURN_RAD = np.deg2rad(100.0)  # a waypoint at a larger angle to the heading lies behind
CURVATURE_FACTOR = 1.5  # of the allowed curvature that a waypoint may demand before smoothing
OTHER_ANCHOR_WEIGHT = 0.1  # of an anchor that is no waypoint
EASED_ROOM_M = 0.15  # around the footprint at an eased waypoint
MAX_EASED_MOVE_M = 1.0
FITTED_WEIGHT, DIRECT_WEIGHT, SEARCHED_WEIGHT = 1.0, 0.3, 0.1  # of a guess, by its source
ON_PATH_M = 0.05  # an anchor closer to the fitted path lies on it
SPACING_M = 0.2  # between two poses of a curve
MAX_RADIUS_M = 12.0  # of an arc: a wider one cuts a junction's corner
PARALLEL_RAD = np.radians(8.0)
GUIDE_STEPS = 10  # every tenth pose of the direct curve
ONCOMING_FACTOR = 3.0  # of the cost of leaving the direct curve, towards oncoming traffic
HALF_LANE_M = 1.75  # allowed towards oncoming traffic in the first attempt
FIRST_ATTEMPT_SHARE = 0.1  # of the iterations: on its own side a path is found soon or never
EXTRA_ROOM_M = 0.05  # on every side of the footprint, which the smoothing can use
LAST_ATTEMPT_FACTOR = 20  # more iterations for a first path where no waypoint can be dropped


def choose_waypoints(anchors: Floats, stands: Bools, limit: float) -> list[int]:
    """Return the anchors (A, 3) that the first guess goes through: those it can drive in order.

    Args:
        anchors: poses.
        stands: (A - 1,) whether the vehicle stands between two anchors.
        limit: curvature [1/m].
    """
    kept, last = [0], len(anchors) - 1
    for k in range(1, last):
        if not stands[k - 1] and _leads_to(anchors[kept[-1]], anchors[k], limit):
            kept.append(k)
    while len(kept) > 1 and not _leads_to(anchors[kept[-1]], anchors[last], limit):
        kept.pop()
    return [*kept, last]


def _leads_to(start: Floats, end: Floats, limit: float) -> bool:
    """Whether `end` lies ahead of `start`, by both headings, without too sharp a turn."""
    dx, dy = (end - start)[:2]
    chord = float(np.hypot(dx, dy))
    if chord < MIN_CHORD_M:
        return False
    direction = float(np.arctan2(dy, dx))
    turn = max(abs(angle_between(direction, yaw)) for yaw in (start[2], end[2]))
    curvature = 2.0 * np.sin(min(turn, 0.5 * np.pi)) / chord
    return turn <= MAX_TURN_RAD and bool(curvature <= CURVATURE_FACTOR * limit)


def anchor_weights(anchors: Floats, waypoints: list[int]) -> Floats:
    """Return how strongly each anchor (A,) attracts the route.

    Waypoints between the ends have weight 1, other anchors less, if they lie between their
    neighbouring waypoints.
    """
    weight = np.zeros(len(anchors))
    weight[waypoints[1:-1]] = 1.0
    for a, b in itertools.pairwise(waypoints):
        chord = (anchors[b] - anchors[a])[:2]
        from_a = (anchors[a + 1 : b] - anchors[a])[:, :2]
        to_b = (anchors[b] - anchors[a + 1 : b])[:, :2]
        is_between = (from_a @ chord > 0.0) & (to_b @ chord > 0.0)
        distance = np.minimum(np.hypot(*from_a.T), np.hypot(*to_b.T))
        weight[a + 1 : b][is_between & (distance > MIN_CHORD_M)] = OTHER_ANCHOR_WEIGHT
    return weight


def eased_pose(task: VehicleTask, before: Floats, pose: Floats, after: Floats) -> Floats:
    """Return a pose with room near `pose` that heads from the waypoint before to that after."""
    dx, dy = (after - before)[:2]
    turned = np.array([pose[0], pose[1], np.arctan2(dy, dx)])
    length = task.vehicle.length + 2.0 * EASED_ROOM_M
    width = task.vehicle.width + 2.0 * EASED_ROOM_M
    moved = nearest_pose_with_room(task.road, turned, length, width, MAX_EASED_MOVE_M)
    return pose if moved is None else moved[0]


@dataclass(frozen=True, eq=False)
class Leg:
    """A pair of anchors, their poses (3,), and the search between them.

    Attributes:
        first: index of the anchor at its start.
        second: index of the anchor at its end.
        start: pose at its start.
        end: pose at its end.
        curvature: largest one of the path [1/m].
        is_last_chance: whether no waypoint can be dropped if the search fails.
    """

    first: int
    second: int
    start: Floats
    end: Floats
    curvature: float
    is_last_chance: bool


@dataclass(frozen=True, eq=False)
class Legs:
    """All legs of a route.

    Attributes:
        guess: the legs, end to end.
        waypoints: indices of the anchors that they join.
        left_out: indices of the waypoints that no free path goes through.
        joined: number of legs that a direct curve joined.
        searched: number of legs that had to be searched for.
    """

    guess: Guess
    waypoints: list[int]
    left_out: tuple[int, ...]
    joined: int
    searched: int


def join_waypoints(task: VehicleTask, waypoints: list[int], curvature: float) -> Legs:
    """Join waypoints (indices of anchors) by legs within a curvature [1/m].

    A waypoint between the ends that cannot be passed as fitted (one at the road's edge that heads
    off it, say) is eased first, and left out if that does not help.

    Raises:
        RefusedError: there is no route from start to end.
    """
    kept, eased = list(waypoints), set[int]()
    guesses, is_searched = list[Guess](), list[bool]()
    poses = task.anchors.copy()
    while len(guesses) < len(kept) - 1:
        stop_if_cancelled()
        first, second = kept[len(guesses)], kept[len(guesses) + 1]
        leg = Leg(first, second, poses[first], poses[second], curvature, len(kept) == 2)
        try:
            direct = _direct_guess(task, leg)
            guesses.append(direct or Guess.even(search_path(task, leg), SEARCHED_WEIGHT))
            is_searched.append(direct is None)
        except RefusedError:
            inner = [w for w in (first, second) if w not in (kept[0], kept[-1])]
            if not inner:
                raise
            place = _ease_or_drop(task, kept, inner, eased, poses)
            del guesses[place - 1 :], is_searched[place - 1 :]  # legs to and from this waypoint
    searched = sum(is_searched)
    left_out = tuple(w for w in waypoints if w not in kept)
    return Legs(Guess.joined(guesses), kept, left_out, len(guesses) - searched, searched)


def _ease_or_drop(
    task: VehicleTask, kept: list[int], inner: list[int], eased: set[int], poses: Floats
) -> int:
    """Ease a waypoint of a leg that failed, or drop one if all are eased; return its place."""
    fresh = [w for w in inner if w not in eased]
    waypoint = fresh[0] if fresh else inner[-1]
    place = kept.index(waypoint)
    if fresh:
        eased.add(waypoint)
        before, after = poses[kept[place - 1]], poses[kept[place + 1]]
        poses[waypoint] = eased_pose(task, before, poses[waypoint], after)
    else:
        kept.remove(waypoint)
    return place


def _direct_guess(task: VehicleTask, leg: Leg) -> Guess | None:
    """Return the fitted path or else a direct curve, if one of them is free."""
    fitted = _fitted_piece(task, leg.start, leg.end)
    if fitted is not None:
        return Guess.even(fitted, FITTED_WEIGHT)
    curve = direct_curve(task.road, task.vehicle, leg.start, leg.end, task.max_curvature)
    return None if curve is None else Guess.even(curve, DIRECT_WEIGHT)


def _fitted_piece(task: VehicleTask, start: Floats, end: Floats) -> Floats | None:
    """Return the fitted path (P, 3) from pose to pose if both lie on it and it is drivable."""
    path = task.fitted.path
    if len(path) < 2:
        return None
    first, last = (int(np.argmin(np.hypot(*(path - pose)[:, :2].T))) for pose in (start, end))
    if last - first < 2 or max(distances_to_line(np.stack([start, end]), path)) > ON_PATH_M:
        return None
    piece = path[first : last + 1]
    curvature = np.abs(wrap_angle(np.diff(piece[:, 2]))) / edge_lengths(piece[:, :2])
    poses = np.vstack([start, piece[1:-1], end])
    if curvature.max() > task.max_curvature or edge_lengths(poses[:, :2]).min() < 1e-6:
        return None
    free = sweep_is_free(task.road, poses, task.vehicle.length, task.vehicle.width)
    return poses if free.all() else None


def direct_curve(
    road: Road, vehicle: Vehicle, start: Floats, end: Floats, limit: float
) -> Floats | None:
    """Return the first free one of `connecting_curves`: poses (P, 3); None if there is none."""
    for poses in connecting_curves(start, end, limit):
        if sweep_is_free(road, poses, vehicle.length, vehicle.width).all():
            return poses
    return None


def connecting_curves(start: Floats, end: Floats, limit: float) -> Iterator[Floats]:
    """Yield curves from pose (3,) to pose [m, rad], gentlest first, within a curvature [1/m].

    Each has poses (P, 3) about 0.2 m apart. Cubic Hermite curves with tangents of several lengths;
    straight lines joined by an arc, from the widest to the tightest; the Dubins curve.
    """
    for ratio in (1.0, 1.3, 0.8, 1.6):  # of the tangents' length to the chord
        poses = hermite_curve(start, end, ratio, limit)
        if poses is not None:
            yield poses
    yield from _arc_curves(start, end, limit)
    yield dubins_poses(start, end, 1.0 / limit, SPACING_M)


def hermite_curve(start: Floats, end: Floats, ratio: float, limit: float) -> Floats | None:
    """Return a cubic Hermite curve as poses (P, 3); None if it has a cusp or exceeds the limit."""
    rise = (end - start)[:2]
    chord = float(np.hypot(*rise))
    t = np.linspace(0.0, 1.0, max(int(np.ceil(chord / SPACING_M)) + 1, 8))[:, None]
    a = ratio * chord * unit(start[2])
    b = ratio * chord * unit(end[2])
    points = start[:2] + rise * t**2 * (3 - 2 * t) + a * t * (1 - t) ** 2 + b * t**2 * (t - 1)
    first = 6.0 * rise * t * (1 - t) + a * (1 - t) * (1 - 3 * t) + b * t * (3 * t - 2)
    second = 6.0 * rise * (1 - 2 * t) + a * (6 * t - 4) + b * (6 * t - 2)
    speed = np.hypot(*first.T)
    if speed.min() < 0.1 * chord:
        return None
    curvature = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / speed**3
    if curvature.max() > limit:
        return None
    return np.column_stack((points, np.arctan2(first[:, 1], first[:, 0])))


def _arc_curves(start: Floats, end: Floats, limit: float) -> Iterator[Floats]:
    """Yield a straight line, an arc and a straight line, from the widest arc to the tightest."""
    turn = angle_between(end[2], start[2])
    if not PARALLEL_RAD < abs(turn) < np.pi - PARALLEL_RAD:
        return
    ahead, left = ahead_and_left((end - start)[:2], start[2])
    after = left / np.sin(turn)  # from where the lines meet to the end
    before = ahead - after * np.cos(turn)
    half_tangent = float(np.tan(0.5 * abs(turn)))
    tightest = 1.0 / limit
    widest = min(min(before, after) / half_tangent, MAX_RADIUS_M)
    if widest < tightest:
        return
    for radius in np.linspace(widest, tightest, max(math.ceil((widest - tightest) / 2.0), 1) + 1):
        tangent = radius * half_tangent
        arc = (math.copysign(1.0 / radius, turn), abs(turn) * radius)
        parts = [(0.0, before - tangent), arc, (0.0, after - tangent)]
        yield arc_poses(start, parts, SPACING_M)


def search_path(task: VehicleTask, leg: Leg) -> Floats:
    """Return a free path (P, 2) of a leg.

    Raises:
        RefusedError: there is none, or none was found; the message names the anchors.
    """
    failure: Exception | None = None
    for query, budget in _attempts(task, leg):
        plan = partial(task.planner.plan_poses, task.road, query, budget, task.seed + leg.first)
        try:
            return checked_path(task.config.planner, plan)[:, :2]
        except (BlockedError, NoWayError, BudgetSpentError) as error:
            failure = error
    raise _refusal(task, leg, failure)


def _attempts(task: VehicleTask, leg: Leg) -> Iterator[tuple[PoseQuery, Budget]]:
    """Yield the queries of a leg and their budgets, the most demanding query first.

    The first one stays on its side of the road; all but the last have extra room.
    """
    config, vehicle = task.config, task.vehicle
    guide = next(connecting_curves(leg.start, leg.end, task.max_curvature))[::GUIDE_STEPS]
    left, right = _left_and_right(config, ONCOMING_FACTOR * config.keep_side, config.keep_side)
    anywhere = Preferences(config.margin, guide=guide, left_cost=left, right_cost=right)
    exact = PoseQuery(leg.start, leg.end, vehicle.length, vehicle.width, leg.curvature, anywhere)
    length, width = vehicle.length + 2.0 * EXTRA_ROOM_M, vehicle.width + 2.0 * EXTRA_ROOM_M
    roomy = replace(exact, length=length, width=width)
    if config.keep_side > 0.0:
        max_left, max_right = _left_and_right(config, HALF_LANE_M, np.inf)
        samples = _poses_on_side(guide, config)
        on_side = replace(anywhere, samples=samples, max_left=max_left, max_right=max_right)
        iterations = max(int(FIRST_ATTEMPT_SHARE * config.iterations), 1)
        yield replace(roomy, preferences=on_side), Budget(iterations)
    yield roomy, Budget(config.iterations)
    yield exact, Budget(config.iterations)
    if leg.is_last_chance:
        yield exact, Budget(LAST_ATTEMPT_FACTOR * config.iterations, first=True)


def _left_and_right(config: PlanningConfig, oncoming: float, other: float) -> tuple[float, float]:
    """Return the values for the left and the right side, given those towards oncoming traffic."""
    return (oncoming, other) if config.traffic_side == "right" else (other, oncoming)


def _poses_on_side(guide: Floats, config: PlanningConfig) -> Floats:
    """Return poses on a guide (G, 3), and 1 to 3 m to its side, away from oncoming traffic."""
    sign = -1.0 if config.traffic_side == "right" else 1.0
    away = np.column_stack((sign * unit_left(guide[:, 2]), np.zeros(len(guide))))
    return np.concatenate([guide + metres * away for metres in range(4)])


def checked_path(planner: str, plan: Callable[[], Plan]) -> Floats:
    """Return the path (P, 3) of a planner's plan; that of a plugin may return anything."""
    with PLANNERS.running(planner):
        path = np.asarray(plan().path, dtype=np.float64)
        if path.ndim != 2 or len(path) < 2 or path.shape[1] < 3:
            raise ValueError("its path is no array of two or more rows of 3 numbers")
        if not np.isfinite(path).all():
            raise ValueError("its path is not finite")
        return path


def _between(task: VehicleTask, leg: Leg) -> str:
    return f"between {task.anchor_name(leg.first)} and {task.anchor_name(leg.second)}"


def _refusal(task: VehicleTask, leg: Leg, error: Exception | None) -> RefusedError:
    """Return the error for the user, who knows vehicles and anchors."""
    if isinstance(error, BlockedError):
        k = leg.first if error.end == "start" else leg.second
        return RefusedError(f"{task.anchor_name(k)} is blocked: {error}")
    if isinstance(error, NoWayError):
        return RefusedError(f"{_between(task, leg)}: {error}")
    vehicle = task.vehicle
    factor = LAST_ATTEMPT_FACTOR if leg.is_last_chance else 1
    return RefusedError(
        f"no drivable route for vehicle {vehicle.id} on road {task.road.name!r} "
        f"{_between(task, leg)}: none with a curvature of at most {leg.curvature:.3f} 1/m "
        f"(limits.{vehicle.type}.max_curvature) was found in {factor * task.config.iterations} "
        f"iterations{off_road(task)}"
    )

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Waypoints of a route, and the legs between them."""

from dataclasses import dataclass
import itertools

import numpy as np

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import RefusedError
from scenario_gen.method.routing.connecting_curves import direct_curve
from scenario_gen.method.routing.leg_search import Leg, search_path
from scenario_gen.method.routing.route_points import distances_to_line
from scenario_gen.method.routing.search.sweep import sweep_is_free
from scenario_gen.method.routing.smooth import Guess
from scenario_gen.method.routing.task import VehicleTask
from scenario_gen.numerics import Bools, Floats, wrap_angle
from scenario_gen.numerics.plane import angle_between, edge_lengths
from scenario_gen.roads import nearest_pose_with_room

MIN_CHORD_M = 0.3  # between two waypoints
MAX_TURN_RAD = np.deg2rad(100.0)  # a waypoint at a larger angle to the heading lies behind
CURVATURE_FACTOR = 1.5  # of the allowed curvature that a waypoint may demand before smoothing
OTHER_ANCHOR_WEIGHT = 0.1  # of an anchor that is no waypoint
EASED_ROOM_M = 0.15  # around the footprint at an eased waypoint
MAX_EASED_MOVE_M = 1.0


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


FITTED_WEIGHT, DIRECT_WEIGHT, SEARCHED_WEIGHT = 1.0, 0.3, 0.1  # of a guess, by its source
ON_PATH_M = 0.05  # an anchor closer to the fitted path lies on it


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
    free = sweep_is_free(task.road, poses, task.vehicle.length, task.vehicle.width)[:, 0] > 0.0
    return poses if free.all() else None

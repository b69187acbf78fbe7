# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Lateral deviations from the route: the square root of their covariance, and the road's room."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.integrate import cumulative_trapezoid

from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.gp import Features, Observations, principal, Regression
from scenario_gen.method.sampling.path import BasePath
from scenario_gen.numerics import Floats, place, unit, unit_left
from scenario_gen.roads import along_lanes
from scenario_gen.types import Road, Vehicle

ROOM_SIGMAS = 2.0  # standard deviations of a deviation that still leaves the footprint on the road
MAX_ROOM_SIGMAS = 5.0  # more room makes no difference
_GAUSSIAN_MEDIAN_RATIO = 1.4826  # standard deviation over the median of absolute values
_ROUNDING_M = 1e-9


@dataclass(frozen=True)
class _Lateral:
    """Choices for deviations from the route, and for the search for room.

    Attributes:
        length_share: longest length scale over the route's length: between given ends a slower
            process hardly varies.
        min_length: m, of the length scale: drivers do not wander within less.
        min_route: m; a shorter route is driven as planned.
        bend_share: of the room, from which a deviation is bent back.
        flank_step, room_step: m between points of a flank, and between tried offsets.
        clearance: m to either side of a vehicle that drives straight on.
        smoothing: m along the route, for each of two passes.
    """

    length_share: float = 0.25
    min_length: float = 15.0
    min_route: float = 3.0
    bend_share: float = 0.6
    flank_step: float = 0.5
    room_step: float = 0.1
    clearance: float = 0.3
    smoothing: float = 4.0


_LATERAL = _Lateral()


@dataclass(frozen=True)
class _Corrections:
    """What counts as a correction of a driver.

    Attributes:
        averaging: s, for each of two passes: slower motion is the driver's course.
        slow_speed: m/s below which corrections depend on the distance rather than on time.
        moving_speed: m/s from which a heading shows corrections.
        min_length, max_length: s, of their length scale.
        max_lengths: in a drive, so that long drives cost no more than their length.
        max_sigma: m, of their standard deviation.
        min_sigma: m; smaller corrections are not drawn.
    """

    averaging: float = 1.5
    slow_speed: float = 3.0
    moving_speed: float = 0.5
    min_length: float = 0.5
    max_length: float = 2.0
    max_lengths: int = 200
    max_sigma: float = 0.1
    min_sigma: float = 1e-4


_CORRECTIONS = _Corrections()


@dataclass(frozen=True)
class Steering:
    """The small corrections of a driver: a squared-exponential process of the driving time.

    Attributes:
        sigma: its standard deviation [m].
        length: its length scale [s].
        driven: (T,) metres from the start.
        passed: (T,) seconds from the start; slow parts count as if they were driven at 3 m/s,
            where drivers steer by distance.
    """

    sigma: float
    length: float
    driven: Floats
    passed: Floats

    @classmethod
    def of(cls, time: Floats, yaw: Floats, speed: Floats, length: float) -> "Steering":
        """Return the corrections in a recorded drive: its heading minus a moving average.

        For a process with standard deviation a and length scale l the lateral speed has the
        standard deviation a / l, the lateral acceleration sqrt(3) a / l². Both follow from
        medians, for in turns a drive differs from its course by more than corrections.

        Args:
            time: (T,) seconds, evenly spaced.
            yaw: (T,) rad, unwrapped.
            speed: (T,) m/s.
            length: metres of the route; the drive is scaled to it.
        """
        dt = float(time[1] - time[0])
        limited = np.sqrt(np.square(speed) + np.square(_CORRECTIONS.slow_speed))
        driven = cumulative_trapezoid(speed, dx=dt, initial=0.0)
        passed = cumulative_trapezoid(speed / limited, dx=dt, initial=0.0)
        width = 2 * round(0.5 * _CORRECTIONS.averaging / dt) + 1
        moving = speed[width : len(yaw) - width] > _CORRECTIONS.moving_speed
        inside = np.flatnonzero(moving) + width
        if len(inside) < width:
            return cls(0.0, 1.0, driven, passed)

        course = yaw
        for _ in range(2):
            course = ndimage.uniform_filter1d(course, width, mode="nearest")
        deviation = yaw - course
        distance_rate = np.square(limited) / np.maximum(speed, _CORRECTIONS.moving_speed)
        lateral_speed = _robust_sigma((deviation * limited)[inside])
        acceleration = _robust_sigma((np.gradient(deviation, dt) * distance_rate)[inside])
        low = max(_CORRECTIONS.min_length, float(passed[-1]) / _CORRECTIONS.max_lengths)
        scale = float(np.sqrt(3.0)) * lateral_speed / max(acceleration, 1e-9)
        scale = max(min(scale, _CORRECTIONS.max_length), low)
        sigma = min(scale * lateral_speed, _CORRECTIONS.max_sigma)
        return cls(sigma, scale, driven * (length / max(driven[-1], 1e-9)), passed)

    def root(self, arc: Floats) -> Floats:
        """Return the square root (G, r) of the covariance at arc lengths (G,) [m].

        Value and slope are 0 at both ends.
        """
        if self.sigma < _CORRECTIONS.min_sigma:
            return np.zeros((len(arc), 0))
        ends = self.passed[[0, -1, 0, -1]]
        fixed = Observations(ends, np.zeros(4), np.zeros(4), (0, 0, 1, 1))
        features = Features(float(ends[0]), float(ends[1]), self.sigma, self.length)
        at = np.interp(arc, self.driven, self.passed)
        return Regression(features, fixed).predict(at).factor


def _robust_sigma(values: Floats) -> float:
    """Return the standard deviation of Gaussian values (n,) by their median."""
    return _GAUSSIAN_MEDIAN_RATIO * float(np.median(np.abs(values)))


def lateral_covariance_root(
    path: BasePath, room: Floats, config: SamplingConfig, steering: Steering
) -> Floats:
    """Return the square root (G, r) of the covariance of the deviation [m] at the nodes.

    Source: eqs 12 to 15, for the deviation as a function of arc length.

    Deviation and slope are 0 at both ends (the requested poses); at every interior anchor the
    deviation is 0 with noise σ_ω. Where the road leaves less than `ROOM_SIGMAS` σ_f of room, the
    process is scaled down to it.

    Args:
        path: the route.
        room: (G,) metres to either side, see `lateral_room`.
        config: σ_f, l, σ_ω.
        steering: the corrections of the template's driver, which are added.
    """
    nodes, sigma = len(path.node), config.lateral_sigma
    if sigma == 0.0 or path.length < _LATERAL.min_route:
        return np.zeros((nodes, 0))
    longest = max(_LATERAL.length_share * path.length, _LATERAL.min_length)
    inside = np.unique(path.anchor)
    inside = inside[(inside > 1.0) & (inside < path.length - 1.0)]
    x = np.concatenate([[0.0, path.length, 0.0, path.length], inside])
    noise = np.concatenate([np.zeros(4), np.full(len(inside), config.observation_sigma)])
    order = (0, 0, 1, 1) + (0,) * len(inside)
    features = Features(0.0, path.length, sigma, min(config.lateral_length, longest))
    regression = Regression(features, Observations(x, np.zeros(len(x)), noise, order))
    corrections = config.steering * steering.root(path.arc)
    factor = np.hstack([regression.predict(path.arc).factor, corrections])
    scale = np.minimum(room / (ROOM_SIGMAS * sigma), 1.0)
    return scale[:, None] * principal(factor)


def lateral_room(path: BasePath, vehicle: Vehicle, road: Road, most: float) -> Floats:
    """Return how far (G,) [m] the vehicle may leave its route to either side, at most `most`.

    Both flanks of the footprint are moved outwards step by step until a point of them leaves
    drivable space; the room ahead and behind, such as at the edge of the map, does not count.
    """
    points = int(np.ceil(vehicle.length / _LATERAL.flank_step)) + 1
    flank = np.linspace(-0.5, 0.5, points) * vehicle.length
    room, free = np.zeros(len(path.node)), np.ones(len(path.node), dtype=np.bool_)
    for step in np.arange(1, int(np.ceil(most / _LATERAL.room_step)) + 1) * _LATERAL.room_step:
        offset = 0.5 * vehicle.width + step
        for side in (offset, -offset):
            free &= road.drivable_at(place(path.node[:, None], flank, side)).all(axis=1)
        room[free] = min(step, most)
    reach = 0
    if not path.stands:
        reach = int(np.ceil(_LATERAL.smoothing / max(path.spacing, _ROUNDING_M)))
    smooth = ndimage.minimum_filter1d(room, 4 * reach + 1, mode="nearest")
    for _ in range(2):
        smooth = ndimage.uniform_filter1d(smooth, 2 * reach + 1, mode="nearest")
    return np.asarray(smooth)


def road_ahead(path: BasePath, vehicle: Vehicle, road: Road, most: Floats) -> Floats:
    """Return for how many metres (2,) the road is free straight on before and behind a route.

    Where the road has lanes, straight on must follow one of them, too: before a bend it would
    cross the lanes of others.

    Args:
        path: the route.
        vehicle: whose footprint needs room.
        road: with drivable space and lanes.
        most: (2,) metres, at most.
    """
    metres = np.zeros(2)
    if path.stands:
        return metres
    step = _LATERAL.flank_step
    half = 0.5 * vehicle.length
    side = np.array([-0.5, 0.0, 0.5]) * (vehicle.width + 2.0 * _LATERAL.clearance)
    for end, sign in ((0, -1.0), (-1, 1.0)):
        yaw = path.node[end, 2]
        distance = np.arange(step, most[end] + half + step, step)
        centre = path.node[end, :2] + sign * distance[:, None, None] * unit(yaw)
        points = centre + side[:, None] * unit_left(yaw)
        poses = np.column_stack((points.reshape(-1, 2), np.full(points[..., 0].size, yaw)))
        free = road.drivable_at(points).all(axis=1)
        free &= along_lanes(road, poses).reshape(len(points), -1).all(axis=1)
        clear = float(distance[-1]) if free.all() else step * int(np.argmin(free))
        metres[end] = min(max(clear - half - step, 0.0), most[end])
    return metres


def soft_clipped(deviation: Floats, room: Floats) -> Floats:
    """Return deviations (S, G) [m] that stay within the room (G,) [m] to either side.

    Up to `bend_share` of the room they are unchanged, beyond it they are bent back smoothly (C2).
    """
    start = _LATERAL.bend_share
    share = np.abs(deviation) / np.maximum(room, _ROUNDING_M)
    if (share <= start).all():
        return deviation
    bent = start + (1.0 - start) * np.tanh((share - start) / (1.0 - start))
    return np.asarray(np.where(share <= start, deviation, np.sign(deviation) * bent * room))

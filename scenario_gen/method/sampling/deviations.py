# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How far samples lie to the side of the route: the square root of the covariance."""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.gp import Features, Observations, principal, Regression
from scenario_gen.method.sampling.path import BasePath
from scenario_gen.numerics import Floats
from scenario_gen.roads import along_lanes
from scenario_gen.types import Road, Vehicle

LENGTH_SHARE = (
    0.25  # of the route, at most: what varies more slowly between given ends hardly varies
)
SHORTEST_LENGTH = (
    15.0  # m; drivers do not wander within less, so on a short route there is little to draw
)
SHORTEST_ROUTE = 3.0  # m; a shorter one is driven as planned
ROOM_SIGMAS = (
    2.0  # a deviation of so many standard deviations still leaves the footprint on the road
)
MAX_ROOM_SIGMAS = 5.0  # more room than so many standard deviations is not looked for
BEND_FROM_SHARE = 0.6  # share of the room from which on a deviation is bent back
_FLANK_STEP = 0.5  # m
_ROOM_STEP = 0.1  # m
_SIDE = 0.3  # m, to either side of who drives straight on
_SMOOTHING = 4.0  # m along the route, each of two passes
_COURSE = 1.5  # s, of each of two passes: what is slower is a driver's course, not a correction
_SLOW = 3.0  # m/s, below which corrections are made over a distance rather than a time
_MOVES = 0.5  # m/s, from which on a heading tells of them
_CORRECTIONS = 0.5, 2.0  # s, least and greatest length scale
_MOST_LENGTHS = 200  # of those in a drive, so that long ones cost no more than their length
_MOST_CORRECTION = 0.1  # m, standard deviation at most
_GAUSSIAN_MEDIAN = (
    1.4826  # standard deviation of a Gaussian over the median of its absolute values
)


@dataclass(frozen=True)
class Steering:
    """The small corrections of a driver: a squared-exponential process of the time that a stretch of road takes.

    Attributes:
        sigma: its standard deviation [m].
        length: its length scale [s].
        driven: (T,) metres from the start.
        passed: (T,) seconds there; slow stretches count as if they were driven at 3 m/s, for cars steer in
            distance there.
    """

    sigma: float
    length: float
    driven: Floats
    passed: Floats

    @classmethod
    def of(cls, time: Floats, yaw: Floats, speed: Floats, length: float) -> "Steering":
        """Those of a recorded drive: its heading less what it is over some seconds.

        Of a process with standard deviation a and length scale l the sideways speed varies by a / l, the sideways
        acceleration by sqrt(3) a / l². Both are taken of medians, for where a drive turns it differs from its course by more
        than by corrections.

        Args:
            time: (T,) seconds, evenly spaced.
            yaw: (T,) rad, unwrapped.
            speed: (T,) m/s.
            length: metres of the route; the drive is scaled to it.
        """
        dt = float(time[1] - time[0])
        at_least = np.sqrt(np.square(speed) + np.square(_SLOW))
        driven = np.concatenate([[0.0], np.cumsum(0.5 * dt * (speed[1:] + speed[:-1]))])
        share = 0.5 * dt * (speed[1:] / at_least[1:] + speed[:-1] / at_least[:-1])
        passed = np.concatenate([[0.0], np.cumsum(share)])
        width = 2 * round(0.5 * _COURSE / dt) + 1
        course = yaw
        for _ in range(2):
            course = ndimage.uniform_filter1d(course, width, mode="nearest")
        inside = np.flatnonzero(speed[width : len(yaw) - width] > _MOVES) + width
        if len(inside) < width:
            return cls(0.0, 1.0, driven, passed)
        rest = yaw - course
        sideways = (
            rest * at_least,
            np.gradient(rest, dt) * np.square(at_least) / np.maximum(speed, _MOVES),
        )
        quick, curved = (
            _GAUSSIAN_MEDIAN * float(np.median(np.abs(values[inside]))) for values in sideways
        )
        low, high = max(_CORRECTIONS[0], float(passed[-1]) / _MOST_LENGTHS), _CORRECTIONS[1]
        scale = max(min(float(np.sqrt(3.0)) * quick / max(curved, 1e-9), high), low)
        return cls(
            min(scale * quick, _MOST_CORRECTION),
            scale,
            driven * (length / max(driven[-1], 1e-9)),
            passed,
        )

    def root(self, arc: Floats) -> Floats:
        """Square root (G, r) of the covariance at arc lengths (G,) [m], with value and slope 0 at both ends."""
        if self.sigma < 1e-4:
            return np.zeros((len(arc), 0))
        ends = self.passed[[0, -1, 0, -1]]
        tied = Observations(ends, np.zeros(4), np.zeros(4), (0, 0, 1, 1))
        features = Features(float(ends[0]), float(ends[1]), self.sigma, self.length)
        return Regression(features, tied).predict(np.interp(arc, self.driven, self.passed)).factor


def lateral_covariance_root(
    path: BasePath, room: Floats, config: SamplingConfig, steering: Steering
) -> Floats:
    """Square root (G, r) of the covariance of the deviation [m] at the route's nodes.

    Source: eqs 12 to 15, of the deviation as a function of arc length.

    Given are deviation and slope 0 at both ends (the asked poses), and 0 with noise σ_ω at every interior anchor.
    Where the road leaves less than `ROOM_SIGMAS`·σ_f of room the process is scaled down to it.

    Args:
        path: the route.
        room: (G,) metres to either side, see `lateral_room`.
        config: σ_f, l, σ_ω.
        steering: what is added to it, of the template's driver.
    """
    nodes, sigma = len(path.node), config.lateral_sigma
    if sigma == 0.0 or path.length < SHORTEST_ROUTE:
        return np.zeros((nodes, 0))
    length = min(config.lateral_length, max(LENGTH_SHARE * path.length, SHORTEST_LENGTH))
    inside = np.unique(path.anchor)
    inside = inside[(inside > 1.0) & (inside < path.length - 1.0)]
    ends = np.array([0.0, path.length])
    x = np.concatenate([ends, ends, inside])
    noise = np.concatenate([np.zeros(4), np.full(len(inside), config.observation_sigma)])
    seen = Observations(x, np.zeros(len(x)), noise, (0, 0, 1, 1, *(0 for _ in inside)))
    factor = Regression(Features(0.0, path.length, sigma, length), seen).predict(path.arc).factor
    factor = np.hstack([factor, config.steering * steering.root(path.arc)])
    return np.minimum(room / (ROOM_SIGMAS * sigma), 1.0)[:, None] * principal(factor, 1e-6 * sigma)


def lateral_room(path: BasePath, vehicle: Vehicle, road: Road, most: float) -> Floats:
    """Metres (G,), at most `most`, by which the vehicle may leave its route to either side, smooth along the route.

    Both flanks of the footprint are moved outwards step by step until a point of them leaves drivable space; what lies
    ahead and behind, such as the edge of the map where a vehicle enters, does not count.
    """
    flank = np.linspace(-0.5, 0.5, int(np.ceil(vehicle.length / _FLANK_STEP)) + 1) * vehicle.length
    ahead = np.stack([np.cos(path.node[:, 2]), np.sin(path.node[:, 2])], axis=-1)[:, None, :]
    left = np.stack([-ahead[..., 1], ahead[..., 0]], axis=-1)
    axis = path.node[:, None, :2] + flank[:, None] * ahead
    room, free = np.zeros(len(path.node)), np.ones(len(path.node), dtype=np.bool_)
    for step in np.arange(1, int(np.ceil(most / _ROOM_STEP)) + 1) * _ROOM_STEP:
        for side in (0.5 * vehicle.width + step, -0.5 * vehicle.width - step):
            free &= road.drivable_at(axis + side * left).all(axis=1)
        room[free] = min(step, most)
    reach = int(np.ceil(_SMOOTHING / max(path.spacing, 1e-9))) if len(room) > 1 else 0
    smooth = ndimage.minimum_filter1d(room, 4 * reach + 1, mode="nearest")
    for _ in range(2):
        smooth = ndimage.uniform_filter1d(smooth, 2 * reach + 1, mode="nearest")
    return np.asarray(smooth)


def road_ahead(path: BasePath, vehicle: Vehicle, road: Road, most: Floats) -> Floats:
    """Metres (2,), at most `most` (2,), for which the road is free straight on before the route and behind it.

    Where the road has lanes, straight on must be along one of them too: before a bend it leads across those of others.
    """
    metres = np.zeros(2)
    if len(path.node) == 1:
        return metres
    for end, sign in ((0, -1.0), (-1, 1.0)):
        x, y, yaw = path.node[end].tolist()
        ahead = np.array([float(np.cos(yaw)), float(np.sin(yaw))])
        step = np.arange(_FLANK_STEP, most[end] + 0.5 * vehicle.length + _FLANK_STEP, _FLANK_STEP)
        side = np.array([-0.5, 0.0, 0.5]) * (vehicle.width + 2.0 * _SIDE)
        points = (
            np.array([x, y])
            + sign * step[:, None, None] * ahead
            + side[:, None] * np.array([-ahead[1], ahead[0]])
        )
        free = road.drivable_at(points).all(axis=1)
        flat = points.reshape(-1, 2)
        free &= (
            along_lanes(road, np.column_stack((flat, np.full(len(flat), yaw))))
            .reshape(len(points), -1)
            .all(axis=1)
        )
        clear = float(step[-1]) if free.all() else _FLANK_STEP * int(np.argmin(free))
        metres[end] = min(max(clear - 0.5 * vehicle.length - _FLANK_STEP, 0.0), most[end])
    return metres


def soft_clipped(deviation: Floats, room: Floats) -> Floats:
    """Deviations (S, G) [m], unchanged up to `BEND_FROM_SHARE` of the room (G,), bent smoothly (C2) to stay inside it beyond."""
    share = np.abs(deviation) / np.maximum(room, 1e-9)
    if (share <= BEND_FROM_SHARE).all():
        return deviation
    bent = BEND_FROM_SHARE + (1.0 - BEND_FROM_SHARE) * np.tanh(
        (share - BEND_FROM_SHARE) / (1.0 - BEND_FROM_SHARE)
    )
    return np.asarray(
        np.where(share <= BEND_FROM_SHARE, deviation, np.sign(deviation) * bent * room)
    )

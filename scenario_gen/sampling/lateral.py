"""The lateral deviation of a vehicle from its route: a Gaussian process over arc length that leaves room for the road."""

import numpy as np
from scipy.ndimage import minimum_filter1d, uniform_filter1d

from scenario_gen.arrays import Floats
from scenario_gen.encounter import Vehicle
from scenario_gen.roads.clearance import clearance_field
from scenario_gen.roads.road import Road
from scenario_gen.sampling.config import SamplingConfig
from scenario_gen.sampling.gp import Features, Observations, Regression
from scenario_gen.sampling.path import BasePath

SHORTEST_ROUTE = 3.0  # m; a shorter one is driven as planned
ROOM_SIGMAS = 2.0  # a deviation of so many standard deviations still leaves the footprint on the road
SOFT = 0.6  # share of the room from which on a deviation is bent back
_OUTLINE_STEP = 0.4  # m
_SMOOTHING = 5.0  # m along the route


def lateral_factor(path: BasePath, room: Floats, config: SamplingConfig) -> Floats:
    """Square root (G, r) of the covariance of the deviation [m] at the route's nodes.

    Given are deviation and slope 0 at both ends (the asked poses), and 0 with noise σ_ω at every interior anchor.
    Where the road leaves less than `ROOM_SIGMAS`·σ_f of room the process is scaled down to it.

    Args:
        path: the route.
        room: (G,) metres to either side, see `lateral_room`.
        config: σ_f, l, σ_ω.
    """
    nodes, sigma = len(path.node), config.lateral_sigma
    if sigma == 0.0 or path.length < SHORTEST_ROUTE:
        return np.zeros((nodes, 0))
    inside = np.unique(path.anchor)
    inside = inside[(inside > 1.0) & (inside < path.length - 1.0)]
    ends = np.array([0.0, path.length])
    x = np.concatenate([ends, ends, inside])
    noise = np.concatenate([np.zeros(4), np.full(len(inside), config.observation_sigma)])
    seen = Observations(x, np.zeros(len(x)), noise, (0, 0, 1, 1, *(0 for _ in inside)))
    factor = Regression(Features(0.0, path.length, sigma, config.lateral_length), seen).predict(path.arc).factor
    u, s, _ = np.linalg.svd(factor, full_matrices=False)
    keep = s > 1e-6 * sigma
    return np.asarray(np.minimum(room / (ROOM_SIGMAS * sigma), 1.0)[:, None] * u[:, keep] * s[keep])


def lateral_room(path: BasePath, vehicle: Vehicle, road: Road) -> Floats:
    """Metres (G,) by which the vehicle may leave its route to either side and stay on the road, smooth along the route.

    Every point of the footprint's outline may move as far as the nearest cell that is not drivable. Conservative: the
    field is that of the point's own cell, less what the point may be off its centre, and ahead is not told from aside.
    """
    x, y = 0.5 * vehicle.length, 0.5 * vehicle.width
    along, across = (np.linspace(-half, half, int(np.ceil(2.0 * half / _OUTLINE_STEP)) + 1) for half in (x, y))
    outline = [np.column_stack([along, np.full_like(along, side)]) for side in (-y, y)]
    outline += [np.column_stack([np.full_like(across, end), across]) for end in (-x, x)]
    ahead, left = np.concatenate(outline).T
    cos, sin = np.cos(path.node[:, 2, None]), np.sin(path.node[:, 2, None])
    points = np.stack(
        [path.node[:, 0, None] + ahead * cos - left * sin, path.node[:, 1, None] + ahead * sin + left * cos], axis=-1
    )
    field = clearance_field(road)
    cell = np.floor((points - road.origin) / road.resolution).astype(np.int64)
    row, column = np.clip(cell[..., 1], 0, field.shape[0] - 1), np.clip(cell[..., 0], 0, field.shape[1] - 1)
    inside = (row == cell[..., 1]) & (column == cell[..., 0])
    room = np.where(inside, field[row, column], 0.0).min(axis=1) - road.resolution / np.sqrt(2.0)
    reach = int(np.ceil(_SMOOTHING / max(path.spacing, 1e-9))) if len(room) > 1 else 0
    lowest = minimum_filter1d(np.maximum(room, 0.0), 2 * reach + 1, mode="nearest")
    return np.asarray(uniform_filter1d(lowest, 2 * reach + 1, mode="nearest"))


def kept_within(deviation: Floats, room: Floats) -> Floats:
    """Deviations (S, G) as they are up to `SOFT` of the room (G,), and bent smoothly (C2) to stay inside it beyond."""
    share = np.abs(deviation) / np.maximum(room, 1e-9)
    if (share <= SOFT).all():
        return deviation
    bent = SOFT + (1.0 - SOFT) * np.tanh((share - SOFT) / (1.0 - SOFT))
    return np.asarray(np.where(share <= SOFT, deviation, np.sign(deviation) * bent * room))

"""The lateral deviation of a vehicle from its route: a Gaussian process over arc length that leaves room for the road."""

import numpy as np
from scipy.ndimage import gaussian_filter1d, minimum_filter1d

from scenario_gen.arrays import Floats
from scenario_gen.encounter import Vehicle
from scenario_gen.roads.clearance import clearance_field
from scenario_gen.roads.road import Road
from scenario_gen.sampling.config import SamplingConfig
from scenario_gen.sampling.gp import Features, Observations, Regression
from scenario_gen.sampling.path import BasePath

SHORTEST_ROUTE = 3.0  # m; a shorter one is driven as planned
ROOM_SIGMAS = 2.5  # a deviation of so many standard deviations still leaves the footprint on the road


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

    Discs as wide as the vehicle cover it; each may move by its clearance less its radius. Conservative: the field is
    that of the nearest cell, and clearance ahead is not told from clearance aside.
    """
    half = 0.5 * vehicle.width
    reach = max(0.5 * vehicle.length - half, 0.0)
    offsets = np.linspace(-reach, reach, 2 * int(np.ceil(reach / half)) + 1)
    heading = np.stack([np.cos(path.node[:, 2]), np.sin(path.node[:, 2])], axis=-1)
    centre = path.node[:, None, :2] + offsets[:, None] * heading[:, None, :]
    field = clearance_field(road)
    cell = np.floor((centre - road.origin) / road.resolution).astype(np.int64)
    row, column = np.clip(cell[..., 1], 0, field.shape[0] - 1), np.clip(cell[..., 0], 0, field.shape[1] - 1)
    inside = (row == cell[..., 1]) & (column == cell[..., 0])
    room = np.maximum(np.where(inside, field[row, column], 0.0).min(axis=1) - half, 0.0)
    width = 5
    return np.asarray(
        gaussian_filter1d(minimum_filter1d(room, 2 * width + 1, mode="nearest"), width / 2.5, mode="nearest", truncate=2.5)
    )

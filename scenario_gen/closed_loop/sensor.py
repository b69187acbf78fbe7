# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The ego's observation of the other vehicles: noise, range and occlusion.

Lines of sight start at the ego's centre, in the plane. A vehicle is hidden if the lines to its
centre and to all its corners are blocked: by another vehicle, an obstacle, or the surroundings of
the road from `setback` beyond its edge.
"""

from dataclasses import replace
from functools import lru_cache
import math

import numpy as np

from scenario_gen.closed_loop.config import ObservationConfig
from scenario_gen.closed_loop.driver_traits import driver_draws
from scenario_gen.numerics import ahead_and_left, Bools, Floats, place
from scenario_gen.numerics.polygons import distance_field
from scenario_gen.roads import segments_free
from scenario_gen.types import Road, Scenario

SIGHT_POINTS = np.array([(0.0, 0.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)])
"""Points (5, 2) of a footprint, in its half length and half width."""


class Sensor:
    """Observes the other vehicles of one scenario; the same step has the same noise."""

    def __init__(
        self, config: ObservationConfig, scenario: Scenario, ego: int, road: Road | None
    ) -> None:
        """Prepare the observation of a scenario by its vehicle number `ego`."""
        self.config, self.ego = config, ego
        self._half = np.array([vehicle.half for vehicle in scenario.vehicles])
        draws = driver_draws(scenario, f"sensor {config.seed}")
        self._key = draws.integers(2**63, size=2)
        hides = config.occlusion and road is not None
        self._sight = _sight_ground(road, config.setback) if hides else None

    def measure(self, step: int, vehicles: Floats, present: Bools) -> tuple[Floats, Bools]:
        """Return the observed values of the vehicles, and which are observed.

        Args:
            step: number of the step, which determines the noise.
            vehicles: (N, 4) x, y [m], yaw [rad], speed [m/s].
            present: (N,) whether each vehicle is in the scene.
        """
        config = self.config
        values, observed = vehicles.copy(), present.copy()
        if config.range:
            offset = vehicles[:, :2] - vehicles[self.ego, :2]
            observed &= np.hypot(offset[:, 0], offset[:, 1]) <= config.range
        if config.occlusion:
            observed &= self._visible(vehicles, present)
        if config.position_noise or config.speed_noise:
            bits = np.random.Philox(key=self._key, counter=[0, step, 0, 0])
            noise = np.random.Generator(bits).standard_normal((len(values), 3))
            values[:, :2] += config.position_noise * noise[:, :2]
            values[:, 3] = np.maximum(values[:, 3] + config.speed_noise * noise[:, 2], 0.0)
        return values, observed

    def _visible(self, vehicles: Floats, present: Bools) -> Bools:
        """Return (N,) whether a line of sight reaches each vehicle."""
        reach = SIGHT_POINTS * self._half[:, None]
        points = place(vehicles[:, None, :3], reach[..., 0], reach[..., 1])
        eye = vehicles[self.ego, :2]
        others = np.arange(len(vehicles)) != self.ego
        crossed = _crosses(eye, points, vehicles, self._half)  # (N, 5, N)
        crossed &= present & others & ~np.eye(len(vehicles), dtype=np.bool_)[:, None]
        clear = ~np.any(crossed, axis=2)
        if self._sight is not None:
            ends = points.reshape(-1, 2)
            starts = np.broadcast_to(eye, ends.shape)
            clear &= segments_free(self._sight, starts, ends, 0.0).reshape(clear.shape)
        return np.asarray(np.any(clear, axis=1))


def _crosses(eye: Floats, points: Floats, vehicles: Floats, half: Floats) -> Bools:
    """Return (N, P, M) whether each line from the eye (2,) to points (N, P, 2) meets a footprint.

    Source: the slab method, Kay & Kajiya 1986.
    """
    yaw = vehicles[:, 2]
    start = np.stack(ahead_and_left(eye - vehicles[:, :2], yaw), axis=-1)  # (M, 2)
    offset = points[:, :, None] - vehicles[:, :2]  # (N, P, M, 2)
    end = np.stack(ahead_and_left(offset, yaw), axis=-1)
    along = end - start
    along = np.where(np.abs(along) < 1e-12, 1e-12, along)
    first, second = (-half - start) / along, (half - start) / along
    enters = np.minimum(first, second).max(axis=-1)
    leaves = np.maximum(first, second).min(axis=-1)
    return np.asarray((enters < leaves) & (leaves > 0.0) & (enters < 1.0))


@lru_cache(maxsize=4)
def _sight_ground(road: Road, setback: float) -> Road:
    """Return a road whose drivable cells do not block the sight."""
    rim = math.ceil(setback / road.resolution) + 1  # beyond it `distance_field` knows no cells
    depth = distance_field(np.pad(~road.drivable, rim, constant_values=True))
    clear = depth[rim:-rim, rim:-rim] * road.resolution <= setback
    if road.obstructed is not None:
        clear &= ~road.obstructed
    return replace(road, drivable=clear, obstructed=None, lanes=None)

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

"""The parametric roads: straight, T-intersection and four-way crossing, drawn as grids with one entry and exit per lane.

The main road runs along x, side arms along y (a T's only one to the south). The grid's lower-left corner is the origin.
"""

from dataclasses import dataclass, replace

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Bools, Floats
from scenario_gen.roads.config import refuse_too_many_cells, RoadConfig
from scenario_gen.roads.road import Road

_VERGE = 2.0  # metres of kerb drawn beside a road
_PAPER_LANE = 100.0  # cells
_ARMS = {
    "straight": ("west", "east"),
    "t_intersection": ("west", "east", "south"),
    "four_way": ("west", "east", "south", "north"),
}
_OUTWARD = {"west": np.pi, "east": 0.0, "south": -np.pi / 2.0, "north": np.pi / 2.0}

BUILT_IN = tuple(_ARMS)


@dataclass(frozen=True)
class Layout:
    """Sizes of a built-in road: metres from the centre to the ends of main and side arms, lanes per direction."""

    main: float
    side: float
    lanes: int


def draw(name: str, layout: Layout, config: RoadConfig) -> Road:
    """Draw a built-in road.

    Args:
        name: one of `BUILT_IN`.
        layout: its sizes.
        config: lane width, corner radius, resolution, traffic side.
    """
    arms = _ARMS[name]
    half = layout.lanes * config.lane_width
    reach = {arm: layout.main if arm in ("west", "east") else layout.side for arm in arms}
    verge = layout.side if config.paper else half + _VERGE
    cell = config.resolution
    low = -half - cell * np.ceil(
        (np.array([reach["west"], reach.get("south", verge)]) - half) / cell - 1e-6
    )  # kerbs on cell edges
    high = np.array([reach["east"], reach.get("north", verge)])
    cells = np.ceil((high - low) / cell - 1e-6).astype(np.int64)
    refuse_too_many_cells(name, int(cells[0]), int(cells[1]), config)
    x = low[0] + (np.arange(cells[0]) + 0.5) * cell
    y = low[1] + (np.arange(cells[1]) + 0.5) * cell
    drivable = np.repeat(np.abs(y)[:, None] < half, len(x), axis=1)
    for arm in arms:
        if arm in ("south", "north"):
            sign = -1.0 if arm == "south" else 1.0
            drivable |= (np.abs(x)[None, :] < half) & (sign * y[:, None] > 0.0)
            for side in (-1.0, 1.0):
                drivable |= _corner(side * x[None, :] - half, sign * y[:, None] - half, config.corner_radius)
    poses = [_lane_ends(arm, reach[arm], layout.lanes, config) for arm in arms]
    shift = np.array([-low[0], -low[1], 0.0])
    return Road(
        name=name,
        drivable=drivable,
        resolution=config.resolution,
        origin=np.zeros(2),
        entries=np.concatenate([entries for entries, _ in poses]) + shift,
        exits=np.concatenate([exits for _, exits in poses]) + shift,
    )


def _corner(u: Floats, v: Floats, radius: float) -> Bools:
    """Cells of the rounded corner between two kerbs, u and v metres beyond each of them."""
    inside = (u >= 0.0) & (v >= 0.0) & (u < radius) & (v < radius)
    return np.asarray(inside & (exact.hypot(u - radius, v - radius) > radius))


def _lane_ends(arm: str, reach: float, lanes: int, config: RoadConfig) -> tuple[Floats, Floats]:
    """Entries (lanes, 3) and exits (lanes, 3) of one arm, from the middle of the road outwards."""
    outward = _OUTWARD[arm]
    along = np.array([exact.cos(outward), exact.sin(outward)])
    right = np.array([along[1], -along[0]]) * (1.0 if config.traffic_side == "right" else -1.0)
    offsets = (np.arange(lanes) + 0.5)[:, None] * config.lane_width * right
    entries = np.column_stack((along * reach - offsets, np.full(lanes, outward + np.pi)))
    exits = np.column_stack((along * reach + offsets, np.full(lanes, outward)))
    return entries, exits


def draw_paper(name: str, config: RoadConfig) -> Road:
    """The paper's straight lane or T-intersection (IV-B): 1000 x 1000 cells, one wide lane per direction, lengths in cells."""
    cells = replace(config, lane_width=_PAPER_LANE, corner_radius=50.0, resolution=1.0)
    return draw(name, Layout(main=500.0, side=500.0, lanes=1), cells)

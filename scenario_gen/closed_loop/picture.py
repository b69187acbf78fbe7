# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A picture of one state of a drive: the road, the ego's route and all footprints, seen from above, the ego in the middle."""

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from scenario_gen.closed_loop.simulation import ClosedLoop, State
from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import corners

SIZE = 400  # pixels of each side
SCALE = 4.0  # pixels a metre
GROUND, ASPHALT, ROUTE = (225, 228, 222), (120, 124, 130), (250, 214, 90)
EGO, OTHER = (38, 92, 190), (200, 60, 48)


def picture(loop: ClosedLoop, state: State) -> npt.NDArray[np.uint8]:
    """Return the picture (400, 400, 3), red, green and blue from 0 to 255; x of the map to the right, y up, 100 m a side."""
    ego = state.ego
    centre = np.array((ego.x, ego.y))
    image = Image.fromarray(_ground(loop, centre))
    draw = ImageDraw.Draw(image)
    task = loop.task()
    if len(task.route) > 1:
        draw.line(_pixels(task.route[:, :2], centre), fill=ROUTE, width=2)
    found = loop.observe(state)
    for pose, size in zip(found.others, found.sizes, strict=True):
        draw.polygon(_pixels(corners(pose[None, :3], *size[:2].tolist())[0], centre), fill=OTHER)
    body = loop.scenario.vehicles[loop.ego]
    draw.polygon(_pixels(corners(np.array([(ego.x, ego.y, ego.yaw)]), body.length, body.width)[0], centre), fill=EGO)
    return np.asarray(image, dtype=np.uint8)


def _ground(loop: ClosedLoop, centre: Floats) -> npt.NDArray[np.uint8]:
    """Return the road (SIZE, SIZE, 3) around a place (2,) in metres."""
    pixels = np.empty((SIZE, SIZE, 3), dtype=np.uint8)
    pixels[:] = ASPHALT if loop.road is None else GROUND
    if loop.road is not None:
        across = (np.arange(SIZE) + 0.5 - 0.5 * SIZE) / SCALE
        column = np.floor((centre[0] + across - loop.road.origin[0]) / loop.road.resolution).astype(np.int64)
        row = np.floor((centre[1] - across - loop.road.origin[1]) / loop.road.resolution).astype(np.int64)
        height, width = loop.road.drivable.shape
        inside = ((row >= 0) & (row < height))[:, None] & ((column >= 0) & (column < width))[None, :]
        cells = loop.road.drivable[np.ix_(row.clip(0, height - 1), column.clip(0, width - 1))]
        pixels[inside & cells] = ASPHALT
    return pixels


def _pixels(points: Floats, centre: Floats) -> list[tuple[float, float]]:
    """Return points (n, 2) in metres as pixels."""
    away = (points - centre) * SCALE
    return [(0.5 * SIZE + x, 0.5 * SIZE - y) for x, y in away.tolist()]

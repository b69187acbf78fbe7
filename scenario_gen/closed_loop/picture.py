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
    centre = np.array(state.ego[:2])
    image = Image.fromarray(_ground(loop, centre))
    draw = ImageDraw.Draw(image)
    route = loop.task().route
    if len(route) > 1:
        draw.line(_pixels(route[:, :2], centre), fill=ROUTE, width=2)
    there = [k for k in np.flatnonzero(state.here).tolist() if k != loop.ego]
    for k in (*there, loop.ego):
        body = loop.scenario.vehicles[k]
        footprint = corners(state.vehicles[k : k + 1], body.length, body.width)[0]
        draw.polygon(_pixels(footprint, centre), fill=EGO if k == loop.ego else OTHER)
    return np.asarray(image, dtype=np.uint8)


def _ground(loop: ClosedLoop, centre: Floats) -> npt.NDArray[np.uint8]:
    """Return the road (SIZE, SIZE, 3) around a place (2,) in metres."""
    rows, columns = (np.indices((SIZE, SIZE)) + 0.5 - 0.5 * SIZE) / SCALE
    places = centre + np.stack([columns, -rows], axis=-1)
    asphalt = (
        np.ones((SIZE, SIZE), dtype=np.bool_)
        if loop.road is None
        else loop.road.drivable_at(places)
    )
    return np.where(asphalt[..., None], ASPHALT, GROUND).astype(np.uint8)


def _pixels(points: Floats, centre: Floats) -> list[tuple[float, float]]:
    """Return points (n, 2) in metres as pixels."""
    away = (points - centre) * SCALE
    return [(0.5 * SIZE + x, 0.5 * SIZE - y) for x, y in away.tolist()]

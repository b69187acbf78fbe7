# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A top view of one state of a drive: the road, the ego's route and all footprints."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from scenario_gen.closed_loop.simulation import ClosedLoop, State
from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import corners

SIZE_PX = 400
PX_PER_M = 4.0


@dataclass(frozen=True)
class Colours:
    """Red, green and blue from 0 to 255."""

    ground: tuple[int, int, int] = (225, 228, 222)
    asphalt: tuple[int, int, int] = (120, 124, 130)
    route: tuple[int, int, int] = (250, 214, 90)
    ego: tuple[int, int, int] = (38, 92, 190)
    other: tuple[int, int, int] = (200, 60, 48)


COLOURS = Colours()


def picture(loop: ClosedLoop, state: State) -> npt.NDArray[np.uint8]:
    """Return the picture (400, 400, 3) in red, green and blue from 0 to 255.

    It shows 100 m in each direction around the ego's centre; x of the map points to the right, y
    points up.
    """
    centre = np.array(state.ego[:2])
    image = Image.fromarray(_ground(loop, centre))
    draw = ImageDraw.Draw(image)
    route = loop.task().route
    if len(route) > 1:
        draw.line(_pixels(route[:, :2], centre), fill=COLOURS.route, width=2)
    others = [k for k in np.flatnonzero(state.present).tolist() if k != loop.ego]
    for k in (*others, loop.ego):
        body = loop.scenario.vehicles[k]
        footprint = corners(state.vehicles[k : k + 1], body.length, body.width)[0]
        fill = COLOURS.ego if k == loop.ego else COLOURS.other
        draw.polygon(_pixels(footprint, centre), fill=fill)
    return np.asarray(image, dtype=np.uint8)


def _ground(loop: ClosedLoop, centre: Floats) -> npt.NDArray[np.uint8]:
    """Return the road (SIZE_PX, SIZE_PX, 3) around a place (2,) [m]."""
    shape = (SIZE_PX, SIZE_PX)
    rows, columns = (np.indices(shape) + 0.5 - 0.5 * SIZE_PX) / PX_PER_M
    places = centre + np.stack([columns, -rows], axis=-1)
    road = loop.road
    asphalt = np.ones(shape, dtype=np.bool_) if road is None else road.drivable_at(places)
    return np.where(asphalt[..., None], COLOURS.asphalt, COLOURS.ground).astype(np.uint8)


def _pixels(points: Floats, centre: Floats) -> list[tuple[float, float]]:
    """Return points (n, 2) in metres as pixels."""
    offset = (points - centre) * PX_PER_M
    return [(0.5 * SIZE_PX + x, 0.5 * SIZE_PX - y) for x, y in offset.tolist()]

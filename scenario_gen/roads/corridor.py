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

"""A road drawn around the template's own paths: what their footprints sweep, and a margin."""

import numpy as np
from PIL import Image, ImageDraw

from scenario_gen import exact
from scenario_gen.arrays import Floats
from scenario_gen.roads.config import refuse_too_many_cells, RoadConfig
from scenario_gen.roads.road import Road
from scenario_gen.roads.tracks import Track

_STEP = 0.25  # metres between drawn footprints
_BORDER = 2.0  # metres of wall around the grid


def draw_corridor(tracks: tuple[Track, ...], config: RoadConfig) -> Road:
    """Draw the corridor of cleaned and separated tracks.

    Every moving vehicle's path is continued straight on at both ends by `corridor_run_out`; entries and exits stand there.
    A vehicle that stands throughout gets the room that its footprint and the margin need.
    """
    margin, run_out = config.corridor_margin, config.corridor_run_out
    outlines, entries, exits = [], [], []
    for track in tracks:
        reach = margin if track.still else run_out
        start, end = -reach, track.travelled + reach
        count = int(np.ceil((end - start) / _STEP)) + 1
        poses = track.curve.at(np.linspace(start, end, count))
        length, width = track.vehicle.length, track.vehicle.width + 2.0 * margin
        outlines.append(_corners(poses, length, width))
        if not track.still:
            entries.append(poses[0])
            exits.append(poses[-1])
    everything = np.concatenate([corners.reshape(-1, 2) for corners in outlines])
    low = np.floor(everything.min(axis=0) - _BORDER)
    size = np.ceil((everything.max(axis=0) + _BORDER - low) / config.resolution).astype(int)
    refuse_too_many_cells("corridor", int(size[0]), int(size[1]), config)
    image = Image.new("1", (int(size[0]), int(size[1])))
    brush = ImageDraw.Draw(image)
    for corners in outlines:
        for quad in (corners - low) / config.resolution - 0.5:  # PIL's integers are cell centres
            brush.polygon([(float(x), float(y)) for x, y in quad], fill=1)
    return Road(
        name="corridor",
        drivable=np.asarray(image, dtype=np.bool_),
        resolution=config.resolution,
        origin=low,
        entries=np.array(entries),
        exits=np.array(exits),
    )


def _corners(poses: Floats, length: float, width: float) -> Floats:
    """(M, 4, 2) corners of footprints at (M, 3) poses."""
    cos, sin = exact.cos(poses[:, 2])[:, None], exact.sin(poses[:, 2])[:, None]
    u = np.array([1.0, -1.0, -1.0, 1.0]) * length / 2.0
    v = np.array([1.0, 1.0, -1.0, -1.0]) * width / 2.0
    return np.stack((poses[:, :1] + u * cos - v * sin, poses[:, 1:2] + u * sin + v * cos), axis=-1)

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One size of the scaling benchmark in its own process, so that CPU and memory are its own.

`python -m benchmarks._scaling_case` takes `generate VEHICLES SECONDS COUNT` or `map LANES`, and
writes CPU seconds and the peak memory [MiB] as JSON.
"""

import json
import math
from pathlib import Path
import resource
import sys
import tempfile
from time import process_time

import numpy as np

from scenario_gen import pipeline
from scenario_gen.method.config import PipelineConfig
from scenario_gen.roads import build_road, RoadConfig
from scenario_gen.types import Encounter, Vehicle

ROAD, MAX_CELLS_COUNT = "four_way", 100_000_000
SPEED_MPS, GAP_M, HALF_LANE_M = 10.0, 14.0, 1.75
BLOCK_M = 29.0
"""Distance of two streets of a map: 10⁴ lanes are just below the 300 km that are searched."""


def group(vehicles: int, seconds: float) -> Encounter:
    """Return vehicles of two platoons that cross, the second one after the first."""
    steps = round(seconds / 0.1) + 1
    way = SPEED_MPS * 0.1 * np.arange(steps)
    position, heading = [], []
    for k in range(vehicles):
        behind = GAP_M * (k // 2)
        if k % 2 == 0:
            position.append(np.column_stack([way - 60.0 - behind, np.full(steps, -HALF_LANE_M)]))
        else:
            position.append(
                np.column_stack(
                    [np.full(steps, HALF_LANE_M), way - 72.0 - GAP_M * (vehicles // 2) - behind]
                )
            )
        heading.append(np.full(steps, np.pi / 2.0 * (k % 2)))
    names = tuple(Vehicle(str(k)) for k in range(vehicles))
    speed = np.full((vehicles, steps), SPEED_MPS)
    return Encounter.sampled(
        names,
        0.1,
        np.array(position),
        np.array(heading),
        speed,
        "group",
        1_600_000_000_000_000_000,
    )


def generate_seconds(vehicles: int, seconds: float, count: int) -> float:
    """Return CPU seconds of `generate`."""
    encounter, started = group(vehicles, seconds), process_time()
    config = PipelineConfig(road=RoadConfig(max_cells=MAX_CELLS_COUNT))
    pipeline.generate(encounter, ROAD, config, count=count, seed=1)
    return process_time() - started


def map_seconds(lanes: int) -> float:
    """Return CPU seconds of reading a map and of drawing the best place for an encounter."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "city.xml")
        path.write_text(city(lanes), encoding="utf-8")
        started = process_time()
        build_road(str(path), group(2, 20.0))
        return process_time() - started


def city(lanes: int) -> str:
    """Return a CommonRoad map of at least so many lanes: streets of a lane each way that cross, from crossing to crossing."""
    blocks = math.ceil(math.sqrt(lanes / 4.0))
    lanelets = []
    for k in range(4 * blocks * blocks):
        street, (block, way) = k // (4 * blocks), divmod(k % (4 * blocks), 4)
        along = np.array([block, block + 1.0]) * BLOCK_M
        middle, right = (
            np.column_stack([along, np.full(2, street * BLOCK_M - aside)])
            for aside in (0.0, 2.0 * HALF_LANE_M)
        )
        if way % 2:  # the other way, on the other side
            middle, right = middle[::-1], right[::-1] + np.array([0.0, 4.0 * HALF_LANE_M])
        if way >= 2:  # northwards or southwards: a quarter turn
            corner = (
                np.array([blocks - 0.5, -0.5]) * BLOCK_M
            )  # streets cross in the middle of their blocks
            middle, right = (points[:, ::-1] * [-1.0, 1.0] + corner for points in (middle, right))
        onward = block + (-1 if way % 2 else 1)
        after = (
            f'<successor ref="{k + 4 * (onward - block) + 1}"/>' if 0 <= onward < blocks else ""
        )
        borders = "".join(
            f"<{tag}>{''.join(f'<point><x>{x!r}</x><y>{y!r}</y></point>' for x, y in points.tolist())}</{tag}>"
            for tag, points in (("leftBound", middle), ("rightBound", right))
        )
        lanelets.append(
            f'<lanelet id="{k + 1}">{borders}{after}<laneletType>urban</laneletType></lanelet>'
        )
    return f'<?xml version="1.0"?><commonRoad timeStepSize="0.1" commonRoadVersion="2020a">{"".join(lanelets)}</commonRoad>'


def main() -> None:
    """Measure, after a small run that loads libraries and kernels."""
    kind, *words = sys.argv[1:]
    if kind == "generate":
        generate_seconds(2, 20.0, 2)
        seconds = generate_seconds(int(words[0]), float(words[1]), int(words[2]))
    else:
        map_seconds(400)
        seconds = map_seconds(int(words[0]))
    mebibytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(json.dumps({"seconds": seconds, "mebibytes": mebibytes}))


if __name__ == "__main__":
    main()

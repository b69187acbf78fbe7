# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One size of the scaling benchmark in a process of its own, so that CPU and memory are its own.

`python -m benchmarks._scaling_case` takes `generate VEHICLES SECONDS COUNT CELL`, `grid CELLS` or `map LANES`, and writes CPU
seconds and the peak's MiB as JSON.
"""

from collections.abc import Callable
import json
import math
from pathlib import Path
import resource
import sys
import tempfile
from time import process_time

import numpy as np
from shapely import box, union_all

from scenario_gen import pipeline
from scenario_gen.method.chain import Chain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.evaluation import EvaluationConfig
from scenario_gen.method.routing.search.car_planner import PoseRrtStarConnect
from scenario_gen.method.routing.search.planner import Budget, PoseQuery
from scenario_gen.roads import build_road, RoadConfig
from scenario_gen.types import Encounter, Vehicle

ROAD, MOST = "four_way", 100_000_000
SPEED, GAP, LANE = 10.0, 14.0, 1.75  # m/s, m, m
BLOCK = (
    29.0  # m between two streets of a map: 10⁴ lanes are just below the 300 km that are searched
)
HALF = 5.0  # m, half the width of the streets of a grid
STAGES = {
    "generation": (
        (pipeline, "road_and_template"),
        (pipeline, "segment"),
        (Chain, "plan"),
        (Chain, "sample"),
    ),
    "references": ((pipeline, "with_references"),),
    "evaluation": ((pipeline, "evaluate"), (pipeline, "coverage_of")),
}


def group(vehicles: int, seconds: float) -> Encounter:
    """Return vehicles of two platoons that cross, the second one after the first."""
    steps = round(seconds / 0.1) + 1
    way = SPEED * 0.1 * np.arange(steps)
    position, heading = [], []
    for k in range(vehicles):
        behind = GAP * (k // 2)
        if k % 2 == 0:
            position.append(np.column_stack([way - 60.0 - behind, np.full(steps, -LANE)]))
        else:
            position.append(
                np.column_stack(
                    [np.full(steps, LANE), way - 72.0 - GAP * (vehicles // 2) - behind]
                )
            )
        heading.append(np.full(steps, np.pi / 2.0 * (k % 2)))
    names = tuple(Vehicle(str(k)) for k in range(vehicles))
    speed = np.full((vehicles, steps), SPEED)
    return Encounter.sampled(
        names,
        0.1,
        np.array(position),
        np.array(heading),
        speed,
        "group",
        1_600_000_000_000_000_000,
    )


def generated(vehicles: int, seconds: float, count: int, cell: float) -> dict[str, float]:
    """CPU seconds of `generate` and, of these, of its stages."""
    encounter, begun = group(vehicles, seconds), process_time()
    road, compare = RoadConfig(resolution=cell, max_cells=MOST), EvaluationConfig(compare=True)
    pipeline.generate(
        encounter, ROAD, PipelineConfig(road=road, evaluation=compare), count=count, seed=1
    )
    return {"all": process_time() - begun}


def planned(cells: int) -> dict[str, float]:
    """CPU seconds of drawing a crossing of `cells` squared, of its distance field, and of the first path from arm to arm."""
    config, side = RoadConfig(max_cells=MOST), 0.2 * cells
    middle, far = 0.5 * side, 0.5 * side - 5.0
    street = union_all(
        [
            box(0.0, middle - HALF, side, middle + HALF),
            box(middle - HALF, 0.0, middle + HALF, side),
        ]
    )
    times = [process_time()]
    road = build_road(street, None, config)
    times.append(process_time())
    _ = road.clearance_cells
    times.append(process_time())
    start, goal = (
        np.array([middle - far, middle, 0.0]),
        np.array([middle, middle - far, -np.pi / 2.0]),
    )
    query = PoseQuery(start, goal, 4.5, 1.8, 0.2)
    PoseRrtStarConnect().plan_poses(road, query, Budget(1_000_000, first=True), 1)
    times.append(process_time())
    return dict(zip(("drawing", "distances", "path"), np.diff(times).tolist(), strict=True)) | {
        "all": times[-1] - times[0]
    }


def placed(lanes: int) -> dict[str, float]:
    """CPU seconds of reading a map, and of drawing the best place for an encounter on it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "city.xml")
        path.write_text(city(lanes), encoding="utf-8")
        begun = process_time()
        build_road(str(path), group(2, 20.0))
        return {"all": process_time() - begun}


def city(lanes: int) -> str:
    """Return a CommonRoad map of at least so many lanes: streets of a lane each way that cross, from crossing to crossing."""
    blocks = math.ceil(math.sqrt(lanes / 4.0))
    lanelets = []
    for k in range(4 * blocks * blocks):
        street, (block, way) = k // (4 * blocks), divmod(k % (4 * blocks), 4)
        along = np.array([block, block + 1.0]) * BLOCK
        middle, right = (
            np.column_stack([along, np.full(2, street * BLOCK - aside)])
            for aside in (0.0, 2.0 * LANE)
        )
        if way % 2:  # the other way, on the other side
            middle, right = middle[::-1], right[::-1] + np.array([0.0, 4.0 * LANE])
        if way >= 2:  # northwards or southwards: a quarter turn
            corner = (
                np.array([blocks - 0.5, -0.5]) * BLOCK
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


def _timed(
    spent: dict[str, float], share: str, stage: Callable[..., object]
) -> Callable[..., object]:
    """A stage that adds its CPU seconds to `spent`."""

    def call(*values: object, **named: object) -> object:
        begun = process_time()
        try:
            return stage(*values, **named)
        finally:
            spent[share] += process_time() - begun

    return call


def main() -> None:
    """Measure what the command line names, after the same on next to nothing, so that libraries and kernels are loaded."""
    kind, *words = sys.argv[1:]
    spent = dict.fromkeys(STAGES, 0.0)
    if kind == "generate":
        generated(2, 20.0, 2, 0.5)
        for share, names in STAGES.items():
            for home, name in names:
                setattr(home, name, _timed(spent, share, getattr(home, name)))
        found = generated(int(words[0]), float(words[1]), int(words[2]), float(words[3])) | spent
    else:
        measure, least = (planned, 200) if kind == "grid" else (placed, 400)
        measure(least)
        found = measure(int(words[0]))
    print(
        json.dumps(
            found | {"mebibytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0}
        )
    )


if __name__ == "__main__":
    main()

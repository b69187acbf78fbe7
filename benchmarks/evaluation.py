# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Evaluation: DTW beside dtaidistance, the feature matrix beside SciPy, and figure 5 as numbers.

Figure 5 needs the recorded encounters (SCENARIO_GEN_DATA); without them only the bundled cases
are measured. It takes some minutes.
"""

from collections.abc import Callable, Iterator
from importlib.resources import files
from pathlib import Path
import re
import sys
from time import process_time
from typing import Any

import numpy as np
from scipy.spatial.distance import cdist

from benchmarks._feature_matrix import dtw_distance, feature_matrix
from benchmarks._reference_sets import evaluate_with_references
from benchmarks._sampling_cases import DATA
from benchmarks._similarity import error_rows
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.logs import read_log
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.evaluation import Evaluation

STEPS_COUNT = sized(3000, quick=100)
SCENARIO_COUNT, SEEDS = sized((50, (7, 8, 9)), quick=(4, (7,)))
LOGS = sized(None, quick=1)
OTHER_ROADS = ("t_intersection", "four_way", "straight")


def run() -> list[Row]:
    """Measure."""
    own_road, other_roads = list[Evaluation](), list[Evaluation]()
    for encounter, roads in _encounters():
        for road in roads:
            own_road += _evaluations(encounter, road)
        others = (_evaluations(encounter, road) for road in OTHER_ROADS)
        other_roads += next((found for found in others if found), [])
    uniform = {"position": 0.7, "speed": 0.9}
    return [
        *_kernels(),
        *error_rows("own road", own_road, {"position": 0.15, "speed": 0.3}, 1.0, uniform),
        *error_rows("other roads", other_roads, {"position": 0.5, "speed": 0.5}, 1.0, uniform),
    ]


def _kernels() -> list[Row]:
    rng = np.random.default_rng(0)
    a, b = (rng.normal(size=(STEPS_COUNT, 2)).cumsum(axis=0) for _ in range(2))

    def normalised() -> Any:
        matrix = cdist(a, b)
        return (matrix - matrix.min()) / (matrix.max() - matrix.min())

    size = f"T = {STEPS_COUNT}"
    rows = _beside(
        f"feature matrix, {size}", lambda: feature_matrix(a, b), "SciPy", normalised, 2.0, 1e-12
    )
    try:
        from dtaidistance import dtw_ndim
    except ImportError:
        return rows

    def peer() -> Any:
        return dtw_ndim.distance_fast(a, b, inner_dist="euclidean")

    return rows + _beside(
        f"DTW, 2-D, {size}", lambda: dtw_distance(a, b), "dtaidistance", peer, 4.0, 1e-9
    )


def _beside(
    name: str,
    ours: Callable[[], Any],
    peer: str,
    theirs: Callable[[], Any],
    target: float,
    tolerance: float,
) -> list[Row]:
    """Return how much faster we are than a peer, and the largest difference of the results."""
    our_time, result = _fastest(ours)
    peer_time, reference = _fastest(theirs)
    times = f"{peer} {1e3 * peer_time:.1f} ms, ours {1e3 * our_time:.1f} ms"
    difference = float(np.abs(result - reference).max())
    return [
        higher(f"{name}: faster than {peer}", peer_time / our_time, "×", target, times),
        lower(f"{name}: difference from {peer}", difference, "", tolerance),
    ]


def _fastest(call: Callable[[], Any], repeats: int = sized(7, quick=1)) -> tuple[float, Any]:
    """Return the least CPU time of some calls, and the result."""
    times, result = [], None
    for _ in range(repeats):
        started = process_time()
        result = call()
        times.append(process_time() - started)
    return min(times), result


def _encounters() -> Iterator[tuple[Encounter, list[str]]]:
    """Yield encounters with their own roads: the corridor, and the map of the recording."""
    resources = Path(str(files("scenario_gen") / "resources"))
    recorded = sorted(DATA.glob("trajectories/*/encounter_*.csv"))
    for path in [*sorted(resources.glob("synthetic*")), *recorded][:LOGS]:
        place = re.search(r"(Lanker|Peach)-\d+_\d+", path.name)
        maps = sorted(DATA.glob(f"maps/occupancy_grids/USA_{place[0]}_*.yaml")) if place else []
        yield read_log(path).encounters[0], ["corridor", *map(str, maps)]


def _evaluations(encounter: Encounter, road: str) -> list[Evaluation]:
    """Return one evaluation per seed; none where the encounter does not fit the road."""
    config = PipelineConfig(sampling=SamplingConfig(drivers=0.0))
    found = []
    for seed in SEEDS:
        try:
            result = generate(encounter, road, config, count=SCENARIO_COUNT, seed=seed)
        except (InputError, RefusedError) as error:
            print(f"{encounter.name} on {Path(road).stem}: {error}", file=sys.stderr, flush=True)
            return []
        found.append(evaluate_with_references(result, config))
    return found

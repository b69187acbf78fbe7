# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What an encounter becomes on a road, as JSON: run under other CPUs' settings, what is decided must not change.

python test/support/results_of_a_run.py COUNT SEED LOG ROAD [LOG ROAD ...]
"""

import json
from pathlib import Path
import sys
from typing import Any

from scenario_gen.base.errors import RefusedError
from scenario_gen.logs import read_log
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.types.generation import GenerationResult


def results(case: GenerationResult) -> dict[str, Any]:
    """Return what was decided (equal on every CPU) and the places [m] (within a tolerance)."""
    made = case.generated
    return {
        "decided": {
            "changepoints": case.segmentation.changepoints.tolist(),
            "labels": case.segmentation.labels.tolist(),
            "route points": [len(route.points) for route in case.routes],
            "candidates": made.candidates,
            "indices": [scenario.index for scenario in made.scenarios],
            "instants": [len(scenario.time) for scenario in made.scenarios],
        },
        "places": [[scenario.position.ravel().tolist() for scenario in made.scenarios],
                   [route.points[:, :2].ravel().tolist() for route in case.routes]],
    }  # fmt: skip


def of_runs(count: int, seed: int, *pairs: str) -> dict[str, Any]:
    """Return the results of every log on every road."""
    found: dict[str, Any] = {}
    for log, road in zip(pairs[::2], pairs[1::2], strict=True):
        for encounter in read_log([Path(log)], PipelineConfig().log).encounters:
            name = f"{encounter.name} on {Path(road).stem}"
            try:
                found[name] = results(
                    generate(encounter, road, PipelineConfig(), count=count, seed=seed)
                )
            except RefusedError as error:
                found[name] = {"decided": str(error), "places": []}
    return found


if __name__ == "__main__":
    print(json.dumps(of_runs(int(sys.argv[1]), int(sys.argv[2]), *sys.argv[3:])))

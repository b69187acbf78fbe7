# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""SHA-256 of everything that one encounter becomes on one road, as JSON: run under other CPUs' settings, it must not change.

python test/numerics/exact/digest.py COUNT SEED LOG ROAD [LOG ROAD ...]
"""

import hashlib
import json
from pathlib import Path
import sys

import numpy as np

from msg_conventions.scenarios import encode_scenario
from scenario_gen.base.errors import RefusedError
from scenario_gen.logs import read_log
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.types.generation import GenerationResult


def sha(*arrays: object) -> str:
    """Digest of arrays' bytes."""
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())  # type: ignore[arg-type]
    return digest.hexdigest()


def digests(case: GenerationResult) -> dict[str, str]:
    """The stages' results, in their order."""
    encounter, segmentation, made = case.encounter, case.segmentation, case.generated
    scenarios = b"".join(encode_scenario(scenario, encounter.start_ns) for scenario in made.scenarios)
    return {
        "encounter": sha(encounter.position, encounter.speed, encounter.heading),
        "changepoints": sha(segmentation.labels, segmentation.changepoints, segmentation.changepoint_probability),
        "routes": sha(*(part for route in case.routes for part in (route.points, route.anchor))),
        "scenarios": f"{len(made.scenarios)} of {made.candidates}: {hashlib.sha256(scenarios).hexdigest()}",
        "evaluation": hashlib.sha256(case.evaluation.to_json().encode()).hexdigest(),
    }


def main(count: int, seed: int, pairs: list[str]) -> None:
    """Print the digests of every log on every road."""
    found: dict[str, dict[str, str]] = {}
    for log, road in zip(pairs[::2], pairs[1::2], strict=True):
        for encounter in read_log([Path(log)], PipelineConfig().log).encounters:
            name = f"{encounter.name} on {Path(road).stem}"
            try:
                found[name] = digests(generate(encounter, road, PipelineConfig(), count=count, seed=seed))
            except RefusedError as error:
                found[name] = {"refused": str(error)}
    print(json.dumps(found))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sets to compare a result with: no changepoints (the ablation of paper V-B), and uniform ones.

More changepoints always fit better, so the segmenter must fit better than evenly spaced ones.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.chain import Chain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.evaluation.evaluate import evaluate_scenarios, MEASURED_SCENARIOS
from scenario_gen.numerics import Ints
from scenario_gen.situation import Situation
from scenario_gen.types import Evaluation, GenerationResult, ScenarioSet, Segmentation, WITH

WITHOUT, UNIFORM = "without changepoints", "uniform changepoints"


def without_changepoints(segmentation: Segmentation) -> Segmentation:
    """Return the same encounter as one primitive."""
    return _with_changepoints(segmentation, np.zeros(0, dtype=np.int64))


def uniform_changepoints(segmentation: Segmentation) -> Segmentation:
    """Return as many changepoints as the segmentation has, evenly spaced in time."""
    count, steps = len(segmentation.changepoints), len(segmentation.labels)
    places = np.linspace(0, steps - 1, count + 2)[1:-1].round().astype(np.int64)
    return _with_changepoints(segmentation, places)


def _with_changepoints(segmentation: Segmentation, changepoints: Ints) -> Segmentation:
    """Return a segmentation with changepoints (K,); each segment is its own primitive."""
    labels = np.zeros(len(segmentation.labels), dtype=np.int64)
    labels[changepoints] = 1
    names = tuple(f"piece {k + 1}" for k in range(len(changepoints) + 1))
    return replace(
        segmentation, labels=np.cumsum(labels), changepoints=changepoints, descriptions=names
    )


REFERENCES: Mapping[str, Callable[[Segmentation], Segmentation]] = {
    WITHOUT: without_changepoints,
    UNIFORM: uniform_changepoints,
}


def evaluate_with_references(result: GenerationResult, config: PipelineConfig) -> Evaluation:
    """Evaluate a result beside sets with other changepoints, the same parameters and seed.

    The references keep no recorded waits, since the ends of a wait would be two more changepoints.
    A refused reference has no row.
    """
    road, _ = result.road_and_fit()
    sets: dict[str, ScenarioSet] = {WITH: result.generated}
    for name, other in REFERENCES.items():
        chain = Chain(
            Situation.of(result.encounter),
            other(result.segmentation),
            road,
            config,
            count=min(result.generated.requested, MEASURED_SCENARIOS),
            seed=result.seed,
            waits=(),
        )
        try:
            sets[name] = chain.run().generated
        except RefusedError:
            continue
    return evaluate_scenarios(
        result.encounter, sets, config=config.evaluation, seed=result.seed, road=road.name
    )

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Generation for the naturalness benchmark: recorded and generated motion of one encounter on some roads, as plain arrays."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from scenario_gen.base.errors import ScenarioGenError
from scenario_gen.logs import LogConfig, read_log
from scenario_gen.method.evaluation import EvaluationConfig
from scenario_gen.pipeline import generate, PipelineConfig

Arrays = dict[str, Any]
"""`position` (N, T, 2) [m], `heading` (N, T) [rad], `speed` (N, T) [m/s], `time` (T,) [s]."""
EVALUATED = ("e_position", "e_speed", "e_heading")
SEED = 7


@dataclass(frozen=True)
class Job:
    """One encounter: where it is read from, the roads it is put on, and how many scenarios are made on each."""

    name: str
    paths: tuple[str, ...]
    vehicles: tuple[str, ...]
    start: float
    end: float
    roads: tuple[str, ...]
    own: tuple[bool, ...]
    count: int
    variety: str = "wide"  # the sampler's preset, where it has several


@dataclass(frozen=True, eq=False)
class Made:
    """What came of a job on one road.

    Attributes:
        name: of the cut; road: its name; own: whether the road is the template's own (corridor, or the map of the recording).
        refused: why there is nothing, or "".
        template: the cleaned record; oracle: the fitted template replayed; samples: the scenarios.
        sizes: (length, width) [m] of the vehicles.
        changepoints: K.
        manoeuvres: of the vehicles, as the fit names them.
        candidates: drawn for the samples; asked: samples that were asked for.
        seconds: CPU of the whole of it, with references and evaluation.
        errors: E by row and metric.
        said: adaptations and notes of the fit.
    """

    name: str
    road: str
    own: bool
    refused: str = ""
    template: Arrays | None = None
    oracle: Arrays | None = None
    samples: Sequence[Arrays] = ()
    sizes: Sequence[tuple[float, float]] = ()
    changepoints: int = 0
    manoeuvres: Sequence[str] = ()
    candidates: int = 0
    asked: int = 0
    seconds: float = 0.0
    errors: dict[str, dict[str, float]] | None = None
    said: Sequence[str] = ()


def run_job(job: Job) -> Iterator[Made]:
    """Read the encounter and put it on each of its roads."""
    config = LogConfig(vehicles=",".join(job.vehicles), start=job.start, end=job.end, whole=True)
    try:
        found = read_log([Path(path) for path in job.paths], config).encounters
    except ScenarioGenError as error:
        for road, own in zip(job.roads, job.own, strict=True):
            yield Made(job.name, Path(road).stem, own, str(error))
        return
    encounter = max(found, key=lambda one: one.duration)
    for road, own in zip(job.roads, job.own, strict=True):
        yield generated(job.name, encounter, road, job.count, own=own, variety=job.variety)


def generated(
    name: str, encounter: Any, road: str, count: int, *, own: bool, variety: str = "wide"
) -> Made:
    """Put one encounter on one road."""
    config = PipelineConfig(evaluation=EvaluationConfig(resamples=10, compare=True))
    config = replace(config, sampling=replace(config.sampling, variety=variety))
    started = process_time()
    try:
        made: Any = generate(encounter, road, config, count=count, seed=SEED)
    except ScenarioGenError as error:
        return Made(name, Path(road).stem, own, str(error), template=arrays(encounter))
    drawn = made.generated
    rows = {
        row.name: {key: made.evaluation.value(row.name, key) for key in EVALUATED}
        for row in made.evaluation.rows
    }
    return Made(
        name,
        Path(road).stem,
        own,
        ""
        if len(drawn.scenarios) > 1
        else f"{len(drawn.scenarios)} scenarios: {dict(drawn.refused)}",
        template=arrays(encounter),
        oracle=arrays(made.replay),
        samples=[arrays(scenario) for scenario in drawn.scenarios],
        sizes=[(vehicle.length, vehicle.width) for vehicle in encounter.vehicles],
        changepoints=len(made.segmentation.changepoints),
        manoeuvres=[str(fitted.manoeuvre) for fitted in made.fit.fitted],
        candidates=int(drawn.candidates),
        asked=count,
        seconds=process_time() - started,
        errors=rows,
        said=[*map(str, drawn.adaptations), *map(str, made.fit.notes)],
    )


def arrays(motion: Any) -> Arrays:
    """Return the motion of an encounter or a scenario as plain arrays."""
    return {
        name: np.array(getattr(motion, name)) for name in ("time", "position", "heading", "speed")
    }

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The chain up to the sampler over every recorded encounter and several roads."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import os
from pathlib import Path

import numpy as np

from benchmarks._size import sized
from scenario_gen.base.errors import ScenarioGenError
from scenario_gen.logs import read_log
from scenario_gen.method.evaluation import replay
from scenario_gen.method.evaluation.distributions import compare, QUANTITIES, values_of
from scenario_gen.method.fitting import fit_template
from scenario_gen.method.routing import plan_routes
from scenario_gen.method.sampling import Plan, SamplingConfig
from scenario_gen.method.sampling.stage import draw_scenarios
from scenario_gen.method.segmentation import segment
from scenario_gen.method.validity import Checker
from scenario_gen.numerics.arrays import Floats
from scenario_gen.roads import build_road
from scenario_gen.situation import (
    Conflict,
    conflict_of,
    find_conflicts,
    find_waits,
    Situation,
    Wait,
)
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.fit import Fit, Route, Segmentation
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import Scenario, ScenarioSet, Verdict

DATA = Path(
    os.environ.get("SCENARIO_GEN_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")
)
LOGS = sized(None, quick=1)
ROADS = ("corridor", "straight", "t_intersection", "four_way")


@dataclass(frozen=True, eq=False)
class Prepared:
    """One recorded encounter planned on one road."""

    name: str
    road_name: str
    encounter: Encounter
    segmentation: Segmentation
    road: Road
    fit: Fit
    routes: tuple[Route, ...]
    conflicts: tuple[Conflict, ...]
    waits: tuple[Wait, ...]

    def sample(
        self,
        count: int,
        seed: int = 0,
        config: SamplingConfig = SamplingConfig(),
        *,
        checked: bool = True,
    ) -> ScenarioSet:
        """Sample `count` scenarios; unchecked, every candidate counts as valid."""
        checker = Checker(self.road, self.fit.requested, self.conflicts, self.waits)
        check = checker.check if checked else lambda scenarios, *_: [Verdict() for _ in scenarios]
        plan = Plan(
            Situation.of(self.encounter),
            self.segmentation,
            self.road,
            self.routes,
            self.fit.requested,
            self.waits,
        )
        return draw_scenarios(plan, check, config, count=count, seed=seed)


def cases() -> Iterator[Prepared | str]:
    """Every recorded encounter on every road that it can be fitted to and planned on; else a sentence why not."""
    for path in sorted((DATA / "trajectories").glob("*/encounter_*.csv"))[:LOGS]:
        encounter = read_log(path).encounters[0]
        for road_name in ROADS:
            name = path.stem.removeprefix("encounter_")[:32]
            try:
                yield prepared(encounter, road_name, name)
            except ScenarioGenError as error:
                yield f"{name} on {road_name}: {error}"


def prepared(encounter: Encounter, road_name: str, name: str) -> Prepared:
    """Return an encounter fitted to a road and planned on it.

    Raises:
        ScenarioGenError: that is not possible.
    """
    segmentation = segment(encounter)
    conflicts = find_conflicts(encounter)
    road = build_road(road_name, encounter)
    fit = fit_template(encounter, segmentation, road)
    return Prepared(
        name,
        road_name,
        encounter,
        segmentation,
        road,
        fit,
        plan_routes(road, fit),
        conflicts,
        find_waits(encounter),
    )


def displacement(scenarios: Sequence[Scenario]) -> float:
    """Mean distance [m] between the same vehicle at the same share of the duration in two samples, without the clock's part."""
    return _apart(np.stack([s.with_samples(101).position for s in scenarios]))


def displacement_at_instants(scenarios: Sequence[Scenario]) -> float:
    """Mean distance [m] between the same vehicle at the same instant in two samples, up to the end of the shortest."""
    count = min(s.time.size for s in scenarios)
    return _apart(np.stack([s.position[:, :count] for s in scenarios]))


def _apart(position: Floats) -> float:
    pairs = np.triu_indices(len(position), 1)
    return float(np.linalg.norm(position[pairs[0]] - position[pairs[1]], axis=-1).mean())


def arrival_spread(case: Prepared, scenarios: Sequence[Scenario]) -> float:
    """Largest standard deviation [s] of the second vehicle's entry over the conflicts that are not following; NaN if none."""
    spreads = []
    for conflict in case.conflicts:
        if conflict.following:
            continue
        a, b = sorted((conflict.first, conflict.second))
        found = [conflict_of(s, a, b) for s in scenarios]
        entries = [one.entry_second for one in found if one is not None]
        if len(entries) > 1:
            spreads.append(float(np.std(entries)))
    return max(spreads, default=float("nan"))


def divergences(case: Prepared, scenarios: Sequence[Scenario]) -> dict[str, float]:
    """Return the Jensen-Shannon divergence [bit] of each quantity from the fitted template."""
    period = case.encounter.dt
    template = values_of(replay(case.encounter, case.fit).resampled(period))
    samples = [values_of(scenario.resampled(period)) for scenario in scenarios]
    weights: Floats = np.ones((1, len(scenarios)))
    found = {}
    for quantity in QUANTITIES:
        values = [sample[quantity.id] for sample in samples]
        compared = compare(quantity, template[quantity.id], values)
        found[quantity.id] = float(compared.jensen_shannon(weights)[0])
    return found

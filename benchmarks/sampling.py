# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sampling: throughput, and acceptance, diversity and realism on recorded data."""

from time import process_time

import numpy as np

from benchmarks._sampling_cases import (
    arrival_spread,
    cases,
    displacement,
    displacement_at_instants,
    divergences,
    Prepared,
    prepared,
)
from benchmarks._scaling_case import group
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.method.sampling import Plan, SamplingConfig
from scenario_gen.method.sampling.stage import draw_scenarios
from scenario_gen.method.validity import Checker
from scenario_gen.numerics.arrays import Floats
from scenario_gen.situation import find_conflicts, Situation
from scenario_gen.types import Encounter, Motion, Vehicle
from scenario_gen.types.fit import Route, Segmentation
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import BoundaryStates

COUNT = sized(200, quick=4)
"""Scenarios per recorded encounter and road."""
THROUGHPUT_COUNT = sized(2000, quick=16)
CROSSING_COUNT = sized(500, quick=8)
REPEATS = sized(5, quick=1)
DIVERGENCE_TARGETS_BIT = {"speed": 0.1, "acceleration": 0.2, "gap": 0.1}


def run() -> list[Row]:
    """Measure."""
    rows = [*_throughput(), *_crossing()]
    return [*rows, *_recorded(1.0), *_recorded(0.0)]


def _crossing() -> list[Row]:
    """Sample two vehicles that cross, so that the order of arrival is checked, too."""
    case = prepared(group(2, 20.0), "four_way", "two platoons")
    rows = []
    for drivers in (1.0, 0.0):
        rate = 0.0
        for _ in range(REPEATS):
            started = process_time()
            found = case.sample(CROSSING_COUNT, config=SamplingConfig(drivers=drivers))
            rate = max(rate, len(found.scenarios) / (process_time() - started))
        acceptance = f"acceptance {found.acceptance:.2f}"
        rows.append(
            higher(
                f"crossing, drivers {drivers:g}: valid scenarios", rate, "1/s", None, acceptance
            )
        )
    return rows


def _throughput() -> list[Row]:
    """Sample vehicles side by side, in turn, since the speed of the machine changes."""
    count = THROUGHPUT_COUNT
    shapes = ((2, 20.0, count), (2, 20.0, 4 * count), (2, 40.0, count), (8, 20.0, count))
    times = np.array([[_seconds(*shape) for shape in shapes] for _ in range(REPEATS)])
    more, longer, fuller = np.median(times[:, 1:] / times[:, :1], axis=0).tolist()
    rate = count / times[:, 0].min()
    slowest = f"best of {REPEATS} runs; the slowest {count / times[:, 0].max():.0f}/s"
    return [
        higher("valid two-vehicle 20 s scenarios, one core", rate, "1/s", 2000.0, slowest),
        lower("cost of four times the samples", more, "×", 4.4),
        lower("cost of twice the duration", longer, "×", 2.2),
        lower("cost of four times the vehicles (8)", fuller, "×", 16.0),
    ]


def _seconds(vehicles: int, duration: float, count: int) -> float:
    """CPU seconds for `count` valid scenarios of vehicles that drive side by side, a changepoint every 2.5 s."""
    time: Floats = np.linspace(0.0, duration, round(duration / 0.1) + 1)
    speed = 8.0 + 2.0 * np.sin(time[None] / 3.0 + np.arange(vehicles)[:, None])
    along = np.concatenate(
        [np.zeros((vehicles, 1)), np.cumsum(0.05 * (speed[:, 1:] + speed[:, :-1]), axis=1)], axis=1
    )
    lane = 4.0 * np.arange(vehicles)[:, None]
    position = np.stack([20.0 + along, lane + 0.0 * along], axis=-1)
    changes = np.arange(25, len(time) - 12, 25)
    index = np.concatenate([[0], changes, [len(time) - 1]])
    routes, heading = [], np.zeros_like(speed)
    for n in range(vehicles):
        s = np.linspace(0.0, along[n, -1], int(along[n, -1] / 0.4) + 2)
        anchor = np.searchsorted(s, along[n, index] - 1e-9).clip(0, len(s) - 1)
        routes.append(
            Route(np.column_stack([20.0 + s, np.full_like(s, lane[n, 0]), 0.0 * s]), anchor, s)
        )
    names = tuple(Vehicle(str(n)) for n in range(vehicles))
    encounter = Encounter.sampled(names, 0.1, position, heading, speed, "side by side")
    labels = np.searchsorted(changes, np.arange(len(time)), side="right")
    segmentation = Segmentation(labels, changes, np.zeros(len(time)), ("",) * (len(changes) + 1))
    drivable = np.ones((5 * (40 + 4 * vehicles), 5 * int(along.max() + 60)), dtype=bool)
    road = Road(
        "wide", drivable, 0.2, np.array([-10.0, -20.0]), np.zeros((0, 3)), np.zeros((0, 3))
    )
    states = [
        np.array([[*r.points[k], v[k]] for r, v in zip(routes, speed, strict=True)])
        for k in (0, -1)
    ]
    asked = BoundaryStates(states[0], states[1])
    checker = Checker(
        road,
        asked,
        find_conflicts(Motion(names, time, position, heading, np.zeros_like(heading))),
        (),
    )
    started = process_time()
    found = draw_scenarios(
        Plan(Situation.of(encounter), segmentation, road, routes, asked, ()),
        checker.check,
        count=count,
    )
    spent = process_time() - started
    if len(found.scenarios) < count:
        raise RuntimeError(f"only {len(found.scenarios)} of {count} scenarios: {found.refused}")
    return spent


def _recorded(drivers: float) -> list[Row]:
    """Measure acceptance, diversity and realism with a setting of the sampler."""
    acceptance: dict[str, list[float]] = {}
    spreads, moved, distances = list[float](), list[float](), list[float]()
    realism: dict[str, list[float]] = {name: [] for name in DIVERGENCE_TARGETS_BIT}
    short = 0
    for case in cases():
        if not isinstance(case, Prepared):
            continue
        found = case.sample(COUNT, config=SamplingConfig(drivers=drivers))
        acceptance.setdefault(case.name, []).append(found.acceptance)
        short += len(found.scenarios) < COUNT
        if len(found.scenarios) < 2:
            continue
        moved.append(displacement(found.scenarios))
        distances.append(displacement_at_instants(found.scenarios))
        spreads.append(arrival_spread(case, found.scenarios))
        divergence = divergences(case, found.scenarios)
        for name, values in realism.items():
            values.append(divergence[name])
    if not acceptance:
        return [higher("recorded encounters", 0.0, "cases", 1.0, "none can be planned")]
    all_roads = [value for values in acceptance.values() for value in values]
    best_roads = [max(values) for values in acceptance.values()]
    pairs = f"{len(all_roads)} encounters × roads"
    rows = [
        higher(
            f"drivers {drivers:g}: acceptance, worst encounter on its best road",
            min(best_roads),
            "",
            0.7,
            pairs,
        ),
        higher(
            f"drivers {drivers:g}: acceptance, worst encounter and road", min(all_roads), "", 0.3
        ),
        lower(f"drivers {drivers:g}: sets with too few scenarios", short, "sets", 0.0),
        higher(
            f"drivers {drivers:g}: mean pairwise displacement, least", min(distances), "m", 0.5
        ),
        higher(
            f"drivers {drivers:g}: the same without the clock's part, least", min(moved), "m", 0.5
        ),
        higher(
            f"drivers {drivers:g}: standard deviation of arrival, median",
            float(np.nanmedian(spreads)),
            "s",
            0.5,
        ),
    ]
    for name, values in realism.items():
        label, target = (
            f"drivers {drivers:g}: JS {name} to the fitted template, median",
            DIVERGENCE_TARGETS_BIT[name],
        )
        rows.append(lower(label, float(np.median(values)), "bit", target))
    return rows

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sampling: the Gaussian process against its peers, throughput, and acceptance, diversity and realism on recorded data."""

from time import process_time

import numpy as np

from benchmarks import _sampling_peers
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
from scenario_gen.method.sampling import draw_scenarios, Plan, SamplingConfig
from scenario_gen.method.validity import Checker
from scenario_gen.numerics.arrays import Floats
from scenario_gen.situation import find_conflicts, Situation
from scenario_gen.types import Encounter, Motion, Vehicle
from scenario_gen.types.road import Road
from scenario_gen.types.route import Route
from scenario_gen.types.scenario import BoundaryStates
from scenario_gen.types.segmentation import Segmentation

COUNT = sized(200, quick=4)  # scenarios per recorded encounter and road
SCENARIOS = sized(2000, quick=16)  # whose throughput is measured
REPEATS = sized(5, quick=1)
CROSSING = sized(500, quick=8)
TARGETS = {"speed": 0.1, "acceleration": 0.2, "gap": 0.1}


def run() -> list[Row]:
    """Measure."""
    return [
        *_sampling_peers.rows(),
        *_throughput(),
        *_crossing(),
        *_recorded("wide"),
        *_recorded("narrow"),
    ]


def reference() -> float:
    """CPU seconds of a fixed job in NumPy: how fast the machine is now."""
    matrix = np.random.default_rng(0).standard_normal((300, 300))
    started = process_time()
    for _ in range(sized(200, quick=2)):
        np.sort(matrix @ matrix, axis=1)
    return process_time() - started


def _crossing() -> list[Row]:
    """Two vehicles that cross, on a road with a crossing: the order of arrival is checked, too."""
    case = prepared(group(2, 20.0), "four_way", "two platoons")
    rows = []
    for variety in ("wide", "narrow"):
        taken = []
        for _ in range(REPEATS):
            machine = reference()
            started = process_time()
            found = case.sample(CROSSING, config=SamplingConfig(variety=variety))
            taken.append(
                (process_time() - started, machine, len(found.scenarios), found.acceptance)
            )
        spent, machine, count, acceptance = min(taken)
        told = f"acceptance {acceptance:.2f}; NumPy's fixed job beside it {machine:.3f} s"
        rows += [
            higher(
                f"crossing, {variety}: valid scenarios, checked, one core",
                count / spent,
                "1/s",
                None,
                told,
            ),
            lower(
                f"crossing, {variety}: a scenario over NumPy's fixed job",
                spent / count / machine,
                "×",
            ),
        ]
    return rows


def _throughput() -> list[Row]:
    shapes = (
        (2, 20.0, SCENARIOS),
        (2, 20.0, 4 * SCENARIOS),
        (2, 40.0, SCENARIOS),
        (8, 20.0, SCENARIOS),
    )
    taken = [
        [_seconds(*shape) for shape in shapes] for _ in range(REPEATS)
    ]  # in turn: the machine is not always as fast
    machine = reference()
    base = min(times[0] for times in taken)
    more, longer, fuller = (
        float(np.median([times[k] / times[0] for times in taken])) for k in (1, 2, 3)
    )
    slowest = f"least of {REPEATS} runs; the slowest {SCENARIOS / max(times[0] for times in taken):.0f}/s"
    return [
        higher(
            "valid two-vehicle 20 s scenarios, checked, one core",
            SCENARIOS / base,
            "1/s",
            2000.0,
            slowest,
        ),
        lower(
            "such a scenario over NumPy's fixed job",
            base / SCENARIOS / machine,
            "×",
            None,
            f"{machine:.3f} s",
        ),
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


def _recorded(variety: str) -> list[Row]:
    """Acceptance, diversity and realism, from one run with a preset of the sampler (`wide` is the default)."""
    acceptance: dict[str, list[float]] = {}
    spreads, moved, apart, refused, broken = [], [], [], 0, 0
    realism: dict[str, list[float]] = {name: [] for name in TARGETS}
    for case in cases():
        if not isinstance(case, Prepared):
            refused += 1
            continue
        found = case.sample(COUNT, config=SamplingConfig(variety=variety))
        acceptance.setdefault(case.name, []).append(found.acceptance)
        broken += len(found.scenarios) < COUNT
        if len(found.scenarios) < 2:
            continue
        moved.append(displacement(found.scenarios))
        apart.append(displacement_at_instants(found.scenarios))
        spread = arrival_spread(case, found.scenarios)
        spreads += [] if np.isnan(spread) else [spread]
        for name, value in divergences(case, found.scenarios).items():
            if name in realism:
                realism[name].append(value)
    if not acceptance:
        return [
            higher(
                "recorded encounters",
                0.0,
                "cases",
                1.0,
                "no recorded data, or none can be planned",
            )
        ]
    everywhere = [value for values in acceptance.values() for value in values]
    peer = f"{len(everywhere)} encounters × roads, {refused} refused before sampling"
    rows = [
        higher(
            f"{variety}: raw acceptance, worst encounter on its best road",
            min(max(v) for v in acceptance.values()),
            "",
            0.7,
            peer,
        ),
        higher(f"{variety}: raw acceptance, worst encounter and road", min(everywhere), "", 0.3),
        lower(f"{variety}: sets that stayed short", float(broken), "sets", 0.0),
        higher(
            f"{variety}: mean pairwise displacement, least",
            min(apart),
            "m",
            0.5,
            f"median {np.median(apart):.2f} m",
        ),
        higher(
            f"{variety}: the same without the clock's part, least",
            min(moved),
            "m",
            0.5,
            f"median {np.median(moved):.2f} m",
        ),
    ]
    if spreads:
        label = f"{variety}: standard deviation of arrival at a crossing conflict, median"
        rows.append(
            higher(
                label,
                float(np.median(spreads)),
                "s",
                0.5,
                f"from {min(spreads):.2f} to {max(spreads):.2f} s",
            )
        )
    rows += [
        lower(
            f"{variety}: JS {name} to the fitted template, median",
            float(np.median(values)),
            "bit",
            TARGETS[name],
            f"worst {max(values):.3f}",
        )
        for name, values in realism.items()
    ]
    return rows

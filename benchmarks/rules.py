# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Traffic rules: how many published scenarios break one, by a judge with shapely that shares no code with the checker.

Stop and give-way signs are planted at random at the roads into junctions of the recorded OpenDRIVE maps (SCENARIO_GEN_DATA).
Encounters whose paths cross are generated on them twice, with `road.traffic_rules` kept and ignored: the second shows that
the judge finds what there is to find.
"""

from collections.abc import Iterator
from dataclasses import dataclass
import os
from pathlib import Path
import sys
import tempfile

import numpy as np
from numpy.typing import NDArray
from shapely import LineString, Point, Polygon, unary_union
from shapely.affinity import rotate, translate
from shapely.geometry import box
from shapely.geometry.base import BaseGeometry

from benchmarks._size import sized
from benchmarks.row import Row
from scenario_gen.base.errors import ScenarioGenError
from scenario_gen.base.markup import read_xml
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.method.evaluation import EvaluationConfig
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.roads import read_network, RoadConfig
from scenario_gen.types import Encounter, LaneNetwork, RuleKind, Scenario, TrafficRule

DATA = Path(
    os.environ.get("SCENARIO_GEN_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")
)
SEEDS = sized(3, quick=1)
COUNT = sized(10, quick=2)
MAPS = sized(5, quick=1)
NEAR, STANDS, CLOSE = 8.0, 0.5, 1.5  # metres before a line, m/s, s between two that meet
SHARE = 0.5  # of the roads into junctions that get a sign


@dataclass
class Tally:
    """What was published, and what the judge found in it."""

    pairs: int = 0
    generated: int = 0
    scenarios: int = 0
    runs: int = 0
    taken: int = 0


def run() -> list[Row]:
    """Measure; without the recorded maps there is nothing to measure."""
    maps = sorted((DATA / "maps" / "opendrive").glob("*.xodr"))
    tallies = {"kept": Tally(), "ignored": Tally()}
    with tempfile.TemporaryDirectory() as scratch:
        signed = [
            path
            for source in maps
            for seed in range(SEEDS)
            for path in planted(source, seed, Path(scratch))
        ]
        for path in signed[: MAPS * SEEDS]:
            for encounter in _encounters():
                for choice, tally in tallies.items():
                    _judge(encounter, path, choice, tally)
            print(path.name, tallies, file=sys.stderr, flush=True)
    rows = []
    for choice, tally in tallies.items():
        asked = 0.0 if choice == "kept" else None
        of = f"{tally.scenarios} scenarios of {tally.generated} of {tally.pairs} pairs of an encounter and a map with signs"
        rows += [
            Row(f"rules {choice}: stop lines run", tally.runs, "scenarios", "lower", asked, of),
            Row(
                f"rules {choice}: rights of way taken",
                tally.taken,
                "scenarios",
                "lower",
                asked,
                of,
            ),
        ]
    return rows


def _encounters() -> Iterator[Encounter]:
    for case in "abc":
        yield read_log(bundled(case)).encounters[0]
    for path in sorted((DATA / "trajectories").glob("*/encounter_[ab3]*.csv")):
        yield read_log(path).encounters[0]


def planted(source: Path, seed: int, folder: Path) -> Iterator[Path]:
    """Write a map with signs at some of its roads into junctions; nothing where no junction is, or signs stand already."""
    try:
        lanes = read_network(source).lanes
        root = read_xml(source, str(source))
    except ScenarioGenError:
        return
    rng = np.random.default_rng(seed)
    mouths = [
        lane
        for lane in lanes
        if not lane.junction and any(lanes[k].junction for k in lane.successors)
    ]
    lengths = {road.get("id"): road.number("length") for road in root.all("road")}
    text = source.read_text()
    if not mouths or "<signal " in text:
        return
    for key in sorted(
        {(lane.id.split(".")[0], not lane.id.split(".")[2].startswith("-")) for lane in mouths}
    ):
        if rng.random() < SHARE:
            road, against = key
            s = 0.5 if against else lengths[road] - 0.5
            sign = (
                f'<signals><signal s="{s!r}" t="0" id="{road}{"-" if against else "+"}" dynamic="no" country="DE" '
                f'orientation="{"-" if against else "+"}" type="{rng.choice(["205", "206"])}"/></signals></road>'
            )
            text = _before_end_of(text, road, sign)
    path = folder / f"{source.stem}_{seed}.xodr"
    path.write_text(text)
    yield path


def _before_end_of(text: str, road: str, sign: str) -> str:
    """Put a sign at the end of a road."""
    begin = next(
        at
        for at in range(len(text))
        if text.startswith("<road ", at) and f' id="{road}"' in text[at : text.index(">", at)]
    )
    end = text.index("</road>", begin)
    return text[:end] + sign + text[end + len("</road>") :]


def _judge(encounter: Encounter, path: Path, choice: str, tally: Tally) -> None:
    tally.pairs += 1
    config = PipelineConfig(
        road=RoadConfig(traffic_rules=choice), evaluation=EvaluationConfig(resamples=10)
    )
    try:
        made = generate(encounter, str(path), count=COUNT, seed=7, config=config)
    except ScenarioGenError:
        return
    tally.generated += 1
    network = read_network(path)
    for scenario in made.generated:
        tally.scenarios += 1
        tally.runs += any(
            runs_line(network, rule, scenario, n)
            for rule in network.rules
            for n in range(len(scenario.vehicles))
        )
        tally.taken += takes_way(network, scenario)


def runs_line(network: LaneNetwork, rule: TrafficRule, scenario: Scenario, n: int) -> bool:
    """Whether a vehicle drives over the line of a stop sign of its lane, and has not stood before it."""
    if rule.kind != RuleKind.STOP:
        return False
    yaw, half = scenario.heading[n], scenario.vehicles[n].length / 2.0
    front = scenario.position[n] + half * np.column_stack((np.cos(yaw), np.sin(yaw)))
    path = LineString(front[scenario.there[n]]) if scenario.there[n].sum() > 1 else None
    if path is None or not path.length or not path.intersects(LineString(rule.line)):
        return False
    if not any(_drives_in(network, k, scenario, n).any() for k in rule.lanes):
        return False
    own = scenario.there[n]
    at = path.project(Point(path.intersection(LineString(rule.line)).centroid))
    along = np.concatenate(([0.0], np.hypot(*np.diff(front[own], axis=0).T).cumsum()))
    before = (along <= at) & (along >= at - NEAR)
    return (
        at >= NEAR and bool(before.any()) and float(scenario.speed[n, own][before].min()) > STANDS
    )


def takes_way(network: LaneNetwork, scenario: Scenario) -> bool:
    """Whether a vehicle that has to give way passes closely before one that goes first by the rules."""
    for rule in network.rules:
        for i in range(len(scenario.vehicles)):
            for j in range(len(scenario.vehicles)):
                if (
                    i == j
                    or not _came(network, rule.lanes, scenario, i)
                    or not _came(network, rule.over, scenario, j)
                ):
                    continue
                if _came(network, rule.lanes, scenario, j):
                    continue
                mine, other = _inside(scenario, i, j), _inside(scenario, j, i)
                if mine is None or other is None:
                    continue
                if mine[0] < other[0] and other[0] - mine[1] < CLOSE:
                    return True
    return False


def _drives_in(network: LaneNetwork, lane: int, scenario: Scenario, n: int) -> NDArray[np.bool_]:
    """(T,) whether the centre of a vehicle is in a lane, about its way."""
    own = network.lanes[lane]
    area = Polygon(own.outline).buffer(0.0)
    direction = np.arctan2(*(own.centre[-1] - own.centre[-2])[::-1])
    about = np.cos(scenario.heading[n] - direction) > 0.5
    inside = np.array([area.contains(Point(place)) for place in scenario.position[n]])
    return np.asarray(inside & about & scenario.there[n])


def _came(network: LaneNetwork, lanes: tuple[int, ...], scenario: Scenario, n: int) -> bool:
    return any(_drives_in(network, k, scenario, n).any() for k in lanes)


def _inside(scenario: Scenario, n: int, other: int) -> tuple[float, float] | None:
    """First and last time [s] at which a vehicle's footprint meets where another one drives."""
    prints, others = (_footprints(scenario, k) for k in (n, other))
    swept = unary_union(others)
    times = [
        time
        for time, shape in zip(scenario.time[scenario.there[n]], prints, strict=True)
        if shape.intersects(swept)
    ]
    return (float(times[0]), float(times[-1])) if times else None


def _footprints(scenario: Scenario, n: int) -> list[BaseGeometry]:
    vehicle, own = scenario.vehicles[n], scenario.there[n]
    shape = box(
        -vehicle.length / 2.0, -vehicle.width / 2.0, vehicle.length / 2.0, vehicle.width / 2.0
    )
    poses = zip(scenario.position[n, own], scenario.heading[n, own], strict=True)
    return [
        translate(rotate(shape, yaw, origin=(0.0, 0.0), use_radians=True), x, y)
        for (x, y), yaw in poses
    ]

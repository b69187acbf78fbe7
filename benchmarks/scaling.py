# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a group costs: `generate` by the number of vehicles, the horizon and the number of scenarios; the inventory of an archive.

CPU seconds in this process, kernels loaded. Vehicles come from two arms of a crossing, one behind the other, and go straight on.
"""

import math
from pathlib import Path
import tempfile
from time import process_time

import numpy as np

from benchmarks._size import sized
from benchmarks.row import Row
from scenario_gen.corpus.mine import inventory
from scenario_gen.pipeline import generate
from scenario_gen.types import Encounter, Vehicle

ROAD, COUNT, SECONDS = "four_way", 50, 20.0
TARGETS = {8: 6.0, 12: 15.0}  # CPU seconds, by the number of vehicles
SPEED, GAP, LANE = 10.0, 14.0, 1.75  # m/s, m, m
FILES = 100_000


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
            position.append(np.column_stack([np.full(steps, LANE), way - 72.0 - GAP * (vehicles // 2) - behind]))
        heading.append(np.full(steps, np.pi / 2.0 * (k % 2)))
    names = tuple(Vehicle(str(k)) for k in range(vehicles))
    speed = np.full((vehicles, steps), SPEED)
    return Encounter("group", names, 1_600_000_000_000_000_000, 100_000_000, np.array(position), np.array(heading), speed)


def run() -> list[Row]:
    """The cost of groups, and of the inventory of many files."""
    count = sized(COUNT, quick=2)
    _cost(group(2, SECONDS), 2)  # what is loaded and compiled is not measured
    sizes = sized((2, 4, 8, 12), quick=(2, 4))
    cost = {n: _cost(group(n, SECONDS), count) for n in sizes}
    rows = [Row(f"{n} vehicles, {SECONDS:g} s, {count} scenarios", cost[n], "CPU s", "lower", TARGETS.get(n)) for n in sizes]
    most = max(cost)
    rows.append(Row("exponent in vehicles", _exponent(cost[2], cost[most], most / 2), "", "lower", 1.5))
    long, many = sized(60.0, quick=25.0), sized(1000, quick=4)
    two = _cost(group(2, long), count)
    rows.append(
        Row("exponent in the horizon", _exponent(cost[2], two, long / SECONDS), "", "lower", 1.2, f"{long:g} s: {two:.2f} s")
    )
    more = _cost(group(2, SECONDS), many)
    rows.append(Row("exponent in scenarios", _exponent(cost[2], more, many / count), "", "lower", 1.0, f"{many}: {more:.2f} s"))
    return [*rows, _inventory(sized(FILES, quick=200))]


def _cost(encounter: Encounter, count: int) -> float:
    """CPU seconds of the whole of `generate`."""
    begun = process_time()
    generate(encounter, ROAD, count=count, seed=1)
    return process_time() - begun


def _exponent(first: float, second: float, ratio: float) -> float:
    return math.log(second / first) / math.log(ratio)


def _inventory(files: int) -> Row:
    """Seconds that it takes to see what lies in an archive."""
    line = ",".join(["1"] * 19) + "\n"
    with tempfile.TemporaryDirectory() as place:
        for k in range(files):
            path = Path(place, f"{k // 1000:03}", f"{k}.csv")
            path.parent.mkdir(exist_ok=True)
            path.write_text(line)
        begun = process_time()
        found = len(inventory([Path(place)])[0])
        seconds = process_time() - begun
    assert found == files
    return Row(f"inventory of {files} files", seconds, "CPU s", "lower", 10.0)

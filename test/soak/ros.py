# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The nodes under storms: 10⁵ scenarios in a request, hostile messages on every input, an end at load 16.

Starts and ends are those of `python -m benchmarks start`; each storm is a module: `ros_many`, `ros_hostile`.
"""

from collections.abc import Iterator
from pathlib import Path

from figures import Figure, of_benchmark
import ros_hostile
import ros_many


def run(state: Path) -> Iterator[Figure]:
    """Run one storm after the other; each keeps what it measured in a folder of its own."""
    yield from of_benchmark("start", state / "start.json")
    for storm in (ros_many, ros_hostile):
        folder = state / storm.__name__
        folder.mkdir(parents=True, exist_ok=True)
        yield from storm.run(folder)

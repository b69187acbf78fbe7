# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The library without ROS: read a log, find its primitives, make new scenarios on another road, measure them.

    python examples/generate.py [LOG] [--road ROAD] [--count N] [--seed SEED]

Without a log it takes the bundled synthetic one, which is a bag: `pip install 'scenario_gen[bags]'`. CSV needs the core alone.
"""

import argparse
from pathlib import Path

from scenario_gen import (
    build_road,
    bundled,
    evaluate,
    generate,
    PipelineConfig,
    read_log,
    Request,
    SamplingConfig,
    segment,
)


def main() -> None:
    """Run the method on every encounter of a log."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("log", nargs="?", type=Path, default=bundled("a"))
    parser.add_argument("--road", default="t_intersection")
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=7)
    arguments = parser.parse_args()

    config = PipelineConfig(
        sampling=SamplingConfig(lateral_sigma=0.4)
    )  # every other parameter has its default
    for encounter in read_log(arguments.log, config.log).encounters:
        # 1. Primitives: at which instants does the joint behaviour change?
        found = segment(encounter, config.segmentation, arguments.seed)
        edges = [0.0, *encounter.time[found.changepoints], encounter.duration]
        print(f"{encounter.name}: {len(encounter.vehicles)} vehicles, {encounter.duration:.1f} s")
        for start, end, words in zip(edges[:-1], edges[1:], found.descriptions, strict=True):
            print(f"  {start:5.1f} to {end:5.1f} s: {words}")

        # 2. New scenarios on the road: valid ones, the account of all candidates, and the figures.
        road = build_road(arguments.road, encounter, config.road)
        result = generate(encounter, road, config, count=arguments.count, seed=arguments.seed)
        drawn = result.generated
        print(
            f"{result.title}: {len(drawn.scenarios)} of {drawn.candidates} candidates are valid; refused: {dict(drawn.refused)}"
        )
        first = drawn.scenarios[0]
        for vehicle, position, speed in zip(
            first.vehicles, first.position, first.speed, strict=True
        ):
            (x, y), (u, v) = position[0], position[-1]
            print(
                f"  vehicle {vehicle.id}: ({x:.1f}, {y:.1f}) to ({u:.1f}, {v:.1f}) m, {speed.min():.1f} to {speed.max():.1f} m/s"
            )
        print(evaluate(result, config.evaluation).to_markdown())

        # 3. The same with a slot for a planner under test in place of the first vehicle.
        ego = encounter.vehicles[0].id
        slot = generate(
            encounter, road, config, count=1, seed=arguments.seed, request=Request(ego=ego)
        ).generated
        others = slot.scenarios[0]
        left = [vehicle.id for vehicle in others.vehicles]
        there = "there" if others.reference_drive else "missing"
        print(f"without vehicle {ego}: {', '.join(left)}; its reference drive is {there}")


if __name__ == "__main__":
    main()

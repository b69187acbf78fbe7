# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Draw docs/picture.png, the picture of the README: `python docs/picture.py` (matplotlib; the bundled log, seed 7)."""

from pathlib import Path

import matplotlib
import numpy as np

from scenario_gen import build_road, bundled, Encounter, generate, read_log, Road, Scenario, segment
from scenario_gen.types.markings import Marking, markings

matplotlib.use("agg")
from matplotlib import pyplot
from matplotlib.axes import Axes

COLOURS = ("#0b6e99", "#d9622b", "#4b8b3b")
PAINT = {
    Marking.EDGE: {"linewidth": 0.8},
    Marking.LANE: {"linewidth": 0.6, "dashes": (5, 7)},
    Marking.CENTRE: {"linewidth": 0.8, "dashes": (5, 3)},
    Marking.STOP: {"linewidth": 2.0},
    Marking.GIVE_WAY: {"linewidth": 1.6, "dashes": (1, 1)},
    Marking.ARROW: {"linewidth": 0.6},
}
PICTURE = Path(__file__).with_name("picture.png")
CASE, COUNT, SEED = "b", 30, 7


def main() -> None:
    """Draw the recording, what was generated from it on a road, and the speeds of both."""
    (encounter,) = read_log(bundled(CASE)).encounters
    found = segment(encounter, seed=SEED)
    road = build_road("t_intersection", encounter)
    result = generate(encounter, road, count=COUNT, seed=SEED)
    pyplot.rcParams |= {"font.size": 8}
    figure, axes_of = pyplot.subplot_mosaic("ac;bc", figsize=(9.0, 4.2), width_ratios=(1.4, 1.0), layout="constrained")
    recorded, generated, speeds = (axes_of[name] for name in "abc")
    draw(recorded, encounter, 1.0)
    for n, position in enumerate(encounter.position):
        recorded.plot(*position[found.changepoints].T, "o", color="white", markeredgecolor=COLOURS[n], markersize=5)
        speeds.plot(
            encounter.time, encounter.speed[n], color=COLOURS[n], linewidth=2.0, label=f"vehicle {encounter.vehicles[n].id}"
        )
    for time in encounter.time[found.changepoints]:
        speeds.axvline(time, color="#bbbbbb", linewidth=0.8, linestyle=":")
    for scenario in result.generated.scenarios:
        draw(generated, scenario, 0.4)
        for n, speed in enumerate(scenario.speed):
            speeds.plot(scenario.time, speed, color=COLOURS[n], alpha=0.4, linewidth=0.7)
    draw_road(generated, road)
    recorded.set_title(f"recorded: {encounter.name}, {len(found.changepoints)} changepoints")
    generated.set_title(f"generated: {len(result.generated.scenarios)} scenarios on {road.name}")
    speeds.set_title("speeds: recorded (thick), generated (thin)")
    speeds.set(xlabel="time [s]", ylabel="speed [m/s]")
    speeds.legend(frameon=False)
    for axes in (recorded, generated):
        axes.set_aspect("equal")
        axes.set(xlabel="x [m]", ylabel="y [m]")
    figure.savefig(PICTURE, dpi=110)


def draw(axes: Axes, motion: Encounter | Scenario, alpha: float) -> None:
    """Draw every vehicle's way, its start as a dot."""
    for n, position in enumerate(motion.position):
        axes.plot(*position.T, color=COLOURS[n], alpha=alpha, linewidth=1.0)
        axes.plot(*position[0], "o", color=COLOURS[n], alpha=alpha, markersize=3)


def draw_road(axes: Axes, road: Road) -> None:
    """Draw what is drivable and what is painted on it underneath, as far as the axes reach."""
    bounds = axes.axis()
    height, width = road.drivable.shape
    x, y = (low + road.resolution * (np.arange(cells) + 0.5) for low, cells in zip(road.origin, (width, height), strict=True))
    axes.contourf(x, y, road.drivable, levels=(0.5, 1.5), colors=("#d9dade",), zorder=0)
    for kind, lines in (markings(road.lanes) if road.lanes is not None else {}).items():
        for line in lines:
            axes.plot(*line.T, color="white", zorder=0.5, **PAINT[kind])
    axes.axis(bounds)


if __name__ == "__main__":
    main()

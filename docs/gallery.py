# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Draw docs/gallery/*.svg and write docs/gallery.md: `python docs/gallery.py` (one scenario each, seed 7)."""

from dataclasses import dataclass
from pathlib import Path

import matplotlib
from matplotlib import pyplot
import numpy as np
from picture import Film, moving_vehicle, path, road_shapes, STYLE

from scenario_gen import generate, read_log, Road, Scenario
from scenario_gen.numerics import Floats

PAGE = Path(__file__).with_name("gallery.md")
PICTURES = PAGE.with_suffix("")
ROOT = PAGE.parents[1]
RECORDED = "scenario_gen/resources/recorded"
DRAWN = "scenario_gen/resources/demo"
SEED = 7
WIDTH, HEIGHT = 600, 360  # pixels
STEP_S = 0.2
PAUSE_S = 1.0  # at the end of the film
MARGIN_M = 12.0
COLOURS = ("#0b6e99", "#d9622b", "#4c8f2f")
HEAD = """# Gallery

What can be generated? Each film shows one scenario, from `scenario-gen generate LOG --road ROAD --count 1 --seed 7`. Vehicles are numbered in the order of the recording. `python docs/gallery.py` draws this page.
"""


@dataclass(frozen=True)
class Scene:
    """A film: title, log, road, and whether the log is recorded or invented."""

    name: str
    title: str
    log: str
    road: str
    view: float = 110.0  # m, at most


SCENES = (
    Scene(
        "left_turn",
        "A left turn waits for an oncoming car",
        f"{RECORDED}/ngsim_left_turn.csv",
        "four_way",
    ),
    Scene(
        "two_left_turns",
        "Two left turns, one behind the other",
        f"{RECORDED}/ngsim_two_left_turns.csv",
        "t_intersection",
    ),
    Scene("following", "Following in a curve", f"{RECORDED}/v2x_following.csv", "curve"),
    Scene(
        "roundabout",
        "Following around a roundabout",
        f"{RECORDED}/v2x_following.csv",
        "roundabout",
        view=240.0,
    ),
    Scene(
        "map",
        "The left turn on an OpenDRIVE map",
        f"{RECORDED}/ngsim_left_turn.csv",
        "examples/town.xodr",
    ),
    Scene("crossing", "Slowing down for a crossing car", "examples/my_log.csv", "four_way"),
    Scene("merge", "Merging behind a car", "examples/merge.csv", "merge"),
    Scene(
        "all_way_stop",
        "Three cars at an all-way stop",
        f"{DRAWN}/all_way_stop.csv",
        "four_way",
    ),
)


def main() -> None:
    """Draw each scene, and the paths of the tutorial's scenarios."""
    parts = [HEAD]
    for scene in SCENES:
        (encounter,) = read_log(ROOT / scene.log).encounters
        road = scene.road if "/" not in scene.road else str(ROOT / scene.road)
        result = generate(encounter, road, count=1, seed=SEED)
        (PICTURES / f"{scene.name}.svg").write_text(
            film(result[0], result.road, scene.view), encoding="utf-8"
        )
        source = "Recorded" if scene.log.startswith(RECORDED) else "Invented"
        words = "; ".join(result.reacting["sentences"]) or "no reactions detected"
        place = f"`{scene.log}` on `{scene.road}`"
        parts.append(
            f"## {scene.title}\n\n![{scene.title}](gallery/{scene.name}.svg)\n\n{source}, {place}: {words}.\n"
        )
    PAGE.write_text("\n".join(parts), encoding="utf-8")
    draw_tutorial()


def film(scenario: Scenario, road: Road, most: float) -> str:
    """Return an animated SVG of a scenario on at most `most` [m] of its road, with numbered vehicles."""
    places = scenario.position.reshape(-1, 2)
    low, high = places.min(axis=0) - MARGIN_M, places.max(axis=0) + MARGIN_M
    apart = np.linalg.norm(scenario.position[0] - scenario.position[1], axis=-1)
    meeting = scenario.position[:2, np.argmin(apart)].mean(axis=0)
    view = np.minimum(high - low, (most, most * HEIGHT / WIDTH))
    centre = np.where(high - low > view, meeting, (low + high) / 2.0)
    pixels = min(WIDTH / view[0], HEIGHT / view[1])

    def place(points: Floats) -> Floats:
        return (points - centre) * (pixels, -pixels) + (WIDTH / 2.0, HEIGHT / 2.0)

    clock = np.arange(0.0, scenario.time[-1] + PAUSE_S, STEP_S)
    rows = np.minimum(np.searchsorted(scenario.time, clock), len(scenario.time) - 1)
    seconds = f'dur="{clock[-1]:.1f}s" repeatCount="indefinite"'
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}">',
        f"<style>{STYLE} .number {{ font-weight: bold; fill: #fff; text-anchor: middle }}</style>",
        f'<rect class="back" width="{WIDTH}" height="{HEIGHT}"/>',
        *road_shapes(road, place),
    ]
    shown = Film(place, pixels, rows, seconds)
    for n in range(len(scenario.vehicles)):
        colour = COLOURS[n % len(COLOURS)]
        number = f'<text class="number" y="4">{n + 1}</text>'
        lines += [
            f'<path d="M{path(place(scenario.position[n][::3]))}" fill="none" stroke="{colour}" opacity=".4"/>',
            moving_vehicle(scenario, n, shown, f'fill="{colour}"', number),
        ]
    return "\n".join([*lines, "</svg>"]) + "\n"


def draw_tutorial() -> None:
    """Draw the paths of the scenarios of the first tutorial."""
    matplotlib.use("Agg")
    (encounter,) = read_log(ROOT / RECORDED / "ngsim_left_turn.csv").encounters
    figure, axes = pyplot.subplots(figsize=(4.4, 4.4), layout="constrained")
    generate(encounter, "four_way", count=20, seed=SEED).plot(axes)
    figure.savefig(PICTURES / "tutorial.png", dpi=70)
    pyplot.close(figure)


if __name__ == "__main__":
    main()

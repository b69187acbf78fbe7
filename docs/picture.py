# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Draw docs/picture.svg, the animated picture of the README: `python docs/picture.py` (the first case of the demo, seed 7)."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from scenario_gen import build_road, bundled, Encounter, generate, read_log, Road, Scenario
from scenario_gen.numerics import Floats, Ints
from scenario_gen.types.markings import markings

PICTURE = Path(__file__).with_name("picture.svg")
CASE, ROAD, COUNT, SEED = "ngsim_left_turn", "four_way", 30, 7
LABELS = ("vehicle 2839 waits and turns left", "vehicle 21019 goes straight on")
TURNS = 0  # index of the one that waits
PANELS = 4  # the recording and three scenarios; the speeds are of all
WIDTH, PANEL, GAP, TOP, PLOT_TOP, PLOT_HEIGHT = 900, 216, 12, 24, 280, 120  # pixels
LEFT = 36
HALF_M = 30.0  # what a panel shows around the meeting
STEP_S = 0.2
PAUSE_S = 1.0  # at the end of the film
STANDS_MPS = 0.3
MAX_MPS = 16.0
STYLE = """
text { font: 12px sans-serif; fill: #333 } .small { font-size: 11px }
.back { fill: #f3f3f5 } .road { fill: #d3d5da } .axis { stroke: #888; fill: none }
.marking { stroke: #fff; fill: none; stroke-width: 1 }
.dashed { stroke-dasharray: 3 5 } .thick { stroke-width: 3 }
.path { fill: none; stroke-width: 1.2; opacity: .5 }
.recorded { fill: none; stroke-width: 2.4 } .thin { fill: none; stroke-width: .7; opacity: .3 }
.s0 { stroke: #0b6e99 } .s1 { stroke: #d9622b } .f0 { fill: #0b6e99 } .f1 { fill: #d9622b; font-weight: bold }
@media (prefers-color-scheme: dark) {
text { fill: #ddd } .back { fill: #22242a } .road { fill: #454851 } .marking { stroke: #9a9ca3 }
.s0 { stroke: #4fb3e0 } .s1 { stroke: #ff8a50 } .f0 { fill: #4fb3e0 } .f1 { fill: #ff8a50 } }
"""


def main() -> None:
    """Draw the recording and what was generated from it side by side, moving, and the speeds of both."""
    (encounter,) = read_log(bundled(CASE)).encounters
    road = build_road(ROAD, encounter)
    scenarios = generate(encounter, road, count=COUNT, seed=SEED).generated.scenarios
    motions: list[Encounter | Scenario] = [encounter, *spread(scenarios)]
    clock = np.arange(
        0.0, max(motion.time[-1] for motion in (encounter, *scenarios)) + PAUSE_S, STEP_S
    )
    height = PLOT_TOP + PLOT_HEIGHT + 40
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}">'
    ]
    lines += [
        f"<style>{STYLE}</style>",
        f'<clipPath id="panel"><rect width="{PANEL}" height="{PANEL}"/></clipPath>',
    ]
    for k, motion in enumerate(motions):
        scenario = f"scenario {motion.index}" if isinstance(motion, Scenario) else "recorded"
        title = f"generated on {road.name}, {scenario}" if k == 1 else scenario
        lines.append(f'<text x="{k * (PANEL + GAP)}" y="15">{title}</text>')
        lines.append(
            f'<g transform="translate({k * (PANEL + GAP)} {TOP})" clip-path="url(#panel)">'
        )
        lines += [
            f'<rect class="back" width="{PANEL}" height="{PANEL}"/>',
            *panel(motion, road if k else None, clock),
            "</g>",
        ]
    lines += [*speeds(encounter, scenarios, clock), "</svg>"]
    PICTURE.write_text("\n".join(lines) + "\n", encoding="utf-8")


def spread(scenarios: Sequence[Scenario]) -> list[Scenario]:
    """Return scenarios that differ in when the one that waits drives off: the earliest, the middle and the latest."""
    leaves = [
        scenario.time[scenario.speed[TURNS] < STANDS_MPS][-1:].sum() for scenario in scenarios
    ]
    order = np.argsort(leaves, kind="stable")
    return [scenarios[k] for k in order[np.linspace(0, len(order) - 1, PANELS - 1).astype(int)]]


def panel(motion: Encounter | Scenario, road: Road | None, clock: Floats) -> Iterator[str]:
    """Yield the road, and every vehicle's path and moving footprint; the word "waits" beside the one that stands."""
    apart = np.linalg.norm(motion.position[0][:, None] - motion.position[1][None], axis=-1)
    centre = motion.position[0][np.unravel_index(np.argmin(apart), apart.shape)[0]]
    pixels = PANEL / (2.0 * HALF_M)

    def place(points: Floats) -> Floats:
        return (points - centre) * (pixels, -pixels) + PANEL / 2.0

    if road is not None:
        yield from road_shapes(road, place)
    seconds = f'dur="{clock[-1]:.1f}s" repeatCount="indefinite"'
    at = np.minimum(np.searchsorted(motion.time, clock), len(motion.time) - 1)
    film = Film(place, pixels, at, seconds)
    for n in range(len(motion.vehicles)):
        label = waits(motion, at, seconds) if n == TURNS else ""
        yield f'<path class="path s{n}" d="M{path(place(motion.position[n][::3]))}"/>'
        yield moving_vehicle(motion, n, film, f'class="f{n}"', label)


class Film(NamedTuple):
    """How metres become pixels, the shown samples, and the attributes of an animation."""

    place: Callable[[Floats], Floats]
    pixels: float
    rows: Ints
    seconds: str


def moving_vehicle(
    motion: Encounter | Scenario, n: int, film: Film, paint: str, label: str
) -> str:
    """Return the moving footprint of a vehicle, with attributes `paint`, and a label on it."""
    vehicle = motion.vehicles[n]
    xy, turned = (
        film.place(motion.position[n][film.rows]),
        -np.degrees(heading(motion, n)[film.rows]),
    )
    length, width = vehicle.length * film.pixels, vehicle.width * film.pixels
    moves = animated("translate", path(xy, ";"), film.seconds)
    turns = animated("rotate", ";".join(f"{angle:.0f}" for angle in turned), film.seconds)
    box = f'<rect {paint} x="{-length / 2:.1f}" y="{-width / 2:.1f}" width="{length:.1f}" height="{width:.1f}" rx="2"/>'
    return f"<g>{moves}<g>{turns}{box}</g>{label}</g>"


def road_shapes(road: Road, place: Callable[[Floats], Floats]) -> Iterator[str]:
    """Yield the lanes of a road and their markings; `place` turns metres into pixels."""
    if road.lanes is None:
        return
    for lane in road.lanes.lanes:
        outline = place(np.concatenate([lane.left, lane.right[::-1]]))
        yield f'<path class="road" d="M{path(outline)}Z"/>'
    for kind, painted in markings(road.lanes).items():
        css = {"lane": " dashed", "centre": " dashed", "stop": " thick"}.get(kind.value, "")
        yield from (f'<path class="marking{css}" d="M{path(place(line))}"/>' for line in painted)


def animated(kind: str, values: str, seconds: str) -> str:
    """Return a transformation that changes with time."""
    return (
        f'<animateTransform attributeName="transform" type="{kind}" values="{values}" {seconds}/>'
    )


def waits(motion: Encounter | Scenario, at: Ints, seconds: str) -> str:
    """Return the word, seen while the vehicle stands."""
    stands = ";".join("1" if speed < STANDS_MPS else "0" for speed in motion.speed[TURNS][at])
    seen = f'<animate attributeName="opacity" calcMode="discrete" values="{stands}" {seconds}/>'
    return f'<text class="f{TURNS}" x="-14" y="20">waits{seen}</text>'


def heading(motion: Encounter | Scenario, n: int) -> Floats:
    """Return a vehicle's heading [rad]; of a recording the direction in which it last moved."""
    if isinstance(motion, Scenario):
        return motion.heading[n]
    step = np.gradient(motion.position[n], axis=0)
    moving = np.maximum.accumulate(np.where(np.hypot(*step.T) > 0.1, np.arange(len(step)), 0))
    return np.unwrap(np.arctan2(step[moving, 1], step[moving, 0]))


def speeds(encounter: Encounter, scenarios: Sequence[Scenario], clock: Floats) -> Iterator[str]:
    """Yield the speeds of the recording, thick, and of all scenarios, thin, under a cursor."""
    right, bottom = WIDTH - 8, PLOT_TOP + PLOT_HEIGHT

    def curve(time: Floats, speed: Floats) -> str:
        x, y = LEFT + (right - LEFT) * time / clock[-1], bottom - PLOT_HEIGHT * speed / MAX_MPS
        return path(np.stack([x, y], axis=-1)[::2])

    yield f'<text x="0" y="{PLOT_TOP - 12}">speeds [m/s]: recorded (thick) and of {len(scenarios)} scenarios (thin)</text>'
    for n, label in enumerate(LABELS):
        yield f'<text class="f{n}" x="{480 + 200 * n}" y="{PLOT_TOP - 12}">{label}</text>'
        yield from (
            f'<path class="thin s{n}" d="M{curve(scenario.time, scenario.speed[n])}"/>'
            for scenario in scenarios
        )
        yield f'<path class="recorded s{n}" d="M{curve(encounter.time, encounter.speed[n])}"/>'
    yield f'<path class="axis" d="M{LEFT} {PLOT_TOP}V{bottom}H{right}"/>'
    for speed in (0, 5, 10, 15):
        y = bottom + 4 - PLOT_HEIGHT * speed / MAX_MPS
        yield f'<text class="small" x="{LEFT - 6}" y="{y:.0f}" text-anchor="end">{speed}</text>'
    for time in range(0, int(clock[-1]) + 1, 5):
        x = LEFT + (right - LEFT) * time / clock[-1]
        yield f'<text class="small" x="{x:.0f}" y="{bottom + 16}" text-anchor="middle">{time} s</text>'
    moves = f'<animate attributeName="x" from="{LEFT}" to="{right}" dur="{clock[-1]:.1f}s" repeatCount="indefinite"/>'
    yield f'<rect x="{LEFT}" y="{PLOT_TOP}" width="1.5" height="{PLOT_HEIGHT}" fill="#888">{moves}</rect>'


def path(points: Iterable[Floats], separator: str = "L") -> str:
    """Return points (K, 2) in pixels as SVG has them."""
    return separator.join(f"{x:.1f} {y:.1f}" for x, y in points)


if __name__ == "__main__":
    main()

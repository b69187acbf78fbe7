# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A map as a picture (SVG): its lanes and their directions, junctions, arms, and the places where a template fits."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import islice
from xml.sax.saxutils import escape

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats, runs
from scenario_gen.numerics.plane import unit
from scenario_gen.roads import build_road, is_vector_map, Place, places, read_network, split
from scenario_gen.situation import Situation
from scenario_gen.types import DRIVERS, Encounter, LaneNetwork, Road
from scenario_gen.types.markings import markings

PLACES = 8  # that are shown
WIDE, HEAD, FOOT = (
    1200.0,
    70.0,
    45.0,
)  # pixels, of the sheet, and of the title above and the scale below
SCALES = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000)  # metres
LEGEND = (
    "green: traffic enters, red: it leaves; arrows: direction of lanes; darker: junctions; pink: cycle and bus lanes; "
    "sand: footways; red line: stop, orange: give way"
)
COLOURS = ("#2563eb", "#e2590c", "#0d9488", "#9333ea", "#c2185b", "#65780b", "#0e7490", "#7c4a21")
STYLE = (
    ".other{fill:#e7c9c5} .walk{fill:#e9e5d6} .paint.zebra{stroke-width:3} "
    "rect.ground{fill:#fff} .lane{fill:#d4d9e2} .turn{fill:#c3cad6} .in{fill:#15803d} .out{fill:#b91c1c} "
    ".box{fill:none;stroke:#0f172a;stroke-dasharray:6 4} .paint{fill:none;stroke:#64748b} .paint.arrow{fill:#64748b} "
    ".paint.lane{stroke-dasharray:9 13} .paint.centre{stroke-dasharray:9 5} .paint.stop{stroke:#b91c1c;stroke-width:3} "
    ".paint.give_way{stroke:#d97706;stroke-width:3;stroke-dasharray:4 3} text{font-family:sans-serif;fill:#0f172a}"
)


def map_picture(name: str, encounter: Encounter | None = None) -> tuple[str, list[str]]:
    """Return a map as SVG, and what is to be said of it: lanes, junctions, arms, faults, and the places for a template.

    Args:
        name: path of a vector map, or what else `build_road` takes.
        encounter: the template, the places for which are drawn; None: none are.

    Raises:
        InputError: the map cannot be read.
        RefusedError: a road that is drawn does not take the template.
    """
    if not is_vector_map(name):
        road = build_road(name, encounter)
        arms = f"{len(road.entries)} entries, {len(road.exits)} exits"
        if road.lanes is not None:
            return _picture(road.lanes, ()), [
                f"{road.name}: {road!r}, {len(road.lanes.lanes)} lanes, {arms}"
            ]
        return _picture_of_grid(road), [f"{road.name}: {road!r}, {arms}; it has no lanes to show"]
    network = read_network(split(name)[0])
    junctions = sorted({lane.junction for lane in network.lanes if lane.junction})
    arms = f"{len(network.entries)} entries, {len(network.exits)} exits"
    said = [
        f"{network.name}: {len(network.lanes)} lanes, {len(junctions)} junctions, {arms}",
        *map(str, network.notes),
    ]
    found: list[Place] = []
    if encounter is not None:
        try:
            found = list(islice(_apart(places(network, Situation.of(encounter).drivers)), PLACES))
        except RefusedError as error:
            said.append(f"no place for {encounter.name}: {error}")
        said += [
            f"place {k}: {place.where}, {_cost_in_words(place)}: --road '{split(name)[0]}{place.part}'"
            for k, place in enumerate(found, 1)
        ]
    return _picture(network, found), said


def _apart(found: Iterator[Place]) -> Iterator[Place]:
    """Yield the places that lie elsewhere than those before, which are better."""
    boxes: list[Floats] = []
    for place in found:
        if not any(
            (place.box[0] < other[1]).all() and (other[0] < place.box[1]).all() for other in boxes
        ):
            boxes.append(place.box)
            yield place


def _cost_in_words(place: Place) -> str:
    """Say how little a place resembles the template."""
    return (
        f"cost {place.cost:.1f} m² (about {np.sqrt(place.cost):.1f} m off the recording's paths)"
    )


class _Sheet:
    """A drawing in metres, y upwards, on a sheet of `WIDE` pixels."""

    def __init__(self, low: Floats, high: Floats) -> None:
        margin = 0.02 * float((high - low).max()) + 5.0
        wide = float(high[0] - low[0]) + 2.0 * margin
        above, below = HEAD / WIDE * wide, FOOT / WIDE * wide
        self.low, self.high = low - np.array([margin, below]), high + np.array([margin, above])
        self.scale = WIDE / float(self.high[0] - self.low[0])
        self.parts: list[str] = []

    def at(self, points: Floats) -> str:
        """Return points (M, 2) [m] as text."""
        x = (points[:, 0] - self.low[0]) * self.scale
        y = (self.high[1] - points[:, 1]) * self.scale
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x.tolist(), y.tolist(), strict=True))

    def shape(self, tag: str, points: Floats, **attributes: str) -> None:
        """Add a polygon or polyline."""
        named = "".join(f' {key.replace("_", "-")}="{value}"' for key, value in attributes.items())
        self.parts.append(f'<{tag} points="{self.at(points)}"{named}/>')

    def text(self, point: Floats, words: str, size: float = 12.0) -> None:
        """Add words."""
        x, y = self.at(point[None]).split(",")
        self.parts.append(f'<text x="{x}" y="{y}" font-size="{size:g}">{escape(words)}</text>')

    def svg(self, title: str) -> str:
        """Return the picture."""
        tall = (self.high[1] - self.low[1]) * self.scale
        head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDE:g} {tall:.0f}" role="img">'
        ground = f'<rect class="ground" width="{WIDE:g}" height="{tall:.0f}"/>'
        metres = next((m for m in SCALES if m * self.scale > 0.08 * WIDE), SCALES[-1])
        bar = f'<path class="paint scale" d="M20 {tall - 18:.0f}v6h{metres * self.scale:.1f}v-6"/>'
        words = [(20, 28, 18, title), (20, 48, 12, LEGEND), (26, tall - 18, 12, f"{metres} m")]
        texts = [
            f'<text x="{x}" y="{y:.0f}" font-size="{size}">{escape(text)}</text>'
            for x, y, size, text in words
        ]
        named = [f"<title>{escape(title)}</title>", f"<style>{STYLE}</style>"]
        return "\n".join([head, *named, ground, *self.parts, bar, *texts, "</svg>\n"])


def _picture(network: LaneNetwork, found: Sequence[Place]) -> str:
    corners = np.concatenate([network.box, *(place.box for place in found)])
    sheet = _Sheet(corners.min(axis=0), corners.max(axis=0))
    junctions: dict[str, list[Floats]] = defaultdict(list)
    for lane in network.others:
        sheet.shape(
            "polygon", lane.outline, **{"class": "other" if lane.open_to(DRIVERS) else "walk"}
        )
    for lane in sorted(
        network.lanes, key=lambda lane: not lane.junction
    ):  # an arm's borders lie over the ways' ends
        sheet.shape("polygon", lane.outline, **{"class": "turn" if lane.junction else "lane"})
        if lane.junction and not network.drawn:
            junctions[lane.junction].append(lane.centre.mean(axis=0))
    for marking, lines in markings(network).items():
        for line in lines:
            sheet.shape("polyline", line, **{"class": f"paint {marking}"})
    for kind, lanes, at in (("in", network.entries, 0), ("out", network.exits, -1)):
        for k in lanes:
            _arrow(sheet, network.lanes[k].centre, at, kind)
    for k, place in enumerate(found, 1):
        (x0, y0), (x1, y1) = place.box.tolist()
        sheet.shape(
            "polygon", np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]), **{"class": "box"}
        )
        for n, path in enumerate(place.paths):
            colour = COLOURS[n % len(COLOURS)]
            sheet.shape(
                "polyline",
                path,
                fill="none",
                stroke=colour,
                stroke_width="2.5",
                stroke_opacity="0.8",
            )
        sheet.text(np.array([x0, y1 + 1.0]), f"place {k}: {_cost_in_words(place)}", 14.0)
    for name, middles in junctions.items():
        sheet.text(np.mean(middles, axis=0), name)
    return sheet.svg(network.name)


def _arrow(sheet: _Sheet, line: Floats, at: int, kind: str) -> None:
    """Draw a triangle on a line (M, 2) at one of its points, in its direction."""
    at = min(at % len(line), len(line) - 2)
    step = line[at + 1] - line[at]
    ahead = step / max(float(np.hypot(*step)), 1e-9)
    left = np.array([-ahead[1], ahead[0]])
    sheet.shape(
        "polygon", line[at] + np.array([1.8 * ahead, 0.7 * left, -0.7 * left]), **{"class": kind}
    )


def _picture_of_grid(road: Road) -> str:
    """Draw the rows of drivable cells, and the entries and exits."""
    height, width = road.drivable.shape
    sheet = _Sheet(road.origin, road.origin + np.array([width, height]) * road.resolution)
    for row, (first, stop) in (
        (row, run) for row, cells in enumerate(road.drivable) for run in runs(cells)
    ):
        x0, x1 = (road.origin[0] + edge * road.resolution for edge in (first, stop))
        y0, y1 = (road.origin[1] + edge * road.resolution for edge in (row, row + 1))
        sheet.shape("polygon", np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]), fill="#d4d9e2")
    for kind, poses in (("in", road.entries), ("out", road.exits)):
        for x, y, yaw in poses:
            start = np.array((x, y))
            _arrow(sheet, np.stack([start, start + unit(float(yaw))]), 0, kind)
    return sheet.svg(road.name)

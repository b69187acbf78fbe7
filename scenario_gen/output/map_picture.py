# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Maps as SVG pictures: lanes with their directions, junctions, arms and places for a template."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
import math
from xml.sax.saxutils import escape

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Floats, runs
from scenario_gen.numerics.plane import unit, unit_left
from scenario_gen.roads import build_road, is_vector_map, Place, places, read_network, split
from scenario_gen.situation import Situation
from scenario_gen.types import DRIVERS, Encounter, LaneNetwork, Road
from scenario_gen.types.markings import markings

WIDTH_PX = 1200.0
TITLE_HEIGHT_PX = 70.0
SCALE_HEIGHT_PX = 45.0
LEGEND = (
    "green: entries, red: exits; arrows: direction of lanes; darker: junctions; "
    "pink: cycle and bus lanes; sand: footways; red line: stop, orange: give way"
)
COLOURS = ("#2563eb", "#e2590c", "#0d9488", "#9333ea", "#c2185b", "#65780b", "#0e7490", "#7c4a21")
STYLE = """
.ground{fill:#fff} .lane{fill:#d4d9e2} .turn{fill:#c3cad6} .other{fill:#e7c9c5} .walk{fill:#e9e5d6}
.in{fill:#15803d} .out{fill:#b91c1c} .box{fill:none;stroke:#0f172a;stroke-dasharray:6 4}
.path{fill:none;stroke-width:2.5;stroke-opacity:0.8}
.paint{fill:none;stroke:#64748b} .paint.arrow,.paint.obstacle{fill:#64748b}
.paint.zebra{stroke-width:3}
.paint.lane{stroke-dasharray:9 13} .paint.centre{stroke-dasharray:9 5}
.paint.stop{stroke:#b91c1c;stroke-width:3}
.paint.give_way{stroke:#d97706;stroke-width:3;stroke-dasharray:4 3}
text{font-family:sans-serif;fill:#0f172a}
"""


def map_picture(name: str, encounter: Encounter | None = None) -> tuple[str, list[str]]:
    """Return a map as SVG, and its description in lines: lanes, junctions, arms, notes, places.

    Args:
        name: path of a vector map, or a road as `build_road` accepts it.
        encounter: the template whose places are drawn; None: no places.

    Raises:
        InputError: the map cannot be read.
        RefusedError: the template does not fit the built-in road.
    """
    if not is_vector_map(name):
        road = build_road(name, encounter)
        arms = f"{len(road.entries)} entries, {len(road.exits)} exits"
        if road.lanes is None:
            return _grid_picture(road), [f"{road.name}: {road!r}, {arms}; a grid without lanes"]
        description = f"{road.name}: {road!r}, {len(road.lanes.lanes)} lanes, {arms}"
        return _network_picture(road.lanes, ()), [description]
    path = split(name)[0]
    network = read_network(path)
    junctions = {lane.junction for lane in network.lanes if lane.junction}
    lines = [
        f"{network.name}: {len(network.lanes)} lanes, {len(junctions)} junctions, "
        f"{len(network.entries)} entries, {len(network.exits)} exits",
        *map(str, network.notes),
    ]
    shown: list[Place] = []
    if encounter is not None:
        try:
            drivers = Situation.of(encounter).drivers
            shown = list(islice(_separate(places(network, drivers)), 8))
        except RefusedError as error:
            lines.append(f"no place for {encounter.name}: {error}")
        for number, place in enumerate(shown, 1):
            road_option = f"--road '{path}{place.part}'"
            lines.append(f"place {number}: {place.where}, {_cost(place)}: {road_option}")
    return _network_picture(network, shown), lines


def _separate(candidates: Iterable[Place]) -> Iterator[Place]:
    """Yield the places that overlap no earlier one; earlier ones fit better."""
    boxes: list[Floats] = []
    for place in candidates:
        low, high = place.box
        if not any((low < box[1]).all() and (box[0] < high).all() for box in boxes):
            boxes.append(place.box)
            yield place


def _cost(place: Place) -> str:
    """Return the cost of a place as text."""
    deviation = math.sqrt(place.cost)
    return f"cost {place.cost:.1f} m² (about {deviation:.1f} m off the recorded paths)"


class _Drawing:
    """An SVG drawing in metres, y upwards, with a title above and a scale below."""

    def __init__(self, low: Floats, high: Floats) -> None:
        """Create a drawing of the rectangle between two corners (2,) [m]."""
        margin = 0.02 * float((high - low).max()) + 5.0
        self._west = float(low[0]) - margin
        self._scale = WIDTH_PX / (float(high[0]) + margin - self._west)
        self._north = float(high[1]) + margin + TITLE_HEIGHT_PX / self._scale
        south = float(low[1]) - margin - SCALE_HEIGHT_PX / self._scale
        self._height_px = (self._north - south) * self._scale
        self._parts: list[str] = []

    def _pixels(self, points: Floats) -> Floats:
        """Return the pixels (M, 2) of points (M, 2) [m]."""
        return (points - (self._west, self._north)) * (self._scale, -self._scale)

    def polygon(self, points: Floats, css_class: str) -> None:
        """Add a polygon (M, 2) [m]."""
        self._shape("polygon", points, css_class)

    def polyline(self, points: Floats, css_class: str, colour: str = "") -> None:
        """Add a line (M, 2) [m]."""
        self._shape("polyline", points, css_class, f' stroke="{colour}"' if colour else "")

    def _shape(self, tag: str, points: Floats, css_class: str, attributes: str = "") -> None:
        pixels = " ".join(f"{x:.1f},{y:.1f}" for x, y in self._pixels(points).tolist())
        self._parts.append(f'<{tag} points="{pixels}" class="{css_class}"{attributes}/>')

    def rectangle(self, low: Floats, high: Floats, css_class: str) -> None:
        """Add a rectangle between two corners (2,) [m]."""
        (x0, y0), (x1, y1) = low, high
        self.polygon(np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]), css_class)

    def arrow(self, edge: Floats, css_class: str) -> None:
        """Add a triangle at the start of an edge (2, 2) [m], in its direction."""
        tail, head = edge
        dx, dy = head - tail
        yaw = math.atan2(dy, dx)
        half_base = 0.7 * unit_left(yaw)
        corners = np.stack([1.8 * unit(yaw), half_base, -half_base])
        self.polygon(tail + corners, css_class)

    def text(self, point: Floats, text: str, size: float = 12.0) -> None:
        """Add text at a point (2,) [m]."""
        x, y = self._pixels(point)
        self._text_at(float(x), float(y), text, size)

    def _text_at(self, x: float, y: float, text: str, size: float) -> None:
        self._parts.append(
            f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size:g}">{escape(text)}</text>'
        )

    def svg(self, title: str) -> str:
        """Return the document with its title, legend and scale."""
        height = self._height_px
        metres = _round_number(0.08 * WIDTH_PX / self._scale)
        scale_bar = f"M20 {height - 18.0:.0f}v6h{metres * self._scale:.1f}v-6"
        self._text_at(20.0, 28.0, title, 18.0)
        self._text_at(20.0, 48.0, LEGEND, 12.0)
        self._text_at(26.0, height - 18.0, f"{metres:g} m", 12.0)
        lines = [
            '<svg xmlns="http://www.w3.org/2000/svg" role="img" '
            f'viewBox="0 0 {WIDTH_PX:g} {height:.0f}">',
            f"<title>{escape(title)}</title>",
            f"<style>{STYLE}</style>",
            f'<rect class="ground" width="{WIDTH_PX:g}" height="{height:.0f}"/>',
            *self._parts,
            f'<path class="paint scale" d="{scale_bar}"/>',
            "</svg>\n",
        ]
        return "\n".join(lines)


def _round_number(value: float) -> float:
    """Return the smallest of 1, 2, 5, 10, 20, 50, … that is not below a value."""
    power = 10.0 ** max(0, math.floor(math.log10(value)))
    return next(power * factor for factor in (1, 2, 5, 10) if power * factor >= value)


def _network_picture(network: LaneNetwork, shown: Sequence[Place]) -> str:
    """Draw lanes, markings, entries and exits, names of junctions, and places for a template."""
    corners = np.concatenate([network.box, *(place.box for place in shown)])
    drawing = _Drawing(corners.min(axis=0), corners.max(axis=0))
    for lane in network.others:
        drawing.polygon(lane.outline, "other" if lane.open_to(DRIVERS) else "walk")
    # The borders of arms are drawn above the ends of the lanes in junctions.
    for lane in sorted(network.lanes, key=lambda lane: not lane.junction):
        drawing.polygon(lane.outline, "turn" if lane.junction else "lane")
    for marking, lines in markings(network).items():
        for line in lines:
            drawing.polyline(line, f"paint {marking}")
    for k in network.entries:
        drawing.arrow(network.lanes[k].centre[:2], "in")
    for k in network.exits:
        drawing.arrow(network.lanes[k].centre[-2:], "out")
    for number, place in enumerate(shown, 1):
        low, high = place.box
        drawing.rectangle(low, high, "box")
        for n, path in enumerate(place.paths):
            drawing.polyline(path, "path", COLOURS[n % len(COLOURS)])
        drawing.text(np.array([low[0], high[1] + 1.0]), f"place {number}: {_cost(place)}", 14.0)
    for name, centre in _junction_centres(network).items():
        drawing.text(centre, name)
    return drawing.svg(network.name)


def _junction_centres(network: LaneNetwork) -> dict[str, Floats]:
    """Return the centre (2,) [m] of each named junction; those of built-in roads have no names."""
    centres: dict[str, list[Floats]] = defaultdict(list)
    for lane in network.lanes:
        if lane.junction and not network.drawn:
            centres[lane.junction].append(lane.centre.mean(axis=0))
    return {name: np.mean(group, axis=0) for name, group in centres.items()}


def _grid_picture(road: Road) -> str:
    """Draw the runs of drivable cells in each row of a grid, and the entries and exits."""
    height, width = road.drivable.shape
    drawing = _Drawing(road.origin, road.origin + np.array([width, height]) * road.resolution)
    for row, cells in enumerate(road.drivable):
        for first, stop in runs(cells):
            low = road.origin + np.array([first, row]) * road.resolution
            high = road.origin + np.array([stop, row + 1]) * road.resolution
            drawing.rectangle(low, high, "lane")
    for css_class, poses in (("in", road.entries), ("out", road.exits)):
        for pose in poses:
            edge = np.stack([pose[:2], pose[:2] + unit(float(pose[2]))])
            drawing.arrow(edge, css_class)
    return drawing.svg(road.name)

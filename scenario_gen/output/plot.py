# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Plots of results, scenarios and encounters with matplotlib (extra `plot`)."""

from collections.abc import Iterable, Iterator, Sequence
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw

from scenario_gen.base.errors import InputError, needs, RefusedError
from scenario_gen.base.working_directory import ignored
from scenario_gen.numerics import Floats
from scenario_gen.roads import build_road, is_vector_map, Place, places, read_network, split
from scenario_gen.situation import Situation
from scenario_gen.types import (
    DRIVERS,
    Encounter,
    GenerationResult,
    LaneNetwork,
    Motion,
    Road,
)
from scenario_gen.types.markings import Marking, markings

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FRAME_PERIOD_S = 0.1  # of animations
_MAX_SCENARIOS_COUNT = 200  # more would hide each other
_MAX_PLACES_COUNT = 8
_LEGEND = "green arrows: entries, red: exits; red lines: stop, orange: give way"
_PAINT = {Marking.STOP: "#b91c1c", Marking.GIVE_WAY: "#d97706"}


def _load_matplotlib() -> None:
    """Import matplotlib without the file `matplotlibrc` of the working directory."""
    needs("plot", "matplotlib")
    with ignored():
        import matplotlib  # noqa: F401


def plot(
    shown: GenerationResult | Motion | Road,
    ax: "Axes | None" = None,
    *,
    road: Road | None = None,
) -> "Axes":
    """Draw the paths of all vehicles, one colour per vehicle, with a dot at the start.

    Args:
        shown: a result (its first 200 scenarios, on its road), a scenario, an encounter, or a
            road alone.
        ax: the axes to draw on; None: new axes.
        road: the road to draw below a scenario or an encounter.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    _load_matplotlib()
    import matplotlib.pyplot as plt

    axes = plt.subplots()[1] if ax is None else ax
    motions: Sequence[Motion] = ()
    if isinstance(shown, Road):
        title, road = shown.name, shown
    elif isinstance(shown, Motion):
        title, motions = shown.title, [shown]
    else:
        motions = shown.generated.scenarios[:_MAX_SCENARIOS_COUNT]
        road = road or shown.road
        title = f"{len(shown)} scenarios, {shown.title}"
        if len(shown) > _MAX_SCENARIOS_COUNT:
            title += f" (the first {_MAX_SCENARIOS_COUNT})"
    if road is not None:
        _draw_road(axes, road)
    paths = _draw_paths(axes, motions)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title=title)
    if paths:
        points = np.concatenate(paths)
        west, south = points.min(axis=0) - 5.0
        east, north = points.max(axis=0) + 5.0
        axes.set(xlim=(west, east), ylim=(south, north))
        for line in axes.legend().get_lines():
            line.set_alpha(1.0)
    return axes


def animate(shown: Motion, file: Path | str, *, road: Road | None = None) -> Path:
    """Write an animated GIF: paths, and footprints that move along them in real time.

    Args:
        shown: a scenario or an encounter.
        file: the file to write, with the suffix .gif.
        road: the road to draw below it.

    Raises:
        InputError: the file has another suffix.
        MissingExtraError: matplotlib is not installed.
    """
    path = Path(file)
    if path.suffix.lower() != ".gif":
        raise InputError(f"{path}: an animation is a .gif file")
    _load_matplotlib()
    from matplotlib.colors import to_hex
    from matplotlib.figure import Figure

    figure, ground = Figure(), BytesIO()
    axes = plot(shown, figure.add_subplot(), road=road)
    figure.savefig(ground, dpi=figure.dpi)
    film = shown.with_trailers().resampled(_FRAME_PERIOD_S)
    picture = Image.open(ground).convert("RGB").quantize()
    frames = []
    for k in range(len(film.time)):
        frame = picture.copy()
        canvas = ImageDraw.Draw(frame)
        for n, box in enumerate(film.footprints(k)):
            x, y = axes.transData.transform(box).T
            if film.is_present[n, k]:
                corners = np.stack([x, frame.height - y], axis=-1)
                canvas.polygon([*map(tuple, corners.tolist())], fill=to_hex(f"C{n}"))
        frames.append(frame)
    period_ms = round(1000 * _FRAME_PERIOD_S)
    frames[0].save(path, append_images=frames[1:], save_all=True, duration=period_ms, loop=0)
    return path


def draw_map(name: str, file: Path, encounter: Encounter | None = None) -> list[str]:
    """Write a picture of a map; return its description: lanes, junctions, arms, notes, places.

    Args:
        name: path of a vector map, or a road as `build_road` accepts it.
        file: the picture, with a suffix that matplotlib knows.
        encounter: the template whose places are drawn; None: no places.

    Raises:
        InputError: the map cannot be read.
        RefusedError: the template does not fit the built-in road.
        MissingExtraError: matplotlib is not installed.
    """
    _load_matplotlib()
    from matplotlib.figure import Figure

    figure = Figure(figsize=(16.0, 12.0), layout="constrained")
    axes = figure.add_subplot()
    if is_vector_map(name):
        path = split(name)[0]
        network = read_network(path)
        _draw_lanes(axes, network)
        title, lines = network.name, _describe_network(network)
        if encounter is not None:
            lines += _draw_places(axes, network, path, encounter)
    else:
        road = build_road(name, encounter)
        plot(road, axes)
        title, lanes = road.name, "a grid without lanes"
        if road.lanes is not None:
            _draw_lanes(axes, road.lanes)
            ends = f"{len(road.entries)} entries, {len(road.exits)} exits"
            lanes = f"{len(road.lanes.lanes)} lanes, {ends}"
        lines = [f"{road.name}: {road!r}, {lanes}"]
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title=f"{title}\n{_LEGEND}")
    figure.savefig(file)
    return lines


def _describe_network(network: LaneNetwork) -> list[str]:
    junctions = {lane.junction for lane in network.lanes if lane.junction}
    return [
        f"{network.name}: {len(network.lanes)} lanes, {len(junctions)} junctions, "
        f"{len(network.entries)} entries, {len(network.exits)} exits",
        *map(str, network.notes),
    ]


def _draw_lanes(axes: "Axes", network: LaneNetwork) -> None:
    """Draw lanes, markings, arrows at entries and exits, and names of junctions."""
    _draw_others(axes, network)
    for lane in network.lanes:
        colour = "#c3cad6" if lane.junction else "#d4d9e2"
        axes.fill(*lane.outline.T, color=colour, linewidth=0, zorder=0.5 if lane.junction else 0.4)
    for marking, lines in markings(network).items():
        for line in lines:
            axes.plot(*line.T, color=_PAINT.get(marking, "#64748b"), linewidth=1.0, zorder=0.7)
    _draw_arrows(axes, [network.lanes[k].centre[:2] for k in network.entries], "#15803d")
    _draw_arrows(axes, [network.lanes[k].centre[-2:] for k in network.exits], "#b91c1c")
    for name in {lane.junction for lane in network.lanes if lane.junction and not network.drawn}:
        inside = [lane.centre.mean(axis=0) for lane in network.lanes if lane.junction == name]
        x, y = np.mean(inside, axis=0)
        axes.text(x, y, name)


def _draw_arrows(axes: "Axes", arrows: Sequence[Floats], colour: str) -> None:
    """Draw arrows, each from a point to another (2, 2) [m]."""
    for tail, head in arrows:
        shape = {"arrowstyle": "-|>", "color": colour, "mutation_scale": 15}
        axes.annotate("", head, tail, arrowprops=shape)


def _draw_places(
    axes: "Axes", network: LaneNetwork, path: Path, encounter: Encounter
) -> list[str]:
    """Draw a template's eight best places that do not overlap; return a line on each."""
    try:
        suitable = places(network, Situation.of(encounter).tracks)
        shown = list(islice(_separate(suitable), _MAX_PLACES_COUNT))
    except RefusedError as error:
        return [f"no place for {encounter.name}: {error}"]
    lines = []
    for number, place in enumerate(shown, 1):
        for n, drive in enumerate(place.paths):
            axes.plot(*drive.T, color=f"C{n}", linewidth=2.0, alpha=0.8)
        (west, south), (east, north) = place.box
        box = [(west, east, east, west, west), (south, south, north, north, south)]
        axes.plot(*box, color="black", linestyle="--", linewidth=1.0)
        cost = f"cost {place.cost:.1f} m² (about {place.cost**0.5:.1f} m off the recorded paths)"
        axes.text(west, north, f"place {number}: {cost}", verticalalignment="bottom")
        lines.append(f"place {number}: {place.where}, {cost}: --road '{path}{place.part}'")
    return lines


def _separate(candidates: Iterable[Place]) -> Iterator[Place]:
    """Yield the places that overlap no earlier one; earlier ones fit better."""
    boxes: list[Floats] = []
    for place in candidates:
        low, high = place.box
        if not any((low < box[1]).all() and (box[0] < high).all() for box in boxes):
            boxes.append(place.box)
            yield place


def _draw_paths(axes: "Axes", motions: Sequence[Motion]) -> list[Floats]:
    """Draw the paths of all vehicles; return them, (P, 2) [m]."""
    opacity = max(0.1, 1.0 / np.sqrt(max(len(motions), 1)))
    paths = []
    for k, motion in enumerate(each.with_trailers() for each in motions):
        for n, vehicle in enumerate(motion.vehicles):
            path = motion.position[n, motion.is_present[n]]
            label = f"vehicle {vehicle.id}" if k == 0 else "_"
            axes.plot(*path.T, color=f"C{n}", alpha=opacity, label=label)
            axes.plot(*path[0], "o", color=f"C{n}", markersize=4)
            paths.append(path)
    return paths


def _draw_road(axes: "Axes", road: Road) -> None:
    """Draw drivable cells in grey, lanes closed to cars, crossings and obstacles."""
    height, width = (cells * road.resolution for cells in road.drivable.shape)
    x, y = road.origin
    axes.imshow(
        np.where(road.drivable, 0.85, np.nan),
        cmap="gray",
        vmin=0.0,
        vmax=1.0,
        origin="lower",
        extent=(x, x + width, y, y + height),
        zorder=0,
    )
    if road.lanes is None:
        return
    _draw_others(axes, road.lanes)
    marked = markings(road.lanes)
    for bar in marked.get(Marking.ZEBRA, ()):
        axes.plot(*bar.T, color="white", linewidth=1.5, zorder=0.6)
    for outline in marked.get(Marking.OBSTACLE, ()):
        axes.fill(*outline.T, color="0.4", zorder=0.6, linewidth=0)


def _draw_others(axes: "Axes", network: LaneNetwork) -> None:
    """Draw the lanes that are closed to cars."""
    for lane in network.others:
        if not lane.crossing:
            colour = "#d9a9a2" if lane.open_to(DRIVERS) else "#e9e5d6"
            axes.fill(*lane.outline.T, color=colour, zorder=-0.5, linewidth=0)

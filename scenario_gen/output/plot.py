# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Plots of results, scenarios and encounters with matplotlib (extra `plot`)."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw

from scenario_gen.base.errors import InputError, needs
from scenario_gen.numerics import Floats
from scenario_gen.types import DRIVERS, GenerationResult, Motion, Road
from scenario_gen.types.markings import Marking, markings

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FRAME_PERIOD_S = 0.1  # of animations
_MAX_SCENARIOS_COUNT = 200  # more would hide each other


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
    needs("plot", "matplotlib")
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
    needs("plot", "matplotlib")
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
    for lane in road.lanes.others:
        if not lane.crossing:
            colour = "#d9a9a2" if lane.open_to(DRIVERS) else "#e9e5d6"
            axes.fill(*lane.outline.T, color=colour, zorder=-0.5, linewidth=0)
    marked = markings(road.lanes)
    for bar in marked.get(Marking.ZEBRA, ()):
        axes.plot(*bar.T, color="white", linewidth=1.5, zorder=0.6)
    for outline in marked.get(Marking.OBSTACLE, ()):
        axes.fill(*outline.T, color="0.4", zorder=0.6, linewidth=0)

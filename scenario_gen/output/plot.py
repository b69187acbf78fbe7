# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Plots of results, scenarios and encounters with matplotlib (extra `plot`)."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from scenario_gen.base.errors import needs
from scenario_gen.numerics import Floats
from scenario_gen.types import DRIVERS, GenerationResult, Motion, Road
from scenario_gen.types.markings import Marking, markings

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MAX_SCENARIOS_COUNT = 200  # more would hide each other


def plot(
    shown: GenerationResult | Motion,
    ax: "Axes | None" = None,
    *,
    road: Road | None = None,
) -> "Axes":
    """Draw the paths of all vehicles, one colour per vehicle, with a dot at the start.

    Args:
        shown: a result (its first 200 scenarios, on its road), a scenario, or an encounter.
        ax: the axes to draw on; None: new axes.
        road: the road to draw below a scenario or an encounter.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    needs("plot", "matplotlib")
    import matplotlib.pyplot as plt

    axes = plt.subplots()[1] if ax is None else ax
    title = shown.title
    if isinstance(shown, Motion):
        motions: Sequence[Motion] = [shown]
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


def _draw_paths(axes: "Axes", motions: Sequence[Motion]) -> list[Floats]:
    """Draw the paths of all vehicles; return them, (P, 2) [m]."""
    opacity = max(0.1, 1.0 / np.sqrt(max(len(motions), 1)))
    paths = []
    for k, motion in enumerate(motions):
        for n, vehicle in enumerate(motion.vehicles):
            path = motion.position[n, motion.is_present[n]]
            label = f"vehicle {vehicle.id}" if k == 0 else "_"
            axes.plot(*path.T, color=f"C{n}", alpha=opacity, label=label)
            axes.plot(*path[0], "o", color=f"C{n}", markersize=4)
            paths.append(path)
    return paths


def _draw_road(axes: "Axes", road: Road) -> None:
    """Draw the drivable cells of a road in grey, lanes closed to cars, and crossings."""
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
    for bar in markings(road.lanes).get(Marking.ZEBRA, ()):
        axes.plot(*bar.T, color="white", linewidth=1.5, zorder=0.6)

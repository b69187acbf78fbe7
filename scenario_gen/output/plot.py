# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Results, scenarios and encounters drawn from above with matplotlib (extra `plot`)."""

from collections.abc import Sequence
from typing import Any, TYPE_CHECKING

import numpy as np

from scenario_gen.base.errors import needs
from scenario_gen.types import DRIVERS, GenerationResult, Motion, Road
from scenario_gen.types.markings import Marking, markings

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MAX_SCENARIOS = 200  # scenarios drawn: with more, one hides the other


def plot(
    shown: GenerationResult | Motion,
    ax: "Axes | None" = None,
    *,
    road: Road | None = None,
) -> "Axes":
    """Draw the paths of all vehicles from above, each vehicle in a colour of its own; a dot is where it starts.

    Args:
        shown: a result (its first 200 scenarios, on its road), one scenario, or a recorded encounter.
        ax: what to draw on; None: the axes of a new figure.
        road: drawn below a scenario or an encounter.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    needs("plot", "matplotlib")
    import matplotlib.pyplot as plt

    axes = plt.subplots()[1] if ax is None else ax
    drawn: Sequence[Motion] = (
        list(shown)[:_MAX_SCENARIOS] if isinstance(shown, GenerationResult) else [shown]
    )
    road = shown.road if isinstance(shown, GenerationResult) and road is None else road
    if road is not None:
        _draw_road(axes, road)
    limits: list[Any] = []
    for k, scenario in enumerate(drawn):
        for n, vehicle in enumerate(scenario.vehicles):
            path = scenario.position[n, scenario.is_present[n]]
            label = f"vehicle {vehicle.id}" if k == 0 else "_"
            axes.plot(
                *path.T, color=f"C{n}", alpha=max(0.1, 1.0 / np.sqrt(len(drawn))), label=label
            )
            axes.plot(*path[0], "o", color=f"C{n}", markersize=4)
            limits.append([path.min(axis=0), path.max(axis=0)])
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title=_title(shown))
    if limits:
        low, high = (
            np.min([low for low, _ in limits], axis=0) - 5.0,
            np.max([high for _, high in limits], axis=0) + 5.0,
        )
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        legend = axes.legend()
        for line in legend.get_lines():
            line.set_alpha(1.0)
    return axes


def _draw_road(axes: "Axes", road: Road) -> None:
    """Draw the drivable cells of a road in grey, and what is painted for others than cars: their lanes, the bars of crossings."""
    height, width = (cells * road.resolution for cells in road.drivable.shape)
    x, y = road.origin
    shade = np.where(road.drivable, 0.85, np.nan)
    axes.imshow(
        shade,
        cmap="gray",
        vmin=0.0,
        vmax=1.0,
        origin="lower",
        extent=(x, x + width, y, y + height),
        zorder=0,
    )
    for lane in (
        (lane for lane in road.lanes.others if not lane.crossing) if road.lanes is not None else ()
    ):
        axes.fill(
            *lane.outline.T,
            color="#d9a9a2" if lane.open_to(DRIVERS) else "#e9e5d6",
            zorder=-0.5,
            linewidth=0,
        )
    for bar in markings(road.lanes).get(Marking.ZEBRA, ()) if road.lanes is not None else ():
        axes.plot(*bar.T, color="white", linewidth=1.5, zorder=0.6)


def _title(shown: GenerationResult | Motion) -> str:
    if isinstance(shown, GenerationResult):
        return f"{len(shown)} scenarios, {shown.title}" + (
            f" (the first {_MAX_SCENARIOS})" if len(shown) > _MAX_SCENARIOS else ""
        )
    return shown.title

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Figures 2 to 5 of the paper, drawn with plotly."""

from itertools import pairwise
from typing import Any

import numpy as np
from PIL import Image
import plotly.express as px
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from benchmarks._paper_measure import PaperCase, Regressions
from benchmarks._reference_sets import WITHOUT
from scenario_gen.method.evaluation import mean_feature
from scenario_gen.numerics import Floats
from scenario_gen.types import Road, WITH

VEHICLES = ("#2563eb", "#e2590c", "#0d9488", "#9333ea", "#c2185b", "#65780b")
PRIMITIVES = px.colors.qualitative.T10
SAMPLES_COUNT, CURVE_POINTS_COUNT, MATRIX_COUNT = 50, 90, 60
"""Samples in a figure, points of a curve, and the side of a heat map."""
ROAD_PIXELS_COUNT = 250


def colour(n: int) -> str:
    """Colour of vehicle n."""
    return VEHICLES[n % len(VEHICLES)]


def figure_2(found: Regressions) -> go.Figure:
    """Draw the ground truth with training data, and ten samples under each prior."""
    panels = make_subplots(1, 4, subplot_titles=["ground truth", *found.priors])
    panels.update_xaxes(title_text="x [cells]")
    panels.update_yaxes(title_text="y [cells]", col=1)
    low, high = float(found.truth.min()), float(found.truth.max())
    room = max(0.4 * (high - low), 40.0)
    for column, prior in enumerate([None, *found.priors.values()], start=1):
        curves = np.array([found.truth] if prior is None else [found.truth, *prior.samples])
        for curve in curves[1:]:
            _line(panels, found.x, curve, (1, column), width=1, color="#60a5fa")
        _line(panels, found.x, found.truth, (1, column), color="black")
        _marks(panels, found.training, (1, column), color="red")
        limits = [min(low - room, float(curves.min())), max(high + room, float(curves.max()))]
        panels.update_yaxes(range=limits, col=column)
    return _finished(panels, 320)


def figure_3(case: PaperCase) -> go.Figure:
    """Draw paths and speeds of the template, coloured by primitive."""
    encounter, labels = case.encounter, case.segmentation.labels
    edges = [0, *case.segmentation.changepoints.tolist(), len(encounter.time) - 1]
    panels = make_subplots(1, 2, subplot_titles=["trajectory", "speed"])
    for n in range(len(encounter.vehicles)):
        path = encounter.position[n]
        profile = np.column_stack([encounter.time, encounter.speed[n]])
        for k, (a, b) in enumerate(pairwise(edges)):
            shade = PRIMITIVES[int(labels[a]) % len(PRIMITIVES)]
            symbol = "circle" if k == 0 else "triangle-up"
            for column, curve in ((1, path), (2, profile)):
                part = curve[a : b + 1]
                _line(panels, part[:, 0], part[:, 1], (1, column), color=shade, width=3)
                style = {"symbol": symbol, "size": 8, "color": colour(n)}
                _marks(panels, part[:1], (1, column), **style)
        _marks(panels, path[-1:], (1, 1), symbol="x", size=8, color=colour(n))
    panels.update_xaxes(title_text="east [m]", col=1)
    panels.update_yaxes(title_text="north [m]", scaleanchor="x", col=1)
    panels.update_xaxes(title_text="time [s]", col=2)
    panels.update_yaxes(title_text="speed [m/s]", rangemode="tozero", col=2)
    return _finished(panels, 360)


def figure_4(case: PaperCase) -> go.Figure:
    """Draw the template, and the scenarios with and without changepoints."""
    encounter = case.encounter
    sets = {"template": (encounter.position[None], encounter.speed[None])}
    for name in (WITH, WITHOUT):
        if name in case.arms:
            arm = case.arms[name]
            sets[name] = arm.position[:SAMPLES_COUNT], arm.speed[:SAMPLES_COUNT]
    panels = make_subplots(2, len(sets), subplot_titles=list(sets), vertical_spacing=0.12)
    for column, (position, speed) in enumerate(sets.values(), start=1):
        if column > 1 and case.road is not None:
            _lay(panels, case.road, column)
        for n in range(len(encounter.vehicles)):
            style: dict[str, Any] = {"opacity": 0.4 if column > 1 else 1.0, "color": colour(n)}
            path, time = position[:, n], np.broadcast_to(encounter.time, speed[:, n].shape)
            _line(panels, path[..., 0], path[..., 1], (1, column), width=1, **style)
            _line(panels, time, speed[:, n], (2, column), width=1, **style)
        if column > 1:
            panels.update_xaxes(range=[0, 1000], row=1, col=column)
            panels.update_yaxes(range=[0, 1000], row=1, col=column)
        panels.update_yaxes(scaleanchor="x" if column == 1 else f"x{column}", row=1, col=column)
    panels.update_xaxes(title_text="time [s]", row=2)
    panels.update_yaxes(title_text="m/s, cells/s", row=2, col=1, rangemode="tozero")
    return _finished(panels, 640)


def figure_5(case: PaperCase) -> go.Figure:
    """Draw the mean feature matrices of the first two vehicles."""
    encounter = case.encounter
    keep = np.linspace(0, len(encounter.time) - 1, MATRIX_COUNT).round().astype(np.int64)
    sets = {"template": (encounter.position[None], encounter.speed[None])}
    sets |= {name: (arm.position, arm.speed) for name, arm in case.arms.items()}
    panels = make_subplots(2, len(sets), subplot_titles=list(sets), vertical_spacing=0.08)
    axis = np.round(encounter.time[keep], 2).tolist()
    for column, (position, speed) in enumerate(sets.values(), start=1):
        paths = [np.ascontiguousarray(np.swapaxes(position[:, n][:, keep], 1, 2)) for n in (0, 1)]
        speeds = [np.ascontiguousarray(speed[:, n][:, None, keep]) for n in (0, 1)]
        matrices = (
            mean_feature(paths[0], paths[1], "euclidean"),
            mean_feature(speeds[0], speeds[1], "manhattan"),
        )
        for row, matrix in enumerate(matrices, start=1):
            panels.add_heatmap(
                z=np.round(matrix, 3).tolist(),
                x=axis,
                y=axis,
                row=row,
                col=column,
                zmin=0,
                zmax=1,
                colorscale="RdYlBu_r",
                showscale=False,
            )
    panels.update_yaxes(title_text="position: time [s]", row=1, col=1)
    panels.update_yaxes(title_text="speed: time [s]", row=2, col=1)
    return _finished(panels, 480)


def _finished(figure: go.Figure, height: int) -> go.Figure:
    margin = {"l": 50, "r": 10, "t": 40, "b": 45}
    figure.update_layout(height=height, showlegend=False, margin=margin, template="plotly_white")
    return figure


def _lay(panels: go.Figure, road: Road, column: int) -> None:
    """Lay the road under the paths of a panel, as a small picture."""
    grey = np.where(road.drivable[::-1], 226, 255).astype(np.uint8)
    step = max(1, grey.shape[0] // ROAD_PIXELS_COUNT)
    height, width = road.drivable.shape
    place = {"xref": f"x{column}", "yref": f"y{column}", "x": 0, "y": height}
    panels.add_layout_image(
        source=Image.fromarray(grey[::step, ::step]),
        sizex=width,
        sizey=height,
        sizing="stretch",
        layer="below",
        **place,
    )


def _line(
    panels: go.Figure,
    x: Floats,
    y: Floats,
    at: tuple[int, int],
    opacity: float | None = None,
    **line: Any,
) -> None:
    """Draw a curve (T,), or curves (S, T) as one trace with gaps, in the panel (row, column)."""
    gap = [] if x.ndim == 1 else [None]
    xs, ys = (
        [value for curve in np.atleast_2d(curves) for value in (*_few(curve), *gap)]
        for curves in (x, y)
    )
    panels.add_scatter(x=xs, y=ys, mode="lines", line=line, opacity=opacity, row=at[0], col=at[1])


def _marks(panels: go.Figure, points: Floats, at: tuple[int, int], **marker: Any) -> None:
    """Mark points (M, 2) in the panel (row, column)."""
    x, y = points.T.tolist()
    panels.add_scatter(x=x, y=y, mode="markers", marker=marker, row=at[0], col=at[1])


def _few(values: Floats) -> list[float]:
    """Return at most CURVE_POINTS_COUNT of the values, evenly spread and rounded."""
    count = min(len(values), CURVE_POINTS_COUNT)
    keep = np.linspace(0, len(values) - 1, count).round().astype(np.int64)
    return [round(float(value), 2) for value in values[keep]]

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Figures 2 to 5 of the paper, drawn with plotly."""

from base64 import b64encode
import io
from itertools import pairwise
from typing import Any

import numpy as np
from PIL import Image
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from benchmarks._paper_measure import PaperCase, Regressions
from scenario_gen.method.evaluation import mean_feature
from scenario_gen.numerics import Floats
from scenario_gen.types import Road, WITH, WITHOUT

VEHICLES = ("#2563eb", "#e2590c", "#0d9488", "#9333ea", "#c2185b", "#65780b")
PRIMITIVES = (
    "#4e79a7",
    "#f28e2b",
    "#59a14f",
    "#e15759",
    "#b07aa1",
    "#edc948",
    "#76b7b2",
    "#ff9da7",
    "#9c755f",
    "#79706e",
)
HEAT = (
    "#313695",
    "#4575b4",
    "#74add1",
    "#abd9e9",
    "#ffffbf",
    "#fdae61",
    "#f46d43",
    "#d73027",
    "#a50026",
)
DRAWN = 50  # samples
POINTS = 90  # of a curve
MATRIX = 60  # side of a heat map
ROAD_PIXELS = 250


def colour(n: int) -> str:
    """Colour of vehicle n."""
    return VEHICLES[n % len(VEHICLES)]


def figure_2(found: Regressions) -> go.Figure:
    """Ground truth with training data, and ten samples under each prior."""
    titles = [
        "(a) ground truth",
        *(f"({k}) {n}" for k, n in zip("bcd", found.priors, strict=True)),
    ]
    panels = make_subplots(1, 4, subplot_titles=titles)
    panels.update_xaxes(title_text="x [cells]")
    panels.update_yaxes(title_text="y [cells]", col=1)
    low, high = float(found.truth.min()), float(found.truth.max())
    room = max(0.4 * (high - low), 40.0)
    for column, prior in enumerate([None, *found.priors.values()], start=1):
        samples = [] if prior is None else list(prior.samples)
        for curve in samples:
            _line(panels, found.x, curve, (1, column), width=1, color="#60a5fa")
        _line(panels, found.x, found.truth, (1, column), color="black")
        _marks(panels, found.training, (1, column), color="red")
        curves = [found.truth, *samples]
        least, most = (
            min(float(curve.min()) for curve in curves),
            max(float(curve.max()) for curve in curves),
        )
        panels.update_yaxes(range=[min(low - room, least), max(high + room, most)], col=column)
    return _finished(panels, 320)


def figure_3(case: PaperCase) -> go.Figure:
    """Paths and speeds of the template, coloured by primitive."""
    encounter, edges = (
        case.encounter,
        [0, *case.segmentation.changepoints.tolist(), len(case.encounter.time) - 1],
    )
    panels = make_subplots(1, 2, subplot_titles=["trajectory", "speed"])
    for n in range(len(encounter.vehicles)):
        for k, (a, b) in enumerate(pairwise(edges)):
            shade = PRIMITIVES[int(case.segmentation.labels[a]) % len(PRIMITIVES)]
            xy, time, speed = (
                values[a : b + 1]
                for values in (encounter.position[n], encounter.time, encounter.speed[n])
            )
            symbol = "circle" if k == 0 else "triangle-up"
            _line(panels, xy[:, 0], xy[:, 1], (1, 1), color=shade, width=3)
            _line(panels, time, speed, (1, 2), color=shade, width=3)
            _marks(panels, xy[:1], (1, 1), symbol=symbol, size=8, color=colour(n))
            _marks(
                panels,
                np.column_stack([time, speed])[:1],
                (1, 2),
                symbol=symbol,
                size=8,
                color=colour(n),
            )
        _marks(panels, encounter.position[n, -1:], (1, 1), symbol="x", size=8, color=colour(n))
    panels.update_xaxes(title_text="east [m]", col=1)
    panels.update_yaxes(title_text="north [m]", scaleanchor="x", col=1)
    panels.update_xaxes(title_text="time [s]", col=2)
    panels.update_yaxes(title_text="speed [m/s]", rangemode="tozero", col=2)
    return _finished(panels, 360)


def figure_4(case: PaperCase) -> go.Figure:
    """The template, and what was generated from it with and without changepoints: paths above, speeds below."""
    names = [name for name in (WITH, WITHOUT) if name in case.arms]
    panels = make_subplots(
        2, 1 + len(names), subplot_titles=["template", *names], vertical_spacing=0.12
    )
    encounter = case.encounter
    for n in range(len(encounter.vehicles)):
        _line(
            panels,
            encounter.position[n, :, 0],
            encounter.position[n, :, 1],
            (1, 1),
            color=colour(n),
            width=2,
        )
        _line(panels, encounter.time, encounter.speed[n], (2, 1), color=colour(n), width=2)
    panels.update_yaxes(scaleanchor="x", row=1, col=1)
    for column, name in enumerate(names, start=2):
        arm = case.arms[name]
        if case.road is not None:
            _lay(panels, case.road, column)
        for n in range(len(encounter.vehicles)):
            paths, speeds = arm.position[:DRAWN, n], arm.speed[:DRAWN, n]
            _line(
                panels,
                paths[..., 0],
                paths[..., 1],
                (1, column),
                opacity=0.4,
                color=colour(n),
                width=1,
            )
            time = np.broadcast_to(encounter.time, speeds.shape)
            _line(panels, time, speeds, (2, column), opacity=0.4, color=colour(n), width=1)
        panels.update_xaxes(range=[0, 1000], row=1, col=column)
        panels.update_yaxes(range=[0, 1000], scaleanchor=f"x{column}", row=1, col=column)
    panels.update_xaxes(title_text="time [s]", row=2)
    panels.update_yaxes(title_text="m/s, cells/s", row=2, col=1, rangemode="tozero")
    return _finished(panels, 640)


def figure_5(case: PaperCase) -> go.Figure:
    """Mean feature matrices of the first two vehicles."""
    encounter = case.encounter
    keep = np.linspace(0, len(encounter.time) - 1, MATRIX).round().astype(np.int64)
    sets = {"template": (encounter.position[None], encounter.speed[None])}
    sets |= {name: (arm.position, arm.speed) for name, arm in case.arms.items()}
    panels = make_subplots(2, len(sets), subplot_titles=list(sets), vertical_spacing=0.08)
    scale = [[i / (len(HEAT) - 1), shade] for i, shade in enumerate(HEAT)]
    for column, (position, speed) in enumerate(sets.values(), start=1):
        places = [np.ascontiguousarray(np.swapaxes(position[:, n][:, keep], 1, 2)) for n in (0, 1)]
        paces = [np.ascontiguousarray(speed[:, n][:, None, keep]) for n in (0, 1)]
        matrices = (
            mean_feature(places[0], places[1], "euclidean"),
            mean_feature(paces[0], paces[1], "manhattan"),
        )
        axis = np.round(encounter.time[keep], 2).tolist()
        for row, matrix in enumerate(matrices, start=1):
            shades = {"zmin": 0, "zmax": 1, "colorscale": scale, "showscale": False}
            panels.add_heatmap(
                z=np.round(matrix, 3).tolist(), x=axis, y=axis, row=row, col=column, **shades
            )
    panels.update_yaxes(title_text="position: time [s]", row=1, col=1)
    panels.update_yaxes(title_text="speed: time [s]", row=2, col=1)
    return _finished(panels, 480)


def _finished(figure: go.Figure, height: int) -> go.Figure:
    figure.update_layout(
        height=height,
        showlegend=False,
        margin={"l": 50, "r": 10, "t": 40, "b": 45},
        template="plotly_white",
    )
    return figure


def _lay(panels: go.Figure, road: Road, column: int) -> None:
    """Lay the road under the paths of a panel, as a small picture."""
    grey = np.where(road.drivable[::-1], 226, 255).astype(np.uint8)
    step = max(1, grey.shape[0] // ROAD_PIXELS)
    buffer = io.BytesIO()
    Image.fromarray(grey[::step, ::step]).save(buffer, format="PNG")
    source = "data:image/png;base64," + b64encode(buffer.getvalue()).decode("ascii")
    height, width = road.drivable.shape
    axis = {
        "xref": f"x{column}",
        "yref": f"y{column}",
        "x": 0,
        "y": height,
        "sizex": width,
        "sizey": height,
    }
    panels.add_layout_image(source=source, sizing="stretch", layer="below", **axis)


def _line(
    panels: go.Figure,
    x: Floats,
    y: Floats,
    at: tuple[int, int],
    opacity: float | None = None,
    **line: Any,
) -> None:
    """Draw a curve (T,), or curves (S, T) as one trace with gaps, in the panel at (row, column)."""
    ends = [] if x.ndim == 1 else [None]
    xs, ys = (
        [value for curve in np.atleast_2d(curves) for value in (*_few(curve), *ends)]
        for curves in (x, y)
    )
    panels.add_scatter(x=xs, y=ys, mode="lines", line=line, opacity=opacity, row=at[0], col=at[1])


def _marks(panels: go.Figure, points: Floats, at: tuple[int, int], **marker: Any) -> None:
    """Mark points (M, 2) in the panel at (row, column)."""
    x, y = points.T.tolist()
    panels.add_scatter(x=x, y=y, mode="markers", marker=marker, row=at[0], col=at[1])


def _few(values: Floats) -> list[float]:
    """At most POINTS of the values, evenly spread, short."""
    keep = np.linspace(0, len(values) - 1, min(len(values), POINTS)).round().astype(np.int64)
    return [round(float(value), 2) for value in values[keep]]

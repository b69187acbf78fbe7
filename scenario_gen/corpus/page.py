# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Pages about many encounters: a corpus, a library, or coverage; they work offline, without JS."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup
import numpy as np

from scenario_gen.base.folders import write_text
from scenario_gen.method.evaluation.population_result import Population
from scenario_gen.numerics import Floats
from scenario_gen.output.report.html import render_page
from scenario_gen.types import Encounter, Scenario

WIDTH_PX = 240.0
HEIGHT_PX = 160.0
BORDER_PX = 12.0
COLOURS = ("#1f6feb", "#d1242f", "#1a7f37", "#9a6700", "#8250df", "#bf3989")
MIN_EXTENT_M = 10.0  # a smaller motion is not enlarged to fill the drawing
SCALE_BAR_M = 10.0


def sketch(motion: Encounter | Scenario, span: tuple[int, int] | None = None) -> Markup:
    """Return a drawing of a motion: a line for each vehicle, with a dot at its start.

    Args:
        motion: the motion.
        span: samples (first, last) that are drawn with thick lines.
    """
    points = motion.position[motion.is_present]
    low, high = points.min(axis=0), points.max(axis=0)
    extent = max(float((high - low).max()), MIN_EXTENT_M)
    scale = min(WIDTH_PX - 2.0 * BORDER_PX, HEIGHT_PX - 2.0 * BORDER_PX) / extent
    centre = (low + high) / 2.0

    def pixels(position: Floats) -> str:
        x = WIDTH_PX / 2.0 + scale * (position[:, 0] - centre[0])
        y = HEIGHT_PX / 2.0 - scale * (position[:, 1] - centre[1])
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))

    parts = []
    for n in range(len(motion.vehicles)):
        first, last = motion.present[n].tolist()
        path = motion.position[n, first : last + 1]
        colour = COLOURS[n % len(COLOURS)]
        drawn = path[np.unique(np.linspace(0, len(path) - 1, 60).astype(int))]
        parts.append(_polyline(pixels(drawn), colour, 'stroke-width="1.5"'))
        if span is not None:
            marked = motion.position[n, max(span[0], first) : min(span[1], last + 1)]
            parts.append(_polyline(pixels(marked), colour, 'stroke-width="4" opacity="0.6"'))
        x, y = pixels(path[:1]).split(",")
        parts.append(f'<circle cx="{x}" cy="{y}" r="3.5" fill="{colour}"/>')
    bar = SCALE_BAR_M * scale
    parts.append(f'<path d="M6,{HEIGHT_PX - 6:.0f} h{bar:.1f}" stroke="#888" stroke-width="2"/>')
    parts.append(_label(f"{bar + 9:.0f}", f"{HEIGHT_PX - 3:.0f}", f"{SCALE_BAR_M:.0f} m"))
    return _drawing(parts)


def curve(population: Population) -> Markup:
    """Return a drawing of coverage by number of templates, with intervals from 5 to 95 %.

    One line is for the templates alone, the other one includes the generated scenarios.
    """
    most = max((point.templates for point in population.curve), default=1)
    width = WIDTH_PX - 2.0 * BORDER_PX
    height = HEIGHT_PX - 2.0 * BORDER_PX

    def y_of(share: float) -> str:
        return f"{BORDER_PX + height * (1.0 - share):.1f}"

    axes = f"M{BORDER_PX},{BORDER_PX} v{height} h{width}"
    parts = [f'<path d="{axes}" fill="none" stroke="#888"/>']
    lines = [
        (COLOURS[0], [point.alone for point in population.curve]),
        (COLOURS[1], [point.generated for point in population.curve]),
    ]
    x = [f"{BORDER_PX + width * point.templates / most:.1f}" for point in population.curve]
    for colour, shares in lines:
        pairs = list(zip(x, shares, strict=True))
        line = " ".join(f"{a},{y_of(share.value)}" for a, share in pairs)
        parts.append(_polyline(line, colour, 'stroke-width="2"'))
        parts += [
            f'<path d="M{a},{y_of(share.high)} V{y_of(share.low)}" stroke="{colour}"/>'
            for a, share in pairs
        ]
    legend = "1.0; red: with generated, blue: alone"
    parts.append(_label(f"{BORDER_PX + 4}", f"{BORDER_PX + 8}", legend))
    parts.append(_label(f"{WIDTH_PX - BORDER_PX - 70}", f"{HEIGHT_PX - 2}", f"{most} templates"))
    return _drawing(parts)


def _polyline(points: str, colour: str, style: str) -> str:
    return f'<polyline points="{points}" fill="none" stroke="{colour}" {style}/>'


def _label(x: str, y: str, text: str) -> str:
    return f'<text x="{x}" y="{y}" font-size="9" fill="#888">{text}</text>'


def _drawing(parts: Sequence[str]) -> Markup:
    size = f'width="{WIDTH_PX:.0f}" height="{HEIGHT_PX:.0f}"'
    return Markup(f'<svg {size} role="img">{"".join(parts)}</svg>')


def write_page(
    path: Path,
    title: str,
    lead: str,
    cards: Sequence[Mapping[str, Any]],
    notes: Sequence[str] = (),
) -> None:
    """Write a page with cards.

    Args:
        path: the file.
        title: heading.
        lead: a sentence below the heading.
        cards: each has `title`, `lines` (texts) and `pictures`.
        notes: sentences at the end.
    """
    page = render_page("corpus.html.j2", (), {}, title=title, lead=lead, cards=cards, notes=notes)
    write_text(path, page)

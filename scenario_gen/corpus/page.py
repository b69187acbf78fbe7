# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Pages about many encounters: a corpus; they work offline, without JS."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup
import numpy as np

from scenario_gen.base.folders import write_text
from scenario_gen.numerics import Floats
from scenario_gen.output.report.html import render_page
from scenario_gen.types import Encounter

WIDTH_PX = 240.0
HEIGHT_PX = 160.0
BORDER_PX = 12.0
COLOURS = ("#1f6feb", "#d1242f", "#1a7f37", "#9a6700", "#8250df", "#bf3989")
MIN_EXTENT_M = 10.0  # a smaller motion is not enlarged to fill the drawing
SCALE_BAR_M = 10.0


def sketch(motion: Encounter) -> Markup:
    """Return a drawing of a motion: a line for each vehicle, with a dot at its start."""
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
        line = pixels(drawn)
        parts.append(
            f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="1.5"/>'
        )
        x, y = pixels(path[:1]).split(",")
        parts.append(f'<circle cx="{x}" cy="{y}" r="3.5" fill="{colour}"/>')
    bar = SCALE_BAR_M * scale
    parts.append(f'<path d="M6,{HEIGHT_PX - 6:.0f} h{bar:.1f}" stroke="#888" stroke-width="2"/>')
    parts.append(
        f'<text x="{bar + 9:.0f}" y="{HEIGHT_PX - 3:.0f}" font-size="9" fill="#888">'
        f"{SCALE_BAR_M:.0f} m</text>"
    )
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

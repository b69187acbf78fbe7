# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The page about the encounters of a corpus: a table, and pictures of some; it works offline."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup
import numpy as np

from scenario_gen.base.folders import write_text
from scenario_gen.method.evaluation import EvaluationConfig
from scenario_gen.numerics import Floats
from scenario_gen.output.report.html import render_page
from scenario_gen.types import Encounter

WIDTH_PX = 240.0
HEIGHT_PX = 160.0
BORDER_PX = 12.0
COLOURS = ("#1f6feb", "#d1242f", "#1a7f37", "#9a6700", "#8250df", "#bf3989")
PAGE_COLUMNS = ("name", "kind", "count", "seconds", "pet", "ttc", "distance", "reactions")
MIN_EXTENT_M = 10.0  # a smaller motion is not enlarged to fill the drawing
SCALE_BAR_M = 10.0


def sketch(motion: Encounter) -> Markup:
    """Return a drawing of a motion: paths, and the vehicles where they are nearest."""
    points = motion.position[motion.is_present]
    low, high = points.min(axis=0), points.max(axis=0)
    extent = max(float((high - low).max()), MIN_EXTENT_M)
    scale = min(WIDTH_PX - 2.0 * BORDER_PX, HEIGHT_PX - 2.0 * BORDER_PX) / extent
    centre = (low + high) / 2.0

    def pixels(position: Floats) -> str:
        x = WIDTH_PX / 2.0 + scale * (position[:, 0] - centre[0])
        y = HEIGHT_PX / 2.0 - scale * (position[:, 1] - centre[1])
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))

    present = motion.is_present.sum(axis=0)
    spread = np.ptp(motion.position, axis=0).max(axis=-1)
    nearest = int(np.where(present == present.max(), spread, np.inf).argmin())
    outlines = motion.footprints(nearest)
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
        if motion.is_present[n, nearest]:
            parts.append(f'<polygon points="{pixels(outlines[n])}" fill="{colour}"/>')
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
    lead: str,
    rows: Sequence[Mapping[str, Any]],
    cards: Mapping[str, Sequence[Mapping[str, Any]]],
    notes: Sequence[str] = (),
) -> None:
    """Write the page of a corpus.

    Args:
        path: the file.
        lead: a sentence below the heading.
        rows: of the table of encounters; each has `PAGE_COLUMNS`.
        cards: of each kind; each card has `name`, `lines` (texts) and `picture`.
        notes: sentences at the end.
    """
    page = render_page(
        "corpus.html.j2",
        ("tables.js",),
        {},
        lead=lead,
        rows=rows,
        horizon=EvaluationConfig().ttc_horizon,
        cards=cards,
        notes=notes,
    )
    write_text(path, page)

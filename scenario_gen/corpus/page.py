# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Pages about many encounters: what was mined, and the primitives of a library; they open offline and run no script."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup
import numpy as np

from scenario_gen.base.folders import write_text
from scenario_gen.method.evaluation.population_result import Population
from scenario_gen.output.report.html import render_page
from scenario_gen.types import Encounter, Scenario

WIDTH, HEIGHT, BORDER = 240.0, 160.0, 12.0  # px
COLOURS = ("#1f6feb", "#d1242f", "#1a7f37", "#9a6700", "#8250df", "#bf3989")
POINTS = 60  # of a drawn track


def sketch(encounter: Encounter | Scenario, span: tuple[int, int] | None = None) -> Markup:
    """Return a drawing of a motion: a line for each vehicle, a dot where it begins; in `span` (samples) it is thick."""
    there = encounter.is_present
    places = encounter.position[there]
    low, high = places.min(axis=0), places.max(axis=0)
    scale = min((WIDTH - 2.0 * BORDER), (HEIGHT - 2.0 * BORDER)) / max(
        float((high - low).max()), 10.0
    )
    middle = (low + high) / 2.0

    def drawn(points: Any) -> str:
        at = (points - middle) * scale
        return " ".join(f"{WIDTH / 2.0 + x:.1f},{HEIGHT / 2.0 - y:.1f}" for x, y in at.tolist())

    parts = []
    for n in range(len(encounter.vehicles)):
        first, last = (int(k) for k in encounter.present[n])
        own = encounter.position[n, first : last + 1]
        colour = COLOURS[n % len(COLOURS)]
        line = own[np.unique(np.linspace(0, len(own) - 1, POINTS).astype(int))]
        parts.append(
            f'<polyline points="{drawn(line)}" fill="none" stroke="{colour}" stroke-width="1.5"/>'
        )
        if span is not None:
            inside = encounter.position[n, max(span[0], first) : min(span[1], last + 1)]
            parts.append(
                f'<polyline points="{drawn(inside)}" fill="none" stroke="{colour}" stroke-width="4" opacity="0.6"/>'
            )
        x, y = drawn(own[:1]).split(",")
        parts.append(f'<circle cx="{x}" cy="{y}" r="3.5" fill="{colour}"/>')
    metre = 10.0 * scale
    parts.append(f'<path d="M6,{HEIGHT - 6:.0f} h{metre:.1f}" stroke="#888" stroke-width="2"/>')
    parts.append(
        f'<text x="{metre + 9:.0f}" y="{HEIGHT - 3:.0f}" font-size="9" fill="#888">10 m</text>'
    )
    return Markup(
        f'<svg width="{WIDTH:.0f}" height="{HEIGHT:.0f}" role="img">{"".join(parts)}</svg>'
    )


def curve(found: Population) -> Markup:
    """Return a drawing of coverage by number of templates: templates alone, and with what is generated, 5 to 95 %."""
    most = max((point.templates for point in found.curve), default=1)
    across, down = WIDTH - 2.0 * BORDER, HEIGHT - 2.0 * BORDER

    def height(share: float) -> str:
        return f"{BORDER + down * (1.0 - share):.1f}"

    parts = [f'<path d="M{BORDER},{BORDER} v{down} h{across}" fill="none" stroke="#888"/>']
    for colour, name in zip(COLOURS, ("alone", "generated"), strict=False):
        at = [
            (BORDER + across * point.templates / most, getattr(point, name))
            for point in found.curve
        ]
        line = " ".join(f"{x:.1f},{height(share.value)}" for x, share in at)
        parts.append(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="2"/>')
        parts += [
            f'<path d="M{x:.1f},{height(share.high)} V{height(share.low)}" stroke="{colour}"/>'
            for x, share in at
        ]
    parts.append(
        f'<text x="{BORDER + 4}" y="{BORDER + 8}" font-size="9" fill="#888">1.0; red: with generated, blue: alone</text>'
    )
    parts.append(
        f'<text x="{WIDTH - BORDER - 70}" y="{HEIGHT - 2}" font-size="9" fill="#888">{most} templates</text>'
    )
    return Markup(
        f'<svg width="{WIDTH:.0f}" height="{HEIGHT:.0f}" role="img">{"".join(parts)}</svg>'
    )


def write_page(
    path: Path,
    title: str,
    lead: str,
    cards: Sequence[Mapping[str, Any]],
    notes: Sequence[str] = (),
) -> None:
    """Write a page of cards.

    Args:
        path: of the page.
        title: heading.
        lead: a sentence below it.
        cards: each with `title`, `lines` (texts) and `pictures`.
        notes: sentences at its end.
    """
    page = render_page("corpus.html.j2", (), {}, title=title, lead=lead, cards=cards, notes=notes)
    write_text(path, page)

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Encounters that end when their manoeuvres end, not when two vehicles are out of range.

A vehicle that waits in a junction may still turn when the other one is out of range, or when the
longest duration is over. It is kept for a little before and after it crosses the path of another
member.
"""

from collections.abc import Mapping
from itertools import permutations

import numpy as np

from scenario_gen.logs.encounters import Piece
from scenario_gen.logs.growing import Span
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.curve import crossings, Curve
from scenario_gen.numerics.plane import arc_lengths

AROUND_CROSSING_S = 3.0
"""Time for which a vehicle is kept before and after it crosses another path."""

LONGEST_EXTENSION_S = 10.0
"""A vehicle that crosses later than this after its meeting does not do so because of it."""

_MIN_EXTENSION_S = 1.0  # less is not worth vehicles that start or end at different times
_MIN_ANGLE_RAD = 0.35  # between the paths; smaller angles are of vehicles that follow or merge


def complete_spans(
    spans: Mapping[int, Span], pieces: Mapping[int, Piece], period: float
) -> dict[int, Span]:
    """Return the spans of an encounter's members, extended to where they cross another's path.

    Args:
        spans: first tick and tick after the last of each member.
        pieces: the smooth motion of each member; no span is extended beyond it.
        period: of the ticks [s].
    """
    around = round(AROUND_CROSSING_S / period)
    latest = round(LONGEST_EXTENSION_S / period)
    first = min(start for start, _ in spans.values()) - around
    last = max(end for _, end in spans.values()) + latest
    paths = {member: _path(pieces[member], first, last) for member in spans}
    complete = dict(spans)
    for member, other in permutations(sorted(spans), 2):
        start, end = spans[member]
        for tick in _crossing_ticks(paths[member], paths[other]).tolist():
            if start <= tick < end + latest:
                begin, until = complete[member]
                complete[member] = (min(begin, tick - around), max(until, tick + around + 1))

    return {
        member: _recorded(spans[member], complete[member], pieces[member], period)
        for member in spans
    }


def _recorded(span: Span, wanted: Span, piece: Piece, period: float) -> Span:
    """Return a span, extended as far as wanted and recorded, unless that is too little."""
    least = round(_MIN_EXTENSION_S / period)
    begin = max(wanted[0], piece.first)
    end = min(wanted[1], piece.last)
    return (
        begin if span[0] - begin > least else span[0],
        end if end - span[1] > least else span[1],
    )


def _path(piece: Piece, first: int, last: int) -> tuple[int, Floats]:
    """Return the first tick of a piece between two ticks, and its positions (T, 2) [m] there."""
    begin = max(first, piece.first)
    return begin, piece.position(begin, max(min(last, piece.last), begin))


def _crossing_ticks(path: tuple[int, Floats], other: tuple[int, Floats]) -> Ints:
    """Return the ticks (K,) at which a vehicle is where its path crosses another path."""
    lines = [positions for _, positions in (path, other)]
    progress = [arc_lengths(line) for line in lines]
    if min(length[-1] if len(length) else 0.0 for length in progress) < 1.0:
        return np.zeros(0, dtype=np.int64)
    stations = crossings(Curve.through(lines[0]), Curve.through(lines[1]), _MIN_ANGLE_RAD)
    return path[0] + np.searchsorted(progress[0], stations[:, 0])

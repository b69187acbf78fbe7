# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The reference line of an OpenDRIVE road, and the piecewise cubics beside it.

Source: ASAM OpenDRIVE 1.8, chapters "Geometry" and "Lanes" (offset, width, border).
"""

from dataclasses import dataclass
import math

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element
from scenario_gen.numerics import Floats, Ints
from scenario_gen.numerics.plane import place

_STEP = 1.0  # metres of a spiral that one rule of Gauss integrates
_GAUSS = (  # five points on [0, 1], exact for degree 9
    np.array([0.046910077030668, 0.230765344947158, 0.5, 0.769234655052842, 0.953089922969332]),
    np.array(
        [
            0.118463442528095,
            0.239314335249683,
            0.284444444444444,
            0.239314335249683,
            0.118463442528095,
        ]
    ),
)
_SHAPES = ("line", "arc", "spiral", "poly3", "paramPoly3")
MOST_LENGTH = 1_000_000.0  # metres of a road
_SHARPEST = 10.0  # 1/m
_SAME = 1e-4  # metres within which a record begins where a section does


def _piece_at(begin: Floats, s: Floats, end: float) -> Ints:
    """Which of the pieces that begin at (K,) metres holds each s (M,) of a section; the first one also before it.

    What begins where the section ends is the next section's, and counts for none of its s.
    """
    inside = np.minimum(s + _SAME, max(end - _SAME, float(s[0])))
    return np.clip(np.searchsorted(begin, inside, side="right") - 1, 0, len(begin) - 1)


@dataclass(frozen=True, eq=False)
class Cubics:
    """A function of s that is a + b·ds + c·ds² + d·ds³ from each `begin` to the next; before the first, the first.

    Attributes:
        begin: (K,) metres, increasing.
        factors: (K, 4) a, b, c, d.
    """

    begin: Floats
    factors: Floats

    def at(self, s: Floats, end: float) -> Floats:
        """Values (M,) at s (M,) metres, ascending, of a section that goes to `end`."""
        piece = _piece_at(self.begin, s, end)
        ds, f = s - self.begin[piece], self.factors[piece]
        return np.asarray(f[:, 0] + ds * (f[:, 1] + ds * (f[:, 2] + ds * f[:, 3])))


def cubics(records: list[Element], offset: str) -> Cubics:
    """Read records with attributes a, b, c, d and the beginning `offset` (s or sOffset); none is zero everywhere."""
    rows = sorted(
        (record.number(offset), *(record.number(name) for name in "abcd")) for record in records
    ) or [(0.0,) * 5]
    table = np.array(rows)
    return Cubics(table[:, 0], table[:, 1:])


@dataclass(frozen=True, eq=False)
class ReferenceLine:
    """The plan view of a road: pieces of geometry, one after the other.

    Attributes:
        begin: (K,) metres along the road at which each piece begins.
        pieces: K elements.
        length: of the road, metres.
    """

    begin: Floats
    pieces: tuple[Element, ...]
    length: float

    def at(self, s: Floats, end: float) -> Floats:
        """Poses (M, 3) x, y [m], yaw [rad] at s (M,) metres, ascending, of a section that goes to `end`."""
        which = _piece_at(self.begin, s, end)
        poses = np.empty((len(s), 3))
        for k in np.unique(which).tolist():
            poses[which == k] = _piece(
                self.pieces[k], np.maximum(s[which == k] - self.begin[k], 0.0)
            )
        return poses


def reference_line(road: Element) -> ReferenceLine:
    """Read the plan view of a road.

    Raises:
        InputError: it has none, or a piece of no known shape or of impossible size.
    """
    pieces = sorted(
        road.child("planView").findall("geometry"), key=lambda piece: piece.number("s")
    )
    if not pieces:
        raise InputError(f"{road.place}: its <planView> has no <geometry>")
    for piece in pieces:
        shape = _shape(piece)
        length = piece.number("length")
        if not 0.0 <= length <= MOST_LENGTH:
            raise InputError(f"{piece.place}: length {length:g} m; 0 to {MOST_LENGTH:g} are read")
        for name in ("curvature", "curvStart", "curvEnd"):
            if abs(shape.number(name, 0.0)) > _SHARPEST:
                raise InputError(
                    f"{shape.place}: {name} is {shape.number(name):g} 1/m; at most {_SHARPEST:g} is read"
                )
    length, drawn = road.number("length"), sum(piece.number("length") for piece in pieces)
    if not 0.0 <= length <= MOST_LENGTH or (length == 0.0 and drawn > 0.0):
        raise InputError(
            f"{road.place}: length {length:g} m; more than 0 and at most {MOST_LENGTH:g} are read"
        )
    return ReferenceLine(np.array([piece.number("s") for piece in pieces]), tuple(pieces), length)


def _shape(piece: Element) -> Element:
    shape = next((child for child in piece if child.tag in _SHAPES), None)
    if shape is None:
        raise InputError(f"{piece.place} holds none of {', '.join(_SHAPES)}")
    return shape


def _piece(piece: Element, ds: Floats) -> Floats:
    """Poses (M, 3) at `ds` (M,) metres from a piece's beginning."""
    shape = _shape(piece)
    u, v, turn = _SHAPE[shape.tag](shape, piece.number("length"), ds)
    pose = np.array([piece.number(name) for name in ("x", "y", "hdg")])
    return np.column_stack((place(pose, u, v), pose[2] + turn))


def _line(_shape: Element, _length: float, ds: Floats) -> tuple[Floats, Floats, Floats]:
    return ds, np.zeros_like(ds), np.zeros_like(ds)


def _arc(shape: Element, _length: float, ds: Floats) -> tuple[Floats, Floats, Floats]:
    curvature = shape.number("curvature")
    if abs(curvature) < 1e-12:
        return _line(shape, _length, ds)
    turn = curvature * ds
    half = np.sin(0.5 * turn)
    return np.sin(turn) / curvature, 2.0 * np.square(half) / curvature, turn


def _spiral(shape: Element, length: float, ds: Floats) -> tuple[Floats, Floats, Floats]:
    """A clothoid: its curvature grows evenly; the position is the integral of its heading's cosine and sine."""
    first, last = shape.number("curvStart"), shape.number("curvEnd")
    rate = (last - first) / length if length > 0.0 else 0.0
    knots = np.unique(
        np.concatenate(
            ([0.0], np.arange(1, math.ceil(float(ds.max(initial=0.0)) / _STEP) + 1) * _STEP, ds)
        )
    )
    step = np.diff(knots)
    at = knots[:-1, None] + step[:, None] * _GAUSS[0]
    heading = at * (first + 0.5 * rate * at)
    parts = [
        (step[:, None] * _GAUSS[1] * function(heading)).sum(axis=1)
        for function in (np.cos, np.sin)
    ]
    u, v = (np.concatenate(([0.0], np.cumsum(part)))[np.searchsorted(knots, ds)] for part in parts)
    return u, v, ds * (first + 0.5 * rate * ds)


def _poly3(shape: Element, length: float, ds: Floats) -> tuple[Floats, Floats, Floats]:
    """v(u) = a + b·u + c·u² + d·u³ at arc lengths ds: u is found from a table of arc lengths."""
    a, b, c, d = (shape.number(name) for name in "abcd")
    u = np.linspace(0.0, max(length, 1e-6), max(math.ceil(length / 0.05), 1) + 1)
    v = a + u * (b + u * (c + u * d))
    arc = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(u), np.diff(v)))))
    at = np.interp(ds, arc, u)
    return at, a + at * (b + at * (c + at * d)), np.arctan(b + at * (2.0 * c + at * 3.0 * d))


def _param_poly3(shape: Element, length: float, ds: Floats) -> tuple[Floats, Floats, Floats]:
    p = ds / length if _is_normalized(shape, length) and length > 0.0 else ds
    values = []
    for axis in "UV":
        a, b, c, d = (shape.number(f"{name}{axis}") for name in "abcd")
        values.append((a + p * (b + p * (c + p * d)), b + p * (2.0 * c + p * 3.0 * d)))
    (u, du), (v, dv) = values
    return u, v, np.asarray(np.arctan2(dv, du))


def _is_normalized(shape: Element, length: float) -> bool:
    """Whether p goes from 0 to 1, which is the default; where a file does not say, the speed of p shows if it is metres."""
    if "pRange" in shape.attrib:
        return bool(shape.get("pRange") == "normalized")
    speed = math.hypot(shape.number("bU"), shape.number("bV"))
    return abs(speed - length) <= abs(speed - 1.0)


_SHAPE = {
    "line": _line,
    "arc": _arc,
    "spiral": _spiral,
    "poly3": _poly3,
    "paramPoly3": _param_poly3,
}

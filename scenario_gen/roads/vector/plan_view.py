# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The reference line of an OpenDRIVE road, and piecewise cubics along it.

Source: ASAM OpenDRIVE 1.8, chapters "Geometry" and "Lanes" (offset, width, border).
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.xml_reader import Element
from scenario_gen.numerics import Floats, Ints, place, running_sum

_MAX_LENGTH_M = 1_000_000.0  # of a road
_MAX_CURVATURE_PER_M = 10.0
_ARTEFACT_LENGTH_M = 0.1  # of a piece with a larger curvature
_SAME_STATION_M = 1e-4  # between the begins of a record and a section that are the same
_QUADRATURE_STEP_M = 1.0  # of a spiral


def _piece_at(begin: Floats, s: Floats, end: float) -> Ints:
    """Return the piece for each s (M,) of a section, of those that begin at (K,) [m].

    The first piece also counts before its begin. A piece that begins where the section ends
    belongs to the next section.
    """
    inside = np.minimum(s + _SAME_STATION_M, max(end - _SAME_STATION_M, float(s[0])))
    return np.clip(np.searchsorted(begin, inside, side="right") - 1, 0, len(begin) - 1)


@dataclass(frozen=True, eq=False)
class Cubics:
    """A function of s: a + b·ds + c·ds² + d·ds³ from each `begin` to the next.

    The first piece also counts before its begin.

    Attributes:
        begin: (K,) [m] increasing.
        factors: (K, 4) a, b, c, d.
    """

    begin: Floats
    factors: Floats

    def at(self, s: Floats, end: float) -> Floats:
        """Return values (M,) at s (M,) [m], ascending, of a section that ends at `end`."""
        piece = _piece_at(self.begin, s, end)
        ds, f = s - self.begin[piece], self.factors[piece]
        return np.asarray(f[:, 0] + ds * (f[:, 1] + ds * (f[:, 2] + ds * f[:, 3])))


def cubics(records: Sequence[Element], offset: str) -> Cubics:
    """Read records with attributes a, b, c, d that begin at the attribute `offset`.

    Without records the function is zero.
    """
    names = (offset, *"abcd")
    rows = sorted(tuple(record.number(name) for name in names) for record in records)
    table = np.array(rows or [(0.0,) * 5])
    return Cubics(table[:, 0], table[:, 1:])


@dataclass(frozen=True, eq=False)
class ReferenceLine:
    """The plan view of a road: pieces of geometry, one after the other.

    Attributes:
        begin: (K,) [m] along the road at which each piece begins.
        pieces: K elements.
        length: of the road [m].
    """

    begin: Floats
    pieces: tuple[Element, ...]
    length: float

    def at(self, s: Floats, end: float) -> Floats:
        """Return poses (M, 3) at s (M,) [m], ascending, of a section that ends at `end`."""
        piece = _piece_at(self.begin, s, end)
        poses = np.empty((len(s), 3))
        for k in np.unique(piece).tolist():
            ds = np.maximum(s[piece == k] - self.begin[k], 0.0)
            poses[piece == k] = _poses_on_piece(self.pieces[k], ds)
        return poses


def reference_line(road: Element) -> ReferenceLine:
    """Read the plan view of a road.

    Raises:
        InputError: it has none, or a piece of an unknown shape or an impossible size.
    """
    geometries = road.child("planView").findall("geometry")
    pieces = sorted(geometries, key=lambda piece: piece.number("s"))
    if not pieces:
        raise InputError(f"{road.place}: its <planView> has no <geometry>")
    pieces = [piece for piece in pieces if not _is_artefact(piece)] or pieces
    for piece in pieces:
        shape = _shape_of(piece)
        length = piece.number("length")
        if not 0.0 <= length <= _MAX_LENGTH_M:
            raise InputError(
                f"{piece.place}: length {length:g} m; 0 to {_MAX_LENGTH_M:g} m are read"
            )
        for name in ("curvature", "curvStart", "curvEnd"):
            if abs(shape.number(name, 0.0)) > _MAX_CURVATURE_PER_M:
                raise InputError(
                    f"{shape.place}: {name} is {shape.number(name):g} 1/m; at most "
                    f"{_MAX_CURVATURE_PER_M:g} is read"
                )
    length = road.number("length")
    drawn = sum(piece.number("length") for piece in pieces)
    if not 0.0 <= length <= _MAX_LENGTH_M or (length == 0.0 and drawn > 0.0):
        raise InputError(
            f"{road.place}: length {length:g} m; more than 0 and at most {_MAX_LENGTH_M:g} m are "
            "read"
        )
    return ReferenceLine(np.array([piece.number("s") for piece in pieces]), tuple(pieces), length)


def _is_artefact(piece: Element) -> bool:
    """Return whether a piece is a remainder of a few centimetres with a wild curvature.

    The piece before it is continued instead.
    """
    shape = _shape_of(piece)
    curvatures = [abs(shape.number(name, 0.0)) for name in ("curvature", "curvStart", "curvEnd")]
    return piece.number("length") < _ARTEFACT_LENGTH_M and max(curvatures) > _MAX_CURVATURE_PER_M


def _shape_of(piece: Element) -> Element:
    """Return the element with the shape of a piece of geometry."""
    shape = next((child for child in piece if child.tag in _SHAPES), None)
    if shape is None:
        raise InputError(f"{piece.place} has none of {', '.join(_SHAPES)}")
    return shape


def _poses_on_piece(piece: Element, ds: Floats) -> Floats:
    """Return poses (M, 3) at `ds` (M,) [m] from a piece's begin."""
    shape = _shape_of(piece)
    u, v, turn = _SHAPES[shape.tag](shape, piece.number("length"), ds)
    pose = np.array([piece.number(name) for name in ("x", "y", "hdg")])
    return np.column_stack((place(pose, u, v), pose[2] + turn))


# Each shape returns u, v [m] and the heading [rad], (M,) each, in the frame of the piece's begin.


def _line(_shape: Element, _length: float, ds: Floats) -> tuple[Floats, Floats, Floats]:
    return ds, np.zeros_like(ds), np.zeros_like(ds)


def _arc(shape: Element, length: float, ds: Floats) -> tuple[Floats, Floats, Floats]:
    curvature = shape.number("curvature")
    if abs(curvature) < 1e-12:
        return _line(shape, length, ds)
    turn = curvature * ds
    half = np.sin(0.5 * turn)
    return np.sin(turn) / curvature, 2.0 * np.square(half) / curvature, turn


def _spiral(shape: Element, length: float, ds: Floats) -> tuple[Floats, Floats, Floats]:
    """A clothoid: the curvature changes linearly; the heading's cosine and sine are integrated."""
    first, last = shape.number("curvStart"), shape.number("curvEnd")
    rate = (last - first) / length if length > 0.0 else 0.0
    steps = np.arange(1, math.ceil(float(ds.max(initial=0.0)) / _QUADRATURE_STEP_M) + 1)
    knots = np.unique(np.concatenate(([0.0], steps * _QUADRATURE_STEP_M, ds)))

    # Five Gauss points on each step are exact up to degree nine.
    node, weight = np.polynomial.legendre.leggauss(5)
    step = np.diff(knots)[:, None]
    at = knots[:-1, None] + step * (node + 1.0) / 2.0
    heading = at * (first + 0.5 * rate * at)
    at_ds = np.searchsorted(knots, ds)
    u, v = (
        running_sum((step * weight / 2.0 * part).sum(axis=1))[at_ds]
        for part in (np.cos(heading), np.sin(heading))
    )
    return u, v, ds * (first + 0.5 * rate * ds)


def _poly3(shape: Element, length: float, ds: Floats) -> tuple[Floats, Floats, Floats]:
    """v(u) = a + b·u + c·u² + d·u³; u is interpolated from a table of arc lengths."""
    v = _cubic(shape)
    u = np.linspace(0.0, max(length, 1e-6), max(math.ceil(length / 0.05), 1) + 1)
    at = np.interp(ds, running_sum(np.hypot(np.diff(u), np.diff(v(u)))), u)
    return at, v(at), np.arctan(v.deriv()(at))


def _param_poly3(shape: Element, length: float, ds: Floats) -> tuple[Floats, Floats, Floats]:
    p = ds / length if _is_normalized(shape, length) and length > 0.0 else ds
    u, v = _cubic(shape, "U"), _cubic(shape, "V")
    return u(p), v(p), np.arctan2(v.deriv()(p), u.deriv()(p))


def _cubic(shape: Element, axis: str = "") -> np.poly1d:
    """Return the cubic of a shape along an axis."""
    return np.poly1d([shape.number(f"{name}{axis}") for name in "dcba"])


def _is_normalized(shape: Element, length: float) -> bool:
    """Return whether p ends at 1, which is the default, rather than at the length.

    If a file does not say so, the initial speed of the curve tells which it is.
    """
    if "pRange" in shape.attrib:
        return bool(shape.get("pRange") == "normalized")
    speed = math.hypot(shape.number("bU"), shape.number("bV"))
    return abs(speed - length) <= abs(speed - 1.0)


_SHAPES = {
    "line": _line,
    "arc": _arc,
    "spiral": _spiral,
    "poly3": _poly3,
    "paramPoly3": _param_poly3,
}

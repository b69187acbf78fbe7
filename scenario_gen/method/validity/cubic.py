# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Parts of a Bézier cubic, and the outcome of a proof over an interval."""

from enum import IntEnum

from scenario_gen.numerics import Floats
from scenario_gen.numerics.kernels import kernel


class Proof(IntEnum):
    """The outcome of a proof over an interval of time."""

    PROVEN = 0
    VIOLATED = 1
    UNPROVEN = 2


@kernel(inline=True)
def blossom(b: Floats, c: int, r: float, s: float, t: float) -> float:
    """Blossom [m] at (r, s, t) of coordinate c of the cubic with control points b (4, 2).

    Source: de Casteljau's algorithm with three parameters (Ramshaw 1989).
    """
    d0 = b[0, c] + (b[1, c] - b[0, c]) * r
    d1 = b[1, c] + (b[2, c] - b[1, c]) * r
    d2 = b[2, c] + (b[3, c] - b[2, c]) * r
    e0 = d0 + (d1 - d0) * s
    e1 = d1 + (d2 - d1) * s
    return float(e0 + (e1 - e0) * t)


@kernel(inline=True)
def split_cubic(b: Floats, u0: float, u1: float, out: Floats) -> None:
    """Write the control points [m] of the part of `b` (4, 2) from u0 to u1 into `out` (4, 2)."""
    for c in range(2):
        out[0, c] = blossom(b, c, u0, u0, u0)
        out[1, c] = blossom(b, c, u0, u0, u1)
        out[2, c] = blossom(b, c, u0, u1, u1)
        out[3, c] = blossom(b, c, u1, u1, u1)

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Texts of several pieces separated by `;`, as in options, parameters and facts."""

from collections.abc import Iterable
import math


def split_pieces(text: str) -> list[str]:
    """Return the pieces of a text that are not empty."""
    return [piece for part in text.split(";") if (piece := part.strip())]


def join_pieces(pieces: Iterable[object]) -> str:
    """Return the text of some pieces."""
    return "; ".join(map(str, pieces))


def read_numbers(text: str) -> tuple[float, ...]:
    """Return the numbers of a piece, separated by blanks or commas; () if one is not finite."""
    try:
        numbers = tuple(float(word) for word in text.replace(",", " ").split())
    except ValueError:
        return ()
    return numbers if all(map(math.isfinite, numbers)) else ()

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Texts of several pieces parted by `;`, as the command line, parameters and entries of a scenario have them."""

from collections.abc import Iterable
import math


def split_pieces(text: str) -> list[str]:
    """Return the pieces of a text that are not empty."""
    return [piece for part in text.split(";") if (piece := part.strip())]


def join_pieces(pieces: Iterable[object]) -> str:
    """Return the text of some pieces."""
    return "; ".join(map(str, pieces))


def read_numbers(text: str) -> tuple[float, ...]:
    """Return the numbers of a piece, parted by blanks or commas; none where one of them is no finite number."""
    try:
        numbers = tuple(float(word) for word in text.replace(",", " ").split())
    except ValueError:
        return ()
    return numbers if all(map(math.isfinite, numbers)) else ()

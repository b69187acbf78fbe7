# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Presence: from which to which sample each vehicle of an encounter or a scenario is there.

A vehicle may arrive late and leave early. Arrays keep their full shape; outside its presence a
vehicle's rows hold its first or last value there, which says nothing of where it is. So whoever
looks at a motion looks at the presence too.
"""

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Bools, Floats, frozen, Ints, sealed

ALWAYS: Ints = sealed(
    np.zeros((0, 2), dtype=np.int64)
)  # the default of a field `present`: everybody is there throughout


def canonical_presence(present: Ints, count: int, samples: int, name: str) -> Ints:
    """Return the presence (N, 2) of `count` vehicles over `samples` samples; expands `ALWAYS`.

    Args:
        present: (N, 2) first and last sample index of each vehicle, or `ALWAYS`.
        count: N.
        samples: T.
        name: what it belongs to, for the message.

    Raises:
        InputError: the shape is wrong, or they are no whole numbers, or a vehicle has fewer than
            two samples or lies outside of 0 … T - 1.
    """
    if np.shape(present) == (0, 2):
        return sealed(np.tile(np.array([0, samples - 1], dtype=np.int64), (count, 1)))
    if np.asarray(present).dtype.kind not in "iu":
        raise InputError(
            f"{name}: presence is of type {np.asarray(present).dtype}; whole numbers are needed"
        )
    rows = np.array(present, dtype=np.int64, order="C")
    if rows.shape != (count, 2):
        raise InputError(
            f"{name}: presence has shape {rows.shape}; "
            f"{count} rows of first and last sample are needed"
        )
    bad = np.flatnonzero((rows[:, 0] < 0) | (rows[:, 1] >= samples) | (rows[:, 0] >= rows[:, 1]))
    if len(bad):
        first, last = rows[bad[0]].tolist()
        raise InputError(
            f"{name}: row {bad[0]} is present from sample {first} to {last} of {samples}; "
            "at least two samples inside are needed"
        )
    return sealed(rows)


def at_ends(present: Ints, samples: int) -> Bools:
    """Return (N, 2) whether each vehicle is present at the first and the last of T `samples`."""
    there: Bools = present == (0, samples - 1)
    return there


def always(present: Ints, samples: int) -> bool:
    """Return whether everybody (N, 2) is there at all T `samples`."""
    return bool(at_ends(present, samples).all())


def held(values: Floats, present: Ints) -> Floats:
    """Return values (N, T, …) with the first or last one outside of the presence (N, 2)."""
    samples = values.shape[1]
    if always(present, samples):
        return values
    at = np.clip(np.arange(samples), present[:, :1], present[:, 1:])
    return frozen(values[np.arange(len(values))[:, None], at])


def mask(present: Ints, samples: int) -> Bools:
    """Return (N, T) whether each vehicle is there at each sample, of presence (N, 2)."""
    at = np.arange(samples)
    there: Bools = (at >= present[:, :1]) & (at <= present[:, 1:])
    return there


def together(present: Ints, *rows: int) -> slice:
    """Return the samples at which all of these vehicles are present, possibly none."""
    first = int(present[list(rows), 0].max())
    last = int(present[list(rows), 1].min())
    return slice(first, max(last + 1, first))


def cut(present: Ints, first: int, last: int) -> Ints:
    """Return the presence (N, 2) within samples first … last - 1; empty rows: first > last."""
    inside: Ints = np.column_stack(
        (np.maximum(present[:, 0] - first, 0), np.minimum(present[:, 1], last - 1) - first)
    )
    return inside

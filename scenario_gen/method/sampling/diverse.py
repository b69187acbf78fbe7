# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A choice of candidates that covers as much as it can: first as many bins, then far from each other."""

from collections.abc import Sequence

import numpy as np

from scenario_gen.numerics import Floats

POOL_SHARE = 10  # valid candidates that are drawn per scenario wanted
FAR = 100.0  # bins to which what is infinite is taken


def spread_out(features: Sequence[tuple[float, ...]], count: int) -> list[int]:
    """Return the places of at most `count` candidates, in the order in which they were chosen.

    Greedy, each time the candidate that opens a bin, as long as one does, and among those the one farthest from all that are
    chosen (farthest-point sampling, Gonzalez 1985). The first is the one nearest to the median.

    Args:
        features: (S,) of each candidate, in bins of width 1.
        count: how many.
    """
    if not features:
        return []
    at: Floats = np.clip(np.array(features, dtype=np.float64), -FAR, FAR)
    _, bins = np.unique(np.floor(at), axis=0, return_inverse=True)
    bins = bins.reshape(-1)
    chosen = [int(np.argmin(np.linalg.norm(at - np.median(at, axis=0), axis=1)))]
    nearest = np.linalg.norm(at - at[chosen[0]], axis=1)
    taken = np.zeros(len(at), dtype=np.bool_)
    taken[chosen[0]] = True
    opened = np.zeros(int(bins.max()) + 1, dtype=np.bool_)
    opened[bins[chosen[0]]] = True
    while len(chosen) < min(count, len(at)):
        allowed = ~taken & ~opened[bins]
        if not allowed.any():
            allowed = ~taken
        best = int(np.argmax(np.where(allowed, nearest, -1.0)))
        chosen.append(best)
        taken[best], opened[bins[best]] = True, True
        nearest = np.minimum(nearest, np.linalg.norm(at - at[best], axis=1))
    return chosen

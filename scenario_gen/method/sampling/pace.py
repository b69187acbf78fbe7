# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The nominal clock: the template's, slowed ahead of bends that the template's speed would not suit.

A route may bend more than the recorded path did. A vehicle that slowed down alone would have to make up for it elsewhere, for
lengths and changepoint times are given: it would speed up, brake and speed up again. So the clock of all vehicles runs slower
there, they meet as before, and it is known before the bend.
"""

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from scenario_gen.method.sampling.time_warp import Clock
from scenario_gen.numerics import Floats
from scenario_gen.types import Encounter

GRID = 0.1  # s
REACH = 1.5  # s, ahead of a bend and behind it, over which the clock is slowed


def template_grid(encounter: Encounter) -> Floats:
    """(G,) evenly spaced template times [s], the samples' own among them."""
    parts = max(round(encounter.dt / GRID), 1)
    return np.linspace(0.0, encounter.duration, parts * (len(encounter.time) - 1) + 1)


def slowed_clock(grid: Floats, slowdowns: Sequence[Floats], most: float) -> Clock:
    """The clock as slow everywhere as the slowest vehicle requires, smooth (C2), at most `most` times as long as the template.

    Args:
        grid: (G,) template times [s].
        slowdowns: (G,) per vehicle, the factor by which the clock must be slowed there, 1 or more.
        most: duration over the template's, at most; larger slowdowns are met in part.
    """
    slowdown = np.maximum(np.max(slowdowns, axis=0), 1.0)
    step = float(grid[1] - grid[0])
    width = 2 * max(round(REACH / step / 3.0), 1) + 1
    rate = ndimage.maximum_filter1d(slowdown, 3 * (width - 1) + 1, mode="nearest")
    for _ in range(3):
        rate = ndimage.uniform_filter1d(rate, width, mode="nearest")
    extra = rate - 1.0
    longer = 0.5 * step * float((extra[1:] + extra[:-1]).sum())
    room = (most - 1.0) * float(grid[-1] - grid[0])
    rate = 1.0 + extra * (min(room / longer, 1.0) if longer > 0.0 else 1.0)
    return clock_of(grid, rate)


def clock_of(grid: Floats, rate: Floats) -> Clock:
    """Return the clock with these rates (G,) at template times (G,) [s], cubic between."""
    step = float(grid[1] - grid[0])
    time = np.concatenate([[0.0], np.cumsum(0.5 * step * (rate[1:] + rate[:-1]))])
    return Clock(grid, time, rate)

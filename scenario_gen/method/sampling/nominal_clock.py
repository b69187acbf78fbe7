# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The nominal clock: the template's, slowed before bends that do not suit the template's speed.

A route may bend more than the recorded path did. A vehicle that slowed down alone would have
to speed up, brake and speed up again, for lengths and changepoint times are given. So the
clock of all vehicles runs slower there, before the bend already, and they meet as in the
recording.
"""

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from scenario_gen.method.sampling.time_warp import Clock, SAMPLE_PERIOD_S
from scenario_gen.numerics import Floats, running_sum
from scenario_gen.types import Encounter

SLOWING_S = 1.5  # before and after a bend, over which the clock is slowed: about 2 m/s² at 10 m/s
_PASSES_COUNT = 3  # of the moving average: three make it C2


def template_grid(encounter: Encounter) -> Floats:
    """Return evenly spaced template times (G,) [s], the samples' among them."""
    parts = max(round(encounter.dt / SAMPLE_PERIOD_S), 1)
    return np.linspace(0.0, encounter.duration, parts * (len(encounter.time) - 1) + 1)


def slowed_clock(grid: Floats, slowdowns: Sequence[Floats], max_duration: float) -> Clock:
    """Return the smooth (C2) clock that is as slow everywhere as the slowest vehicle requires.

    Args:
        grid: (G,) template times [s].
        slowdowns: (G,) per vehicle, the factor by which the clock must be slowed, 1 or more.
        max_duration: over the template's; larger slowdowns are met in part.
    """
    slowdown = np.maximum(np.max(slowdowns, axis=0), 1.0)
    step = float(grid[1] - grid[0])
    width = 2 * max(round(SLOWING_S / step / _PASSES_COUNT), 1) + 1
    reach = _PASSES_COUNT * (width - 1) + 1
    rate = ndimage.maximum_filter1d(slowdown, reach, mode="nearest")
    for _ in range(_PASSES_COUNT):
        rate = ndimage.uniform_filter1d(rate, width, mode="nearest")
    extra = rate - 1.0
    longer = 0.5 * step * float((extra[1:] + extra[:-1]).sum())
    room = (max_duration - 1.0) * float(grid[-1] - grid[0])
    share = min(room / longer, 1.0) if longer > 0.0 else 1.0
    return clock_from_rate(grid, 1.0 + extra * share)


def clock_from_rate(grid: Floats, rate: Floats) -> Clock:
    """Return the clock with these rates (G,) at template times (G,) [s], cubic in between."""
    step = float(grid[1] - grid[0])
    time = running_sum(0.5 * step * (rate[1:] + rate[:-1]))
    return Clock(grid, time, rate)

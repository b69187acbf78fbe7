# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""When a scenario begins and ends, besides what its clocks say.

Where a recording begins and ends is chance: a camera's edge, or who cut it. So a scenario may leave out a part of the time before
the first conflict and of that after the last one: it begins nearer to the conflict, or ends sooner behind it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math

import numpy as np
from scipy import special

from scenario_gen.numerics import Bools, Floats
from scenario_gen.situation import Situation

AFTER_S = 1.0  # that are left after the second has entered and the first has left
LEAST_S = 3.0  # that are left of a template in any case


@dataclass(frozen=True, eq=False)
class Window:
    """How much a scenario may leave out.

    Attributes:
        between: (2,) template times [s] of what stays: from the first entry of a conflict until the last one is over.
        share: (2,) of the time before and after it that may be left out.
    """

    between: Floats
    share: Floats

    def cut(self, z: Floats, kept: Floats, span: Floats) -> Floats:
        """Return when scenarios begin and end (S, 2) [s].

        Args:
            z: (S, 2) standard normal numbers.
            kept: (S, 2) what stays of each [s]: `between` on the clocks.
            span: (S, 2) when they would begin and end [s].
        """
        room = np.maximum((kept - span) * np.array([1.0, -1.0]), 0.0)
        return np.asarray(span + np.array([1.0, -1.0]) * self.share * special.ndtr(z) * room)


def window_of(situation: Situation, share: float, tied: Bools) -> Window | None:
    """Return what scenarios of a template may leave out; None if nothing, as where vehicles share no area.

    Args:
        situation: of the template.
        share: of the time before and after its conflicts, at most.
        tied: (2,) whether start and end states are asked of any vehicle.
    """
    conflicts = situation.conflicts
    if not conflicts or share == 0.0 or tied.all():
        return None
    first = min(conflict.entry_first for conflict in conflicts)
    last = AFTER_S + max(
        _over([conflict.entry_second, conflict.exit_first]) for conflict in conflicts
    )
    between = np.array([first, max(last, first + LEAST_S)])
    return Window(between, np.where(tied, 0.0, share))


def seconds_left_out(situation: Situation, share: float) -> Floats:
    """Return (2,) how many seconds of a template's start and end scenarios leave out at most."""
    window = window_of(situation, share, np.zeros(2, dtype=np.bool_))
    if window is None:
        return np.zeros(2)
    spare = (window.between - np.array([0.0, situation.encounter.duration])) * np.array(
        [1.0, -1.0]
    )
    return np.asarray(window.share * np.maximum(spare, 0.0))


def _over(times: Sequence[float]) -> float:
    """The last of some times [s] that come."""
    return max(time for time in times if math.isfinite(time))

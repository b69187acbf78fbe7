# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Trimming: scenarios begin nearer to the first conflict, or end sooner after the last one.

A recording begins and ends by chance: at the edge of a camera's view, or where it was cut. So a
scenario may leave out a part of the time before the first conflict and after the last one.
"""

from dataclasses import dataclass
import math

import numpy as np
from scipy import special

from scenario_gen.numerics import Bools, Floats
from scenario_gen.situation import Situation

AFTER_CONFLICT_S = 1.0  # kept after the second vehicle has entered and the first one has left
MIN_DURATION_S = 5.0  # kept of a template in any case, as the reader demands of encounters
_INWARD_FACTOR = np.array([1.0, -1.0])  # later at the start, earlier at the end


@dataclass(frozen=True, eq=False)
class Trimming:
    """How much of its start and end a scenario may leave out.

    Attributes:
        core: (2,) template times [s] that are kept: from the first entry into a conflict until
            the last conflict is over.
        share: (2,) of the time before and after the core that may be left out.
    """

    core: Floats
    share: Floats

    @property
    def count(self) -> int:
        """Standard normal numbers per sample."""
        return len(self.core)

    def apply(self, z: Floats, core: Floats, span: Floats) -> Floats:
        """Return begin and end of scenarios (S, 2) [s].

        Args:
            z: (S, 2) standard normal numbers.
            core: (S, 2) begin and end of the core on the scenarios' clocks [s].
            span: (S, 2) begin and end without trimming [s].
        """
        room = np.maximum((core - span) * _INWARD_FACTOR, 0.0)
        return np.asarray(span + _INWARD_FACTOR * self.share * special.ndtr(z) * room)


def trimming_of(situation: Situation, share: float, fixed: Bools) -> Trimming | None:
    """Return how scenarios of a template are trimmed; None if they are not, or have no conflict.

    Args:
        situation: the template's.
        share: of the time before and after its conflicts, at most.
        fixed: (2,) whether start and end states are requested of any vehicle.
    """
    conflicts = situation.conflicts
    if not conflicts or share == 0.0 or fixed.all():
        return None
    first = min(conflict.entry_first for conflict in conflicts)
    events = [(conflict.entry_second, conflict.exit_first) for conflict in conflicts]
    last = max(max(filter(math.isfinite, times)) for times in events) + AFTER_CONFLICT_S
    core = np.array([first, max(last, first + MIN_DURATION_S)])
    return Trimming(core, np.where(fixed, 0.0, share))


def max_trimmed_time(situation: Situation, share: float) -> Floats:
    """Return how many seconds (2,) of a template's start and end scenarios leave out at most."""
    trimming = trimming_of(situation, share, np.zeros(2, dtype=np.bool_))
    if trimming is None:
        return np.zeros(2)
    whole = np.array([0.0, situation.encounter.duration])
    spare = (trimming.core - whole) * _INWARD_FACTOR
    return np.asarray(trimming.share * np.maximum(spare, 0.0))

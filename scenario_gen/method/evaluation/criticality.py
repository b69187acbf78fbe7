# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Criticality of a motion: distances, time to collision, encroachment, passing order."""

from dataclasses import dataclass
from itertools import combinations
import math

import numpy as np

from scenario_gen.method.evaluation.geometry import least_distance_and_ttc
from scenario_gen.situation import encroachment, find_conflicts
from scenario_gen.types import Motion


@dataclass(frozen=True)
class Criticality:
    """What one motion came to.

    Source: time to collision, Hayward 1972; post-encroachment time, Allen, Shin & Cooper 1978.

    Attributes:
        min_distance: least distance between two footprints [m]; NaN with one vehicle.
        min_ttc: least time to collision [s], at most the horizon; likewise.
        pet: least post-encroachment time [s] of two vehicles that cross or merge; NaN without
            such a pair, see `encroachment`.
        order: (pair, which of them went first) of every conflict, by vehicle index.
    """

    min_distance: float
    min_ttc: float
    pet: float
    order: tuple[tuple[tuple[int, int], int], ...]

    def keeps_order_of(self, template: "Criticality") -> float:
        """Return the share of the template's conflicts found here that have the same order."""
        mine = dict(self.order)
        same = [mine[pair] == first for pair, first in template.order if pair in mine]
        return float(np.mean(same)) if same else math.nan

    def vanished_of(self, template: "Criticality") -> int:
        """Return the number of the template's conflicts that do not exist here."""
        return len(dict(template.order).keys() - dict(self.order).keys())


def criticality(motion: Motion, horizon: float) -> Criticality:
    """Measure one motion; a time to collision above `horizon` [s] counts as the horizon."""
    distances, times = [], [horizon]
    for a, b in combinations(range(len(motion.vehicles)), 2):
        both = motion.present_slice(a, b)
        if both.stop > both.start:
            distance, ttc = least_distance_and_ttc(motion, a, b)
            distances.append(distance)
            times.append(ttc)
    conflicts = find_conflicts(motion)
    encroachments = [encroachment(motion, conflict) for conflict in conflicts]
    return Criticality(
        min_distance=min(distances, default=math.nan),
        min_ttc=min(times) if distances else math.nan,
        pet=float(np.fmin.reduce(encroachments, initial=math.nan)),
        order=tuple((conflict.pair, conflict.first) for conflict in conflicts),
    )

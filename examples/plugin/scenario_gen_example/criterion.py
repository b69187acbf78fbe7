# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A criterion for drives: the ego leaves room to pedestrians and cyclists."""

import numpy as np

from scenario_gen.closed_loop.drive import Drive
from scenario_gen.method.evaluation import footprint_distance

UNPROTECTED = ("pedestrian", "bicycle")


class Clearance:
    """Smallest gap [m] between the footprints of the ego and of a pedestrian or cyclist."""

    name = "clearance"
    threshold = 0.5  # a smaller value misses it; with `greater_is_better = False`, a larger one

    def __call__(self, drive: Drive) -> float:
        """Return the gap; NaN without pedestrians and cyclists, which misses nothing."""
        gaps = [
            footprint_distance(drive.motion, drive.ego, n)[drive.present[n]].min(initial=np.inf)
            for n, vehicle in enumerate(drive.motion.vehicles)
            if vehicle.type in UNPROTECTED and n != drive.ego
        ]
        return min(gaps, default=np.nan)

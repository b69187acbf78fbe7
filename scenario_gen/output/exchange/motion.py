# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The sampling period of a scenario."""

import numpy as np

from scenario_gen.types import Scenario

EVEN_TOLERANCE_S = 1e-9  # difference of time steps that count as equal


def even_step(scenario: Scenario) -> float | None:
    """Return the one step [s] between the scenario's instants; None if there are several."""
    steps = np.diff(scenario.time)
    return float(np.round(steps[0], 9)) if np.ptp(steps) <= EVEN_TOLERANCE_S else None

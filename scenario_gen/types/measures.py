# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What measures scenarios, for targets and choices: the evaluation provides it, the sampler calls it."""

from collections.abc import Callable
from dataclasses import dataclass
import math

from scenario_gen.types.scenario import NEARNESS, Scenario
from scenario_gen.types.target import Pair

Measure = Callable[
    [Scenario, str, Pair | None], float
]  # a figure of a scenario; NaN if it has none


@dataclass(frozen=True)
class Measures:
    """What measures a scenario of all vehicles.

    Attributes:
        figure: returns one figure by its name, of a pair or of the most critical one.
        rarity: returns how unusual a scenario is among recorded encounters of its kind, up to 1 it is usual; None: nobody asks.
    """

    figure: Measure
    rarity: Callable[[Scenario], float] | None = None

    def nearness(self, scenario: Scenario) -> dict[str, str]:
        """Return the facts that say how near vehicles come, and how rare that is; none of a figure that the scenario lacks."""
        figures = {key: self.figure(scenario, name, None) for key, name in NEARNESS.items()}
        if self.rarity is not None:
            figures["rarity"] = self.rarity(scenario)
        return {key: f"{value:.3f}" for key, value in figures.items() if math.isfinite(value)}

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The interface by which the sampler measures scenarios; the evaluation implements it."""

from collections.abc import Callable
from dataclasses import dataclass
import math

from scenario_gen.types.facts import Facts
from scenario_gen.types.scenario import Scenario
from scenario_gen.types.target import Pair

Measure = Callable[
    [Scenario, str, Pair | None], float
]  # a figure of a scenario; NaN if it has none


@dataclass(frozen=True)
class Measures:
    """What measures a scenario of all vehicles.

    Attributes:
        figure: returns one figure by its name, of a pair or of the most critical one.
        rarity: returns how unusual a scenario is among recorded encounters of its kind, up to 1 it
            is usual; None: nobody asks.
    """

    figure: Measure
    rarity: Callable[[Scenario], float] | None = None

    def facts(self, scenario: Scenario) -> Facts:
        """Return how near the vehicles of a scenario come, and how rare that is."""
        return Facts(
            closest_approach_m=_known(self.figure(scenario, "gap", None)),
            pet_s=_known(self.figure(scenario, "pet", None)),
            rarity=None if self.rarity is None else _known(self.rarity(scenario)),
        )


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None

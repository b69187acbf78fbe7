# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Coverage of a scenario set: the distribution of its criticality, and its notable scenarios."""

from collections.abc import Mapping
from dataclasses import dataclass
import math
from typing import Any


@dataclass(frozen=True)
class Spread:
    """One figure of every scenario, and the template's.

    Attributes:
        label: for people; unit: of the values.
        values: of each measured scenario, NaN where it has none.
        template: of the recorded encounter, NaN likewise.
    """

    label: str
    unit: str
    values: tuple[float, ...]
    template: float


@dataclass(frozen=True)
class Coverage:
    """What the scenarios of one set cover.

    Attributes:
        index: of each measured scenario, as in `scenarios/info`.
        spreads: figures of the most critical pair of each scenario, by name.
        bins: names of the bins of PET.
        pairs: how many pairs of vehicles of all scenarios are in each bin, by the pair's
            manoeuvres.
        picks: index of the most critical, most typical and most different scenario, by those
            words; none of an empty set.
        orders: how often each outcome of the passing order came, where it was free or swapped.
    """

    index: tuple[int, ...]
    spreads: Mapping[str, Spread]
    bins: tuple[str, ...]
    pairs: Mapping[str, tuple[int, ...]]
    picks: Mapping[str, int]
    orders: Mapping[str, int]

    def document(self) -> dict[str, Any]:
        """Return a JSON document; figures have five significant digits, missing ones are null."""

        def number(value: float) -> float | None:
            return float(f"{value:.5g}") if math.isfinite(value) else None

        figures = {
            name: {
                **vars(spread),
                "values": [number(value) for value in spread.values],
                "template": number(spread.template),
            }
            for name, spread in self.spreads.items()
        }
        return {
            "index": self.index,
            "figures": figures,
            **{k: getattr(self, k) for k in ("bins", "pairs", "picks", "orders")},
        }

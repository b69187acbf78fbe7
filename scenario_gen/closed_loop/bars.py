# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The bars: thresholds of the rates of failures that a planner must meet to pass."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.closed_loop.trials import Rate


@dataclass(frozen=True)
class Bars(Parameters):
    """The thresholds that a planner must meet to pass."""

    collisions: float = parameter(
        0.0, "largest share of drives with a collision", low=0.0, high=1.0
    )
    off_road: float = parameter(
        0.0, "largest share of drives that leave the road", low=0.0, high=1.0
    )
    goals: float = parameter(
        1.0, "smallest share of drives that reach the goal", low=0.0, high=1.0
    )
    at_fault: float = parameter(
        0.0, "largest share of drives with a collision by the ego's fault", low=0.0, high=1.0
    )
    jumps: float = parameter(
        0.0, "largest share of drives in which the ego teleports", low=0.0, high=1.0
    )
    faults: float = parameter(
        0.0,
        "largest share of drives with a command that is missing or not finite, or a teleport",
        low=0.0,
        high=1.0,
    )
    took_turn: float = parameter(
        0.0,
        "largest share of drives in which a vehicle that goes first brakes hard for the ego",
        low=0.0,
        high=1.0,
    )
    criteria: float = parameter(
        0.0, "largest share of drives that miss one of the criteria", low=0.0, high=1.0
    )
    progress: float = parameter(
        0.9,
        "smallest share of drives with progress: 20 % of the reference drive's path, as in nuPlan",
        low=0.0,
        high=1.0,
    )


LOWER_BARS = ("goals", "progress")
"""The bars that are lower bounds."""


def broken_bars(rates_by_name: Mapping[str, Rate], bars: Bars) -> list[str]:
    """Return a sentence for each bar that is not met."""
    messages = []
    for name, bar in asdict(bars).items():
        if name not in rates_by_name:
            continue  # no criteria are used
        value = rates_by_name[name].share.value
        is_lower = name in LOWER_BARS
        if value < bar if is_lower else value > bar:
            side = "at least" if is_lower else "at most"
            messages.append(f"{name}: {100 * value:.1f} %; {side} {100 * bar:.1f} % is required")
    return messages

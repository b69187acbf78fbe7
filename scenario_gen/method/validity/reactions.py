# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The certificate of interaction: who passes behind another one does so as a human would, and nobody tailgates."""

from collections.abc import Iterator, Sequence
import math

import numpy as np

from scenario_gen.method.validity.limits import Limits
from scenario_gen.numerics import Floats
from scenario_gen.situation import Conflict, departure, LaneGaps, passing, time_gaps
from scenario_gen.types import Cause, FOLLOW, Reaction, Scenario, Violation

_ROUNDED = 0.1  # s, by which an entry or a clearing is known between samples
_SUCH_A_SPEED, _QUICK = (
    2.0,
    3.0,
)  # m/s, by which two speeds are alike; above which a time gap counts
_NEAR_ENOUGH = 0.05  # m
_ENOUGH = 4.0, 1.5  # m and s, of a gap that nobody keeps because it is needed


def broken_reactions(
    scenario: Scenario,
    conflicts: Sequence[Conflict | None],
    edges: Sequence[Reaction],
    limits: Limits,
    gaps_in_lane: LaneGaps,
) -> Iterator[Violation]:
    """Yield those who enter or leave too early or too late, or follow too far behind, in a scenario with `conflicts`.

    `gaps_in_lane` are those of the scenario.
    """
    met = {
        (conflict.second, conflict.first): conflict
        for conflict in conflicts
        if conflict is not None
    }
    for edge in edges:
        pair, who, whom = (
            (edge.who, edge.whom),
            scenario.vehicles[edge.who].id,
            scenario.vehicles[edge.whom].id,
        )
        conflict = met.get(pair)
        if edge.kind == FOLLOW:
            gaps, high = (
                time_gaps(gaps_in_lane, *pair),
                (1.0 + limits.headway_share) * edge.headway[2],
            )
            if len(gaps) and gaps.max() > high:
                message = f"vehicle {who}: drives up to {gaps.max():.2f} s behind vehicle {whom}; allowed are {high:.2f} s"
                yield Violation(Cause.REACTION, 0.0, pair, message)
        elif edge.gap == math.inf:
            continue  # that it stops is a wait, and that it does not go first an order
        elif conflict is None:
            message = f"vehicle {who}: does not come behind vehicle {whom}, for which it waits in the recording"
            yield Violation(Cause.REACTION, 0.0, pair, message)
        else:
            yield from _enters(scenario, conflict, edge, limits)


def _enters(
    scenario: Scenario, conflict: Conflict, edge: Reaction, limits: Limits
) -> Iterator[Violation]:
    who, whom = scenario.vehicles[edge.who].id, scenario.vehicles[edge.whom].id
    clears, enters = passing(scenario, conflict, merges=edge.merges)
    low = min(edge.gap, max((1.0 - limits.gap_share) * edge.gap - limits.anticipation, 0.0))
    high = (1.0 + limits.gap_share) * max(edge.gap, 0.0) + limits.patience
    message = ""
    if not low - _ROUNDED <= enters - clears <= high:
        message = f"enters {enters - clears:.2f} s after vehicle {whom} has cleared; allowed are {low:.2f} to {high:.2f} s"
    if edge.stands:
        before, most = (
            clears - departure(scenario, edge.who, enters),
            max(-edge.lag, 0.0) + limits.anticipation,
        )
        if before > most:
            message = f"leaves {before:.2f} s before vehicle {whom} has cleared; allowed are {most:.2f} s"
    if message:
        yield Violation(Cause.REACTION, enters, (edge.who, edge.whom), f"vehicle {who}: {message}")


def tailgaters(
    scenario: Scenario, gaps_in_lane: LaneGaps, recorded: LaneGaps, limits: Limits
) -> Iterator[Violation]:
    """Yield those who come nearer to one ahead of them in their lane than they do in the template, at the samples."""
    for (who, whom), (speed, gap) in gaps_in_lane.items():
        floor = least_gaps(speed, *recorded.get((who, whom), (np.zeros(0), np.zeros(0))), limits)
        k = int(np.argmax(floor - gap))
        if floor[k] - gap[k] > _NEAR_ENOUGH:
            message = (
                f"vehicle {scenario.vehicles[who].id}: comes within {gap[k]:.2f} m of vehicle {scenario.vehicles[whom].id} "
                f"ahead of it, at {speed[k]:.1f} m/s; its driver keeps {floor[k]:.2f} m"
            )
            yield Violation(Cause.REACTION, 0.0, (who, whom), message)


def least_gaps(speed: Floats, recorded: Floats, gap: Floats, limits: Limits) -> Floats:
    """Return the least gaps (k,) [m], bumper to bumper, at speeds (k,) [m/s], of a driver with recorded speeds and gaps (m,)."""
    alike = np.abs(speed[:, None] - recorded) <= _SUCH_A_SPEED
    least = np.min(np.where(alike, gap, np.inf), axis=1, initial=np.inf)
    nearest = np.where(alike & (recorded > _QUICK), gap / np.maximum(recorded, _QUICK), np.inf)
    enough = _ENOUGH[0] + _ENOUGH[1] * speed
    own = np.where(np.isfinite(least), np.minimum(limits.floor_share * least, enough), -np.inf)
    human = (speed > _QUICK) & (np.min(nearest, axis=1, initial=np.inf) >= limits.least_headway)
    return np.where(human, np.maximum(own, limits.least_headway * speed), own)

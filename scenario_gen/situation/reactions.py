# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Who reacts to whom: followers to leaders, and drivers who enter a shared area second.

Evidence for a reaction (docs/interaction.md has the definitions):

- *need*: the driver would have come within a human margin of the other vehicle if it had driven on
  as before, and the recording shows that it did not;
- *closeness*: it drives in the other's lane, or passes behind it, within a few seconds;
- *likeness*: the motions resemble each other. It says how late and how strongly a driver reacts,
  and is evidence where the closeness is not enough.
"""

from collections.abc import Sequence
from dataclasses import replace
import math

import numpy as np

from scenario_gen.situation.conflicts import Conflict
from scenario_gen.situation.evidence import Evidence, heading_difference, LIMITS, Recording
from scenario_gen.situation.following import following_evidence, nearest_leaders
from scenario_gen.situation.signal_stops import find_signal_stops, SignalExplanations
from scenario_gen.situation.tracks import Track
from scenario_gen.situation.waits import Wait
from scenario_gen.situation.yielding import giving_way, waits_for_leader, yielding_evidence
from scenario_gen.types import Encounter, Reaction, ReactionGraph


def find_reactions(
    encounter: Encounter,
    tracks: Sequence[Track],
    conflicts: Sequence[Conflict],
    waits: Sequence[Wait],
) -> ReactionGraph:
    """Return the graph of reactions.

    Args:
        encounter: the recording.
        tracks: its cleaned tracks.
        conflicts: its conflicts.
        waits: its waits.
    """
    recording = Recording(encounter, tracks, conflicts, waits)
    following = following_evidence(recording)
    leading = nearest_leaders(following)
    yielding = [yielding_evidence(recording, conflict) for conflict in conflicts]
    evidence = [*following, *(pair for pair in yielding if pair is not None)]

    explained = _explained_pairs(recording, following, yielding)
    yields = [giving_way(recording, *pair) for pair in recording.pairs if pair not in explained]
    yields += [pair.reaction for pair in yielding if pair is not None]
    stops = find_signal_stops(encounter, waits) if encounter.lights else ()
    by_light = SignalExplanations(encounter, stops)
    latest: dict[tuple[int, float], Reaction] = {}
    for reaction in yields:
        if reaction is None or by_light.explain(reaction):
            continue
        if waits_for_leader(reaction, leading.get(reaction.who), waits):
            continue
        key = reaction.who, reaction.until  # the last vehicle to clear ends a wait
        latest[key] = max(
            latest.get(key, reaction), reaction, key=lambda each: (each.clears, each.confidence)
        )
    graph = without_circles([*leading.values(), *latest.values()], len(tracks))
    graph = replace(graph, stops=stops, crossings=by_light.crossings)
    return graph if graph.edges else replace(graph, why=_why_none(recording, evidence))


def _explained_pairs(
    recording: Recording,
    following: Sequence[Evidence],
    yielding: Sequence[Evidence | None],
) -> set[tuple[int, int]]:
    """Return the pairs whose behaviour a conflict or following explains."""
    explained = {(pair.who, pair.whom) for pair in following}
    explained |= {(pair.who, pair.whom) for pair in yielding if pair and pair.reaction}
    for conflict in recording.conflicts:
        passes = (conflict.first, conflict.exit_first), (conflict.second, conflict.entry_second)
        if heading_difference(recording.encounter, *passes) < LIMITS.head_on_rad:
            explained |= {(conflict.first, conflict.second), (conflict.second, conflict.first)}
    return explained


def _why_none(recording: Recording, evidence: Sequence[Evidence]) -> str:
    """Say why there is no reaction."""
    encounter = recording.encounter
    nearest = min(evidence, key=lambda pair: pair.time_gap, default=None)
    if nearest is None or nearest.time_gap == math.inf:
        standing = [
            vehicle.label
            for vehicle, speed in zip(encounter.vehicles, encounter.speed, strict=True)
            if np.all(speed < vehicle.kind.waits_below)
        ]
        why = "none drives behind another one in its lane, or crosses its path"
        if recording.conflicts:
            why = "vehicles share an area, but nothing shows that one reacts to another one"
        return f"{why}; {' and '.join(standing)} stands throughout" if standing else why
    who, whom = (encounter.vehicles[n].label for n in (nearest.who, nearest.whom))
    seconds = math.floor(10.0 * nearest.time_gap) / 10.0
    return (
        f"the nearest are {who} and {whom}, and they are never within {seconds:.1f} s of each"
        " other"
    )


def without_circles(edges: Sequence[Reaction], count: int) -> ReactionGraph:
    """Return the graph of reactions of `count` vehicles.

    Cycles are broken at their least certain reaction.
    """
    kept: list[Reaction] = []
    cut: list[Reaction] = []
    reacts_to: list[set[int]] = [set() for _ in range(count)]  # directly or through others
    for edge in sorted(edges, key=lambda edge: (-edge.confidence, edge.who, edge.whom)):
        if edge.who == edge.whom or edge.who in reacts_to[edge.whom]:
            cut.append(edge)
            continue
        kept.append(edge)
        reached = {edge.whom, *reacts_to[edge.whom]}
        for n in range(count):
            if n == edge.who or edge.who in reacts_to[n]:
                reacts_to[n] |= reached
    order = tuple(sorted(range(count), key=lambda n: (len(reacts_to[n]), n)))
    kept.sort(key=lambda edge: (order.index(edge.who), edge.whom, edge.kind, edge.until))
    return ReactionGraph(tuple(kept), order, tuple(cut))

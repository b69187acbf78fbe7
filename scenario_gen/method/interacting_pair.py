# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Two vehicles of an encounter that interact: what they do, and how they react."""

from dataclasses import dataclass

import numpy as np

from scenario_gen.method.evaluation.law import features_of
from scenario_gen.numerics import Floats
from scenario_gen.situation import Conflict, EncounterKind, Situation, Track
from scenario_gen.types import Encounter, Pair, Reaction


@dataclass(frozen=True, eq=False)
class InteractingPair:
    """Two vehicles of an encounter that interact.

    Attributes:
        situation: of the encounter, with all its vehicles.
        kind: what they do.
        features: (F + J,) as in `EncounterFeatures.every`.
        conflict: between the two.
        reactions: of one of them to the other.
    """

    situation: Situation
    kind: EncounterKind
    features: Floats
    conflict: Conflict
    reactions: tuple[Reaction, ...]

    @property
    def encounter(self) -> Encounter:
        """The encounter, with all its vehicles."""
        return self.situation.encounter

    @property
    def tracks(self) -> tuple[Track, Track]:
        """The tracks of the first and of the second vehicle."""
        tracks = self.situation.tracks
        return tracks[self.conflict.first], tracks[self.conflict.second]

    def presence(self, n: int) -> Floats:
        """Return when [s] a vehicle appears and disappears, (2,)."""
        return np.asarray(self.encounter.time[self.encounter.present[n]])


def pair_of(encounter: Encounter, pair: Pair | None = None) -> InteractingPair | None:
    """Return a pair of an encounter, by default the closest; None if it shares no area."""
    situation = Situation.of(encounter)
    member = features_of(encounter, "", 0, pair)
    conflict = None if member.pair is None else situation.conflict(*member.pair)
    if member.kind is None or conflict is None:
        return None
    edges = situation.reactions.edges
    reactions = tuple(edge for edge in edges if {edge.who, edge.whom} == set(conflict.pair))
    return InteractingPair(situation, member.kind, member.every, conflict, reactions)

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The situation: everything that is derived from a recorded encounter, computed once."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.situation.conflicts import Conflict, find_conflicts
from scenario_gen.situation.gaps import lane_gaps, LaneGaps
from scenario_gen.situation.kind import EncounterKind, kind_of
from scenario_gen.situation.reactions import find_reactions
from scenario_gen.situation.separation import least_gaps, separate_recorded, Separation
from scenario_gen.situation.tracks import clean_tracks, drivers_of, find_waits, Track, Wait
from scenario_gen.situation.traffic_side import traffic_side
from scenario_gen.types import Encounter, ReactionGraph, Segmentation


@dataclass(frozen=True, eq=False)
class Situation:
    """A recorded encounter with everything that is derived from it.

    Whoever works on an encounter makes its situation once and passes it on. Each part is computed
    when it is first used.

    Attributes:
        encounter: the recording.

    Example:
        >>> from scenario_gen import read_log
        >>> situation = Situation.of(read_log("my_log.csv").encounters[0])
        >>> situation.reactions.edges[0].kind
        'yield'
    """

    encounter: Encounter

    @classmethod
    def of(cls, encounter: "Encounter | Situation") -> "Situation":
        """Return the situation of an encounter; a situation is returned unchanged."""
        return encounter if isinstance(encounter, Situation) else _situation_of(encounter)

    @cached_property
    def tracks(self) -> tuple[Track, ...]:
        """One cleaned track per vehicle."""
        return clean_tracks(self.encounter)

    @property
    def drivers(self) -> tuple[Track, ...]:
        """The tracks of the vehicles, without pedestrians; all tracks if everybody walks."""
        return drivers_of(self.tracks)

    @cached_property
    def conflicts(self) -> tuple[Conflict, ...]:
        """One conflict per pair of vehicles whose swept footprints intersect, ordered by pair."""
        return find_conflicts(self.encounter)

    def conflict(self, a: int, b: int) -> Conflict | None:
        """Return the conflict between two vehicles; None if they have none."""
        pair = min(a, b), max(a, b)
        return next((conflict for conflict in self.conflicts if conflict.pair == pair), None)

    @cached_property
    def waits(self) -> tuple[Wait, ...]:
        """The waits of all vehicles, ordered by vehicle and time."""
        return find_waits(self.encounter)

    def waits_to_keep(self, segmentation: Segmentation) -> tuple[Wait, ...]:
        """Return the waits that every scenario keeps.

        Without changepoints there is no dwell to keep (paper V-B).
        """
        return self.waits if segmentation.changepoints.size else ()

    @cached_property
    def reactions(self) -> ReactionGraph:
        """The graph of reactions."""
        return find_reactions(self.encounter, self.tracks, self.conflicts, self.waits)

    @cached_property
    def lane_gaps(self) -> LaneGaps:
        """Speeds (k,) [m/s] and bumper-to-bumper gaps (k,) [m] per (follower, leader)."""
        return lane_gaps(self.encounter)

    @cached_property
    def separation(self) -> Separation:
        """The cleaned tracks, separated where footprints overlap in the recording.

        Raises:
            RefusedError: shifts of up to 3 m do not separate them.
        """
        return separate_recorded(self.tracks)

    @cached_property
    def least_gaps(self) -> Floats:
        """(N,) least gap [m] of each vehicle to any other, see `least_gaps`."""
        return least_gaps(self.encounter)

    @property
    def least_gap(self) -> float:
        """Least gap [m] between any two vehicles; negative: they overlap; inf: never together."""
        return float(np.min(self.least_gaps, initial=np.inf))

    def kind(self, a: int, b: int) -> EncounterKind:
        """Return what two vehicles do, see `kind_of`."""
        return kind_of(self.encounter, a, b)

    @property
    def traffic_side(self) -> str:
        """Either "right" or "left"; "" where no oncoming vehicles pass each other."""
        return traffic_side(self.encounter)


@lru_cache(maxsize=4)  # the stages, and roads that are drawn, ask for the same one
def _situation_of(encounter: Encounter) -> Situation:
    """Return the situation of an encounter."""
    return Situation(encounter)

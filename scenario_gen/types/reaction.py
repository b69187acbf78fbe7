# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A reaction of one vehicle to another: its delay, its strength and its confidence."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

from scenario_gen.types.facts import FOLLOW, NamedReaction
from scenario_gen.types.traffic_light import SignalStop
from scenario_gen.types.vehicle import Vehicle

DOUBTFUL_CONFIDENCE = 0.5  # confidence below which an edge is called doubtful


@dataclass(frozen=True)
class Reaction:
    """Vehicle `who` reacts to vehicle `whom`; both are indices into the encounter's vehicles.

    Attributes:
        kind: FOLLOW (same way, behind) or YIELD (crossing or merging, second).
        who: the one that reacts.
        whom: the one it reacts to.
        lag: seconds; of a follower from its leader's change of speed to its own, of a yielder from
            the other's clearing of the conflict area to when it drives off, or is slowest
            (negative if it anticipates).
        gain: how much of a leader's quick change of speed its follower takes over, 0 to 1; 1 of a
            yielder.
        residual: what is its own: metres of gap of a follower, seconds of lag of a yielder (one
            standard deviation).
        confidence: 0 to 1, how much better the record is explained with the edge than without.
        since, until: seconds of the template's clock: during which it follows; from its wait's
            begin to its departure.
        headway: least, median and greatest time gap [s], bumper to bumper, of a follower while it
            drives; zeros of a yielder.
        stands: whether a yielder stands before it goes; one that does not only slows down, or
            passes (`since` is `until`).
        gap: seconds from the other's clearing of the conflict area to a yielder's entry; infinite
            if it does not come behind it: it stops, or lets the other one pass close by.
        merges: whether a yielder enters the other's lane and goes on behind it.
    """

    kind: str
    who: int
    whom: int
    lag: float
    gain: float
    residual: float
    confidence: float
    since: float
    until: float
    headway: tuple[float, float, float] = (0.0, 0.0, 0.0)
    stands: bool = False
    gap: float = 0.0
    merges: bool = False

    @property
    def enters(self) -> float:
        """When [s] a yielder enters the conflict area, on the template's clock."""
        return self.clears + self.gap

    @property
    def clears(self) -> float:
        """When the other one has cleared the conflict area [s, template's clock]; for yielders."""
        return self.until - self.lag

    def named(self, ids: Sequence[str]) -> NamedReaction:
        """Return the reaction with the names `ids` of the vehicles."""
        return NamedReaction(self.kind, ids[self.who], ids[self.whom])

    def words(self, vehicles: Sequence[Vehicle]) -> str:
        """Return the reaction in words, with the vehicles' types and ids."""
        who, whom = vehicles[self.who].label, vehicles[self.whom].label
        if self.kind == FOLLOW:
            text = (
                f"{who} follows {whom}, {self.headway[1]:.1f} s bumper to bumper, "
                f"and answers its speed after {self.lag:.1f} s"
            )
        else:
            text = self._yielding_words(who, whom)
        return f"{text} (doubtful)" if self.doubtful else text

    def _yielding_words(self, who: str, whom: str) -> str:
        """Return in words how vehicle `who` yields to vehicle `whom`."""
        if self.gap == math.inf:
            return f"{who} {'stops' if self.stands else 'slows'} for {whom}"
        is_later = self.gap >= 0.05
        if not self.stands and self.since >= self.until:
            when = f"{self.gap:.1f} s after" if is_later else "just as"
            return f"{who} drives on {when} {whom} has cleared its way"
        when = f"{self.gap:.1f} s behind" if is_later else "right behind"
        verb = f"waits for {whom}, then" if self.stands else f"slows for {whom} and"
        return f"{who} {verb} passes {when} it"

    @property
    def doubtful(self) -> bool:
        """Whether the record hardly distinguishes it from none."""
        return self.confidence < DOUBTFUL_CONFIDENCE

    def document(self, vehicles: Sequence[Vehicle]) -> dict[str, str | float | bool]:
        """Return the reaction as a flat document, with the vehicles' ids and the words."""
        return {
            "kind": self.kind,
            "who": vehicles[self.who].id,
            "whom": vehicles[self.whom].id,
            "lag": round(self.lag, 3),
            "gain": round(self.gain, 3),
            "residual": round(self.residual, 3),
            "confidence": round(self.confidence, 3),
            "doubtful": self.doubtful, "words": self.words(vehicles),
        }  # fmt: skip


@dataclass(frozen=True)
class ReactionGraph:
    """All reactions of an encounter, without a circle.

    Attributes:
        edges: the reactions, those of a vehicle behind those of the ones it reacts to.
        order: all vehicles, each behind those it reacts to.
        cut: reactions that were left out because they close a circle, each the least sure one of
            it.
        why: why there is none, "" if there is one.
        stops: stops for traffic lights.
        crossings: of vehicles over the stop lines of lights: index, when [s], and how long [s]
            before or after red.
    """

    edges: tuple[Reaction, ...]
    order: tuple[int, ...]
    cut: tuple[Reaction, ...] = ()
    why: str = ""
    stops: tuple[SignalStop, ...] = ()
    crossings: tuple[tuple[int, float, float], ...] = ()

    def of(self, who: int) -> tuple[Reaction, ...]:
        """Return the reactions of vehicle `who`."""
        return tuple(edge for edge in self.edges if edge.who == who)

    def sentences(
        self, vehicles: Sequence[Vehicle], kept: Sequence[Reaction] | None = None
    ) -> tuple[str, ...]:
        """Return one sentence for each edge; it says whether the edge is among the `kept`."""
        free = "" if kept is None else ": not enforced"
        sentences = [
            edge.words(vehicles) if edge in (kept or ()) else f"{edge.words(vehicles)}{free}"
            for edge in self.edges
        ]
        sentences += [
            f"{edge.words(vehicles)}: left out, as it closes a cycle of reactions"
            for edge in self.cut
        ]
        sentences += [stop.words(vehicles[stop.who].label) for stop in self.stops]
        sentences += [
            f"{vehicles[who].label} crosses its stop line at red"
            for who, _, slack in self.crossings
            if slack == 0.0
        ]
        return tuple(sentences) or (f"no reactions detected{self.why and ': '}{self.why}",)

    def document(
        self, vehicles: Sequence[Vehicle], kept: Sequence[Reaction] | None = None
    ) -> dict[str, Any]:
        """Return a JSON document: edges, with whether they are `kept`, cut edges and sentences."""
        return {
            "edges": [
                edge.document(vehicles) | ({} if kept is None else {"kept": edge in kept})
                for edge in self.edges
            ],
            "cut": [edge.document(vehicles) for edge in self.cut],
            "sentences": list(self.sentences(vehicles, kept)),
        }

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A recording that is too long for a road is shortened to its interaction, as little as possible.

Each vehicle's track may lose its begin and its end, as long as all conflicts, orders, reactions,
waits and turns remain (`interaction_windows`). The shortest parts tell whether shortening helps;
in one of them the beginning of a braking may be lost. Then longer ones are tried: on a map where
the lanes reach; else the one with the smallest loss first, the same time for all vehicles, in
quarters, then a time for each, likewise.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, islice, product
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting import FittingConfig
from scenario_gen.numerics import Floats
from scenario_gen.situation import (
    describe_turn,
    interaction_windows,
    keeps_interaction,
    MIN_LOSS_S,
    Situation,
    turn_of,
)
from scenario_gen.types import Encounter, Note, NoteKind, YIELD

_LOSS_SHARE = (0.25, 0.5, 0.75, 1.0)  # of what can be lost
_PROPOSED_COUNT = 2  # places on a map for which a part is tried
_TIGHTEST_COUNT = 3  # parts of which one must fit, or no longer one is tried

Made = TypeVar("Made")


def fitting_part(
    attempt: Callable[[Encounter], Made],
    encounter: Encounter,
    refusal: RefusedError,
    config: FittingConfig = FittingConfig(),
    windows: Iterable[Floats] = (),
) -> tuple[Encounter, Made, Note]:
    """Return the part of a recording that fits with the smallest loss, and a note on it.

    Between them is what `attempt` returned for the part.

    Args:
        attempt: raises a RefusedError if a recording does not fit.
        encounter: the recording.
        refusal: why the whole does not fit.
        config: what is kept before and after the interaction.
        windows: (N, 2) [s] each, which the road is long enough for, the best first.

    Raises:
        RefusedError: the refusal, with the lanes that the shortest form needs: it does not fit.
    """
    search = _Search(attempt, Situation.of(encounter), config)
    part = search.shortest_loss(windows)
    if part is None:
        search.add_remedy(refusal)
        raise refusal
    parts = in_words(encounter, part) + search.lost_braking(part)
    return part, search.made[-1], Note.of(NoteKind.SHORTENED, parts=parts, reason=str(refusal))


def cut(encounter: Encounter, windows: Floats) -> Encounter:
    """Return an encounter with each vehicle in its window (N, 2) [s]; the clock starts at 0 s."""
    samples = windows / encounter.dt
    kept = np.column_stack((np.floor(samples[:, 0] + 1e-6), np.ceil(samples[:, 1] - 1e-6)))
    kept = np.clip(kept.astype(np.int64), encounter.present[:, :1], encounter.present[:, 1:])
    first, last = int(kept[:, 0].min()), int(kept[:, 1].max())
    part = encounter.select(range(len(kept)), first, last)
    return replace(part, present=kept - first)


def in_words(encounter: Encounter, part: Encounter) -> str:
    """Return which part of the recording is used, for each vehicle if they differ."""
    offset = (part.start_ns - encounter.start_ns) * 1e-9
    spans = [f"{a + offset:.1f} to {b + offset:.1f} s" for a, b in part.time[part.present]]
    if len(set(spans)) == 1:
        return f"{spans[0]} of {encounter.duration:.1f} s"
    each = [f"vehicle {name}: {span}" for name, span in zip(part.ids, spans, strict=True)]
    return f"{', '.join(each)} of {encounter.duration:.1f} s"


class _Way(NamedTuple):
    """A way of shortening: the tightest windows (N, 2) [s], and whether brakings remain whole."""

    windows: Floats
    whole_braking: bool


@dataclass(eq=False)
class _Search(Generic[Made]):
    """The search for the shortest loss with which a recording fits.

    `made` is what the attempts with parts that fit returned; the last one is that of the result.
    """

    attempt: Callable[[Encounter], Made]
    situation: Situation
    config: FittingConfig
    refusals: list[Encounter] = field(default_factory=list)
    made: list[Made] = field(default_factory=list)

    def shortest_loss(self, windows: Iterable[Floats]) -> Encounter | None:
        """Return the recording with the smallest loss found; None if it does not fit shortened."""
        ways = list(self._ways())
        tightest = self._first_fitting(ways[-_TIGHTEST_COUNT:])
        if tightest is None:  # the others are longer
            return None
        proposed = islice(self._proposed(windows, ways[-2:]), _PROPOSED_COUNT)
        longer = chain(proposed, ways[:-_TIGHTEST_COUNT])
        return self._first_fitting(longer) or tightest

    def _first_fitting(self, ways: Iterable[_Way]) -> Encounter | None:
        return next(filter(None, map(self._fitting, ways)), None)

    def _ways(self) -> Iterator[_Way]:
        """Yield the ways of shortening that keep the interaction, the longest first."""
        encounter = self.situation.encounter
        whole = encounter.time[encounter.present]
        each, braking = (
            interaction_windows(
                self.situation, self.config.lead, self.config.follow_up, whole_braking=kept
            )
            for kept in (True, False)
        )
        common = np.tile((each[:, 0].min(), each[:, 1].max()), (len(each), 1))
        shares = product((common, each), _LOSS_SHARE)
        ways = [_Way(whole + share * (shortest - whole), True) for shortest, share in shares]
        ways.append(_Way(braking, False))
        for k, way in enumerate(ways):
            new = not any(np.array_equal(way.windows, other.windows) for other in ways[:k])
            shortens = np.abs(way.windows - whole).max() >= MIN_LOSS_S
            if new and shortens and self._part(way) is not None:
                yield way

    def _proposed(self, windows: Iterable[Floats], needed: Sequence[_Way]) -> Iterator[_Way]:
        """Yield the windows that contain what is needed, if possible the same for all vehicles."""
        pairs = [
            (np.tile((each[:, 0].max(), each[:, 1].min()), (len(each), 1)), each)
            for each in windows
        ]
        for way, proposed in product(needed, chain.from_iterable(pairs)):
            if ((way.windows - proposed) * (1.0, -1.0)).min() >= 0.0:
                yield _Way(proposed, way.whole_braking)

    def add_remedy(self, refusal: RefusedError) -> None:
        """Add to a refusal the lanes that the shortest form of the recording needs."""
        whole = self.situation.encounter
        part = self.refusals[-1] if self.refusals else whole
        needed = [
            f"vehicle {track.vehicle.id} {describe_turn(turn_of(track))} within "
            f"{track.travelled:.0f} m"
            for track in Situation.of(part).drivers
            if not track.still
        ]
        if len(needed) > 3:
            needed[3:] = [f"and {len(needed) - 3} more"]
        form = "It needs a road on which "
        if whole.duration - part.duration >= MIN_LOSS_S:
            begin = (part.start_ns - whole.start_ns) * 1e-9
            used = f"{begin:.1f} to {begin + part.duration:.1f} s of {whole.duration:.1f} s"
            form = f"Shortened to its interaction ({used}), it needs a road on which "
        hint = "" if self.refusals else "; log.start and log.end choose a part of it"
        refusal.args = (f"{refusal}. {form}{', '.join(needed)}{hint}",)

    def lost_braking(self, part: Encounter) -> str:
        """Return which vehicles begin to brake before their part begins, for the note on it."""
        whole = self.situation.encounter
        offset = (part.start_ns - whole.start_ns) * 1e-9
        begins = part.time[part.present[:, 0]] + offset
        who = {
            whole.ids[edge.who]: None
            for edge in self.situation.reactions.edges
            if edge.kind == YIELD and edge.since < begins[edge.who] - whole.dt
        }
        return f"; lost: the beginning of the braking of vehicle {', '.join(who)}" if who else ""

    def _part(self, way: _Way) -> Encounter | None:
        """Return the recording cut to windows if it keeps its interaction."""
        part = cut(self.situation.encounter, way.windows)
        kept = keeps_interaction(
            self.situation, Situation.of(part), whole_braking=way.whole_braking
        )
        return part if kept else None

    def _fitting(self, way: _Way) -> Encounter | None:
        """Return the recording cut to windows if it keeps its interaction and fits."""
        part = self._part(way)
        if part is None:
            return None
        try:
            self.made.append(self.attempt(part))
        except RefusedError:
            self.refusals.append(part)
            return None
        return part

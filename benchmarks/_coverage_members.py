# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How well a few recordings, and scenarios generated from them, cover unseen traffic.

Both as of Kynkäänniemi et al. (2019), with balls about recorded encounters. An encounter is that
of its most critical pair. Its features (FEATURES) are independent of the place, and the same for
recorded and generated motions; distances are in standard deviations of the recorded encounters of
the same kind, root mean square over features. Of one kind r is a quantile of the distances of
encounters to their nearest in other recordings.

- coverage: share of unseen encounters, which are of other recordings, within r of the nearest
  member;
- precision: share of members within r of a recorded encounter of another recording than their
  template's.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
import math
from typing import Protocol

import numpy as np
from scipy.spatial import distance

from scenario_gen.method.evaluation.law import (
    EncounterFeatures,
    features_of,
    scenario_features,
)
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.situation import EncounterKind
from scenario_gen.types import Encounter, Interval, join_ego, Scenario

KINDS = tuple(EncounterKind)
MIN_UNSEEN_COUNT, MIN_UNSEEN_SESSIONS = 10, 2  # of a draw that counts
MIN_RADIUS_RATIO = 0.05  # of a standard deviation: two files may hold the same encounter
MIN_SPREAD_RATIO = 0.05  # of the largest spread: a constant feature does not decide alone


def in_words(share: Interval) -> str:
    """Return a share with its quantiles in brackets."""
    return f"{share.value:.2f} [{share.low:.2f}, {share.high:.2f}]"


def _over_draws(values: Iterable[float]) -> Interval:
    """Median and 5 and 95 % quantiles of one value per draw; NaN values are left out."""
    told = [value for value in values if math.isfinite(value)]
    low, middle, high = np.quantile(told, [0.05, 0.5, 0.95]).tolist() if told else [math.nan] * 3
    return Interval(middle, low, high)


class GeneratedSet(Protocol):
    """Scenarios from one encounter, e.g. a `GenerationResult`."""

    @property
    def encounter(self) -> Encounter:
        """The template."""

    def __iter__(self) -> Iterator[Scenario]:
        """Return the scenarios."""


@dataclass(frozen=True, eq=False)
class Members:
    """Recorded encounters with a conflict area, and the generated ones.

    r is the quantile `radius_share` of the distances from recorded encounters to the nearest one
    in other recordings, which makes it the precision of the recorded encounters.
    """

    recorded: Sequence[EncounterFeatures]
    made: Sequence[EncounterFeatures]
    radius_share: float = 0.5

    @cached_property
    def near(self) -> "_Near":
        """How near they are to each other."""
        return _Near.of(self.recorded, self.made, self.radius_share)

    @property
    def recordings(self) -> int:
        """Number of recordings."""
        return len({member.recording for member in self.recorded})

    def of_kind(self, kind: str) -> "Members":
        """Return the recorded encounters of a kind, and everything generated from them."""
        chosen = [n for n, member in enumerate(self.recorded) if member.kind == kind]
        index = {n: k for k, n in enumerate(chosen)}

        def renumbered(members: Sequence[EncounterFeatures]) -> list[EncounterFeatures]:
            return [
                replace(member, template=index[member.template])
                for member in members
                if member.template in index
            ]

        return replace(self, recorded=renumbered(self.recorded), made=renumbered(self.made))

    def shares(
        self, count: int, *, draws: int = 200, seed: int = 0
    ) -> tuple[Interval, Interval, Interval, Interval]:
        """Return coverage and precision for random templates.

        Args:
            count: number of templates.
            draws: of templates, recording by recording in a random order.
            seed: of the draws.

        Returns:
            Coverage by the templates alone, with the generated members, precision of the
            generated members, and of the templates.
        """
        near, rng = self.near, np.random.default_rng(seed)
        shares = zip(*(near.judged(near.chosen(rng, count)) for _ in range(draws)), strict=True)
        coverage_alone, coverage, precision, recorded = map(_over_draws, shares)
        return coverage_alone, coverage, precision, recorded


def members_of(results: Iterable[tuple[str, GeneratedSet]]) -> Members:
    """Return the members of recordings and generated sets.

    Args:
        results: the name of the recording and what was generated from one of its encounters. An
            encounter that occurs repeatedly, as on several roads, counts once. An encounter with
            another outcome of a decision is not a recorded one: what is generated from it belongs
            to the recorded one, and is left out if that is not among the results.
    """
    recorded: list[EncounterFeatures] = []
    made: list[EncounterFeatures] = []
    by_name: dict[str, EncounterFeatures] = {}
    decided: list[tuple[str, list[EncounterFeatures]]] = []
    known: dict[tuple[object, ...], EncounterFeatures] = {}
    for recording, result in results:
        encounter = result.encounter
        is_recorded = encounter.recording == encounter.name
        arrays = (encounter.time, encounter.position, encounter.speed)
        motion = (is_recorded, *(values.tobytes() for values in arrays))
        is_new = motion not in known
        if is_new:
            known[motion] = features_of(encounter, recording, len(recorded))
        template = known[motion]
        if template.kind is None:
            continue
        generated = [
            scenario_features(join_ego(scenario), template, encounter) for scenario in result
        ]
        if not is_recorded:
            decided.append((encounter.recording, generated))
            continue
        made += generated
        if is_new:
            recorded.append(template)
            by_name[encounter.name] = template
    for name, generated in decided:
        if name in by_name:
            parent = by_name[name]
            made += [
                replace(member, recording=parent.recording, template=parent.template)
                for member in generated
            ]
    return Members(recorded, made)


@dataclass(frozen=True, eq=False)
class _Near:
    """How near members are to each other.

    Attributes:
        recording: (R,) number of each recorded member's recording.
        template: (M,) index of each generated member's template.
        scaled: (R + M, F) features in standard deviations of the kind, recorded ones first.
        distances: (R + M, R) distances to recorded members in units of r, inf between kinds.
    """

    recording: Ints
    template: Ints
    scaled: Floats
    distances: Floats

    @classmethod
    def of(
        cls,
        recorded: Sequence[EncounterFeatures],
        made: Sequence[EncounterFeatures],
        radius_share: float,
    ) -> "_Near":
        """Scale features by kind, and measure all distances."""
        every = [*recorded, *made]
        recording = np.unique([member.recording for member in recorded], return_inverse=True)[1]
        kinds = np.array(
            [-1 if member.kind is None else KINDS.index(member.kind) for member in every]
        )
        scaled = np.array([member.features for member in every])
        distances = np.full((len(every), len(recorded)), math.inf)
        for kind in np.unique(kinds[: len(recorded)]):
            rows = np.flatnonzero(kinds == kind)
            columns = np.flatnonzero(kinds[: len(recorded)] == kind)
            spread = scaled[columns].std(axis=0)
            scaled[rows] /= np.maximum(spread, max(MIN_SPREAD_RATIO * float(spread.max()), 1e-9))
            between = distance.cdist(scaled[rows], scaled[columns]) / math.sqrt(scaled.shape[1])
            others = np.where(
                recording[columns, None] == recording[columns], math.inf, between[: len(columns)]
            )
            nearest = others.min(axis=1)
            known = nearest[np.isfinite(nearest)]
            if len(known):
                distances[np.ix_(rows, columns)] = between / max(
                    float(np.quantile(known, radius_share)), MIN_RADIUS_RATIO
                )
        template = np.array([member.template for member in made], dtype=np.int64)
        return cls(recording, template, scaled, distances)

    def chosen(self, rng: np.random.Generator, count: int) -> Ints:
        """Draw `count` templates, recording by recording in a random order."""
        names = rng.permutation(self.recording.max() + 1)
        shuffled = rng.permutation(len(self.recording))
        rank = np.argsort(names)[self.recording[shuffled]]
        return shuffled[np.argsort(rank, kind="stable")][:count]

    def judged(self, chosen: Ints) -> tuple[float, float, float, float]:
        """Return coverage alone and with generated ones, precision of generated and templates.

        NaN where the templates leave too few encounters, or sessions, unseen.
        """
        unseen = ~np.isin(self.recording, self.recording[chosen])
        sessions = np.unique(self.recording[unseen])
        if unseen.sum() < MIN_UNSEEN_COUNT or len(sessions) < MIN_UNSEEN_SESSIONS:
            return (math.nan,) * 4
        made = np.flatnonzero(np.isin(self.template, chosen))
        members = len(self.recording) + made
        return (
            self._covered(chosen, unseen),
            self._covered(np.concatenate([chosen, members]), unseen),
            self._precision(members, self.recording[self.template[made]]),
            self._precision(chosen, self.recording[chosen]),
        )

    def _covered(self, members: Ints, unseen: Bools) -> float:
        """The share of unseen encounters within r of a member."""
        return float((self.distances[members][:, unseen].min(axis=0) <= 1.0).mean())

    def _precision(self, members: Ints, sources: Ints) -> float:
        """The share of members (K,) within r of an encounter from another recording (K,)."""
        others = np.where(sources[:, None] == self.recording, math.inf, self.distances[members])
        return float((others.min(axis=1) <= 1.0).mean()) if len(members) else math.nan

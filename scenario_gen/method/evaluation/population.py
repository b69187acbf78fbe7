# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How well a few recordings, and scenarios generated from them, cover unseen traffic.

Both as of Kynkäänniemi et al. (2019), with balls about recorded encounters. An encounter is that
of its most critical pair. Its features (FEATURES) are independent of the place, and the same for
recorded and generated motions; distances are in standard deviations of the recorded encounters of
the same kind, root mean square over features. Of one kind r is the median distance of an encounter
to its nearest in other recordings.

- coverage: share of unseen encounters, which are of other recordings, within r of the nearest
  member;
- precision: share of members within r of a recorded encounter of another recording than their
  template's.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
import math
from typing import Any, Protocol

import numpy as np
from scipy.spatial import distance

from scenario_gen.base.errors import InputError
from scenario_gen.method.evaluation.encounter_features import (
    EncounterFeatures,
    FEATURES,
    features_of,
    scenario_features,
)
from scenario_gen.method.evaluation.population_result import (
    COVERAGE_GOAL_SHARE,
    CoveragePoint,
    Population,
    Unreached,
)
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.situation import EncounterKind
from scenario_gen.types import (
    Encounter,
    Interval,
    join_ego,
    Recombined,
    Scenario,
)

KINDS = tuple(EncounterKind)
MIN_RADIUS_RATIO = 0.05  # of a standard deviation: two files may hold the same encounter
MIN_SPREAD_RATIO = 0.05  # of the largest spread: a constant feature does not decide alone
MAX_TEMPLATE_SHARE = 0.5  # of the encounters; the other recordings stay unseen
MAX_EXTRAPOLATION_FACTOR = 100.0  # of the largest measured number of templates


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


def population_of(
    results: Iterable[tuple[str, GeneratedSet]],
    counts: Sequence[int] = (5, 10, 20),
    *,
    draws: int = 200,
    seed: int = 0,
) -> Population:
    """Measure what recordings and the sets generated from them cover.

    Args:
        results: the name of the recording and what was generated from one of its encounters. An
            encounter that occurs repeatedly, as on several roads, counts once.
        counts: templates to draw; those that the recordings do not hold are left out.
        draws: of templates, recording by recording in a random order.
        seed: of the draws.

    Raises:
        InputError: fewer than two recordings, or none whose vehicles share an area.
    """
    every = members_of(results)
    if every.recordings < 2:
        raise InputError(
            "encounters of at least two recordings are needed; give results of more logs"
        )
    drawn = [n for n in sorted(set(counts)) if n <= MAX_TEMPLATE_SHARE * len(every.recorded)]
    if not drawn:
        known, most = len(every.recorded), int(MAX_TEMPLATE_SHARE * len(every.recorded))
        raise InputError(
            f"{known} encounters share an area: at most {most} templates can be drawn; "
            "ask for fewer, or give more logs"
        )
    near, points = every.near, every.curve(drawn, draws=draws, seed=seed)
    counted, generated = (
        dict(Counter(member.kind_name for member in members))
        for members in (every.recorded, every.made)
    )
    by_kind: dict[str, tuple[CoveragePoint, ...]] = {}
    for kind in KINDS:
        of_kind = every.of_kind(kind)
        few = [n for n in drawn if n <= MAX_TEMPLATE_SHARE * len(of_kind.recorded)]
        if few and of_kind.recordings > 1:
            by_kind[kind] = of_kind.curve(few, draws=draws, seed=seed)
    return Population(
        counted,
        generated,
        points,
        by_kind,
        tuple(near.unreached(every.names)),
        near.farthest(every),
        _needed(points),
    )


@dataclass(frozen=True, eq=False)
class Members:
    """Recorded encounters with a shared area, their names, and the generated ones.

    r is the quantile `radius_share` of the distances from recorded encounters to the nearest one
    in other recordings, which makes it the precision of the recorded encounters.
    """

    recorded: Sequence[EncounterFeatures]
    made: Sequence[EncounterFeatures]
    names: Sequence[str] = ()
    radius_share: float = 0.5

    @cached_property
    def near(self) -> "_Near":
        """How near they are to each other."""
        return _Near.of(self.recorded, self.made, self.radius_share)

    @property
    def recordings(self) -> int:
        """Number of recordings."""
        return len({member.recording for member in self.recorded})

    def name_of(self, member: EncounterFeatures) -> str:
        """Return the name of a member's template."""
        first = self.names[member.template]
        return Recombined(first, self.names[member.other]).name if member.other >= 0 else first

    def of_kind(self, kind: str) -> "Members":
        """Return the recorded encounters of a kind, and everything generated from them."""
        chosen = [n for n, member in enumerate(self.recorded) if member.kind == kind]
        index = {n: k for k, n in enumerate(chosen)} | {-1: -1}

        def renumbered(members: Sequence[EncounterFeatures]) -> list[EncounterFeatures]:
            return [
                replace(member, template=index[member.template], other=index[member.other])
                for member in members
                if member.template in index
            ]

        names = [self.names[n] for n in chosen if n < len(self.names)]
        recorded, made = renumbered(self.recorded), renumbered(self.made)
        return replace(self, recorded=recorded, made=made, names=names)

    def shares(
        self, count: int, *, draws: int = 200, seed: int = 0
    ) -> tuple[Interval, Interval, Interval, Interval]:
        """Return coverage and precision for random templates, as in `CoveragePoint`.

        Arguments as of `population_of`.
        """
        near, rng = self.near, np.random.default_rng(seed)
        shares = zip(*(near.judged(near.chosen(rng, count)) for _ in range(draws)), strict=True)
        coverage_alone, coverage, precision, recorded = map(_over_draws, shares)
        return coverage_alone, coverage, precision, recorded

    def curve(
        self, counts: Sequence[int], *, draws: int = 200, seed: int = 0
    ) -> tuple[CoveragePoint, ...]:
        """Return one point of the curve; arguments as in `population_of`."""
        near, rng = self.near, np.random.default_rng(seed)
        alone = {
            n: _over_draws(near.alone(near.chosen(rng, n)) for _ in range(draws))
            for n in range(1, len(self.recorded))
        }

        def stands_for(coverage: float) -> float:
            return next((m for m, share in alone.items() if share.value >= coverage), math.inf)

        points = []
        for n in counts:
            shares = self.shares(n, draws=draws, seed=seed)
            equal = [
                stands_for(coverage) / n
                for coverage in (shares[1].value, shares[1].low, shares[1].high)
            ]
            points.append(CoveragePoint(n, *shares, Interval(*equal)))
        return tuple(points)


def members_of(results: Iterable[tuple[str, GeneratedSet]]) -> Members:
    """Return the members of recordings and generated sets; arguments as in `population_of`.

    An encounter with vehicles of two others, or with another outcome of a decision, is not a
    recorded one: what is generated from it belongs to those. It is left out where one of these is
    not among the results.
    """
    recorded: list[EncounterFeatures] = []
    made: list[EncounterFeatures] = []
    names: list[str] = []
    derived: list[tuple[tuple[str, str], list[EncounterFeatures]]] = []
    known: dict[tuple[Any, ...], EncounterFeatures] = {}
    for recording, result in results:
        encounter = result.encounter
        parents = _parents(encounter)
        arrays = (encounter.time, encounter.position, encounter.speed)
        motion = (parents, *(values.tobytes() for values in arrays))
        is_new = motion not in known
        if is_new:
            known[motion] = features_of(encounter, recording, len(recorded))
        template = known[motion]
        if template.kind is None:
            continue
        generated = [
            scenario_features(join_ego(scenario), template, encounter) for scenario in result
        ]
        if parents is not None:
            derived.append((parents, generated))
            continue
        made += generated
        if is_new:
            recorded.append(template)
            names.append(encounter.name)
    by_name = dict(zip(names, recorded, strict=True))
    for (first, second), generated in derived:
        made += _derived(first, second, generated, by_name)
    return Members(recorded, made, names)


def _derived(
    first: str,
    second: str,
    generated: Sequence[EncounterFeatures],
    recorded: Mapping[str, EncounterFeatures],
) -> list[EncounterFeatures]:
    """Return what was generated from two recorded encounters by name, if both are known."""
    if first not in recorded or (second and second not in recorded):
        return []
    parent, other = recorded[first], recorded[second].template if second else -1
    return [
        replace(member, recording=parent.recording, template=parent.template, other=other)
        for member in generated
    ]


def _parents(encounter: Encounter) -> tuple[str, str] | None:
    """Return the names of the recorded encounters that another one was made from.

    The second is "" if there is one only; None: it was recorded.
    """
    source = encounter.source
    if isinstance(source, Recombined):
        return source.first, source.second
    return None if encounter.recording == encounter.name else (encounter.recording, "")


def _needed(points: Sequence[CoveragePoint]) -> float:
    """Return the number of templates for the coverage goal by a power law; inf if too far."""
    missed = np.array([1.0 - point.generated.value for point in points])
    if len(points) < 2 or missed.min() <= 0.0:
        return math.inf
    slope, level = np.polyfit(np.log([point.templates for point in points]), np.log(missed), 1)
    needed = (math.log(1.0 - COVERAGE_GOAL_SHARE) - level) / slope if slope < 0.0 else math.inf
    return (
        math.ceil(math.exp(needed))
        if needed < math.log(MAX_EXTRAPOLATION_FACTOR * points[-1].templates)
        else math.inf
    )


@dataclass(frozen=True, eq=False)
class _Near:
    """How near members are to each other.

    Attributes:
        members: recorded ones.
        recording: (R,) number of each one's recording.
        template: (M, 2) indices of each generated member's templates, twice the same but for
            recombined ones.
        scaled: (R + M, F) features in standard deviations of the kind, recorded ones first.
        distances: (R + M, R) distances to recorded members in units of r, inf between kinds.
    """

    members: Sequence[EncounterFeatures]
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
        template = [
            (member.template, member.template if member.other < 0 else member.other)
            for member in made
        ]
        return cls(
            recorded,
            recording,
            np.array(template, dtype=np.int64).reshape(-1, 2),
            scaled,
            distances,
        )

    def chosen(self, rng: np.random.Generator, count: int) -> Ints:
        """Draw `count` templates, recording by recording in a random order."""
        names = rng.permutation(self.recording.max() + 1)
        shuffled = rng.permutation(len(self.recording))
        rank = np.argsort(names)[self.recording[shuffled]]
        return shuffled[np.argsort(rank, kind="stable")][:count]

    def alone(self, chosen: Ints) -> float:
        """Return the share of unseen encounters that templates cover; NaN if all are seen."""
        return self._covered(chosen, self._unseen(chosen))

    def judged(self, chosen: Ints) -> tuple[float, float, float, float]:
        """Return coverage alone and with generated ones, precision of generated and templates."""
        unseen = self._unseen(chosen)
        if not unseen.any():
            return (math.nan,) * 4
        members = len(self.recording) + np.flatnonzero(np.isin(self.template, chosen).all(axis=1))
        sources = self.recording[self.template[members - len(self.recording)]]
        return (
            self._covered(chosen, unseen),
            self._covered(np.concatenate([chosen, members]), unseen),
            self._precision(members, sources),
            self._precision(chosen, self.recording[chosen, None]),
        )

    def _unseen(self, chosen: Ints) -> Bools:
        """(R,) which encounters are of other recordings than those of some templates."""
        return ~np.isin(self.recording, self.recording[chosen])

    def _covered(self, members: Ints, unseen: Bools) -> float:
        """The share of unseen encounters within r of a member."""
        return (
            float((self.distances[members][:, unseen].min(axis=0) <= 1.0).mean())
            if unseen.any()
            else math.nan
        )

    def _precision(self, members: Ints, sources: Ints) -> float:
        """The share of members within r of an encounter from another recording (K, 1 or 2)."""
        is_source = (sources[..., None] == self.recording).any(axis=1)
        others = np.where(is_source, math.inf, self.distances[members])
        return float((others.min(axis=1) <= 1.0).mean()) if len(members) else math.nan

    def unreached(self, names: Sequence[str]) -> list[Unreached]:
        """Return recorded encounters that no other recording comes near, the farthest first."""
        source = np.concatenate(
            [np.repeat(self.recording[:, None], 2, axis=1), self.recording[self.template]]
        )
        unreached = []
        for n, member in enumerate(self.members):
            far = np.where(
                (source == self.recording[n]).any(axis=1), math.inf, self.distances[:, n]
            )
            nearest = int(far.argmin())
            if far[nearest] > 1.0:
                unreached.append(
                    Unreached(
                        names[n],
                        member.kind_name,
                        float(far[nearest]),
                        self._differ(nearest, n, far[nearest]),
                    )
                )
        return sorted(unreached, key=lambda entry: -entry.distance)

    def farthest(self, everything: Members) -> tuple[Unreached, ...]:
        """Return the generated members that are farthest from all recorded ones."""
        away = self.distances[len(self.members) :]
        nearest = away.min(axis=1, initial=math.inf)
        farthest = []
        for n in np.argsort(-nearest, kind="stable")[:10].tolist():
            member = everything.made[n]
            closest = int(away[n].argmin())
            feature = self._differ(len(self.members) + n, closest, nearest[n])
            farthest.append(
                Unreached(
                    everything.name_of(member),
                    member.kind_name,
                    float(nearest[n]),
                    feature,
                    member.scenario,
                )
            )
        return tuple(farthest)

    def _differ(self, n: int, recorded: int, distances: float) -> str:
        """Return the feature in which a member differs most from a recorded one."""
        if not math.isfinite(distances):
            return "no other of its kind"
        return FEATURES[int(np.abs(self.scaled[n] - self.scaled[recorded]).argmax())]

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How much unseen traffic a few recordings stand for: coverage and precision of what is generated from them.

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
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
import math

import numpy as np
from scipy.spatial import distance

from scenario_gen.base.errors import InputError
from scenario_gen.method.evaluation.geometry import footprint_distance
from scenario_gen.method.evaluation.measures import figures_of, PERIOD
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.situation import (
    Conflict,
    conflicts_by_pair,
    EncounterKind,
    find_conflicts,
    kind_of,
)
from scenario_gen.types import (
    Encounter,
    GenerationResult,
    Interval,
    join_ego,
    Motion,
    Pair,
    Recombined,
    Scenario,
)

NO_SHARED_AREA = "apart"  # counts the scenarios whose pair shares no area: they are near nothing
KINDS = tuple(EncounterKind)
EACH = (
    "first speed",
    "least speed before",
    "speed at conflict",
    "braking",
    "acceleration",
    "standing time",
)
COMMON = ("gap", "arrival gap", "distance", "time to collision", "closing speed", "approach")
FEATURES = (*COMMON, *(f"{name} of the {who}" for who in ("first", "second") for name in EACH))
DISTANCE = FEATURES.index("distance")
LONGEST_S, FARTHEST_M = 10.0, 30.0  # gaps and times above, distances above, are as good as this
SECOND = round(1.0 / PERIOD)  # samples
STANDS_MPS = 0.5
SMALLEST_R = 0.05  # standard deviations: the same encounter in two files makes no smaller ball
SMALLEST_SHARE = 0.05  # of the largest standard deviation: a feature in which nobody differs does not count for all
CHOSEN = (
    0.5  # share of the encounters that are drawn at most; those of other recordings are unseen
)
SHOWN = 10  # scenarios that are like nothing recorded
WANTED = 0.9  # coverage
FARTHEST_TOLD = 100.0  # times the largest number of templates that was measured


@dataclass(frozen=True, eq=False)
class Member:
    """An encounter, recorded or generated.

    Attributes:
        kind: what the pair does; None if it shares no area.
        features: (F,).
        recording: its name; of a generated one that of its template.
        template: place of its template among the recorded.
        pair: its vehicles that count, None if no two share an area.
        other: place of the recorded encounter whose second vehicle it has, too, if it is of a
            recombined one; else -1.
        scenario: its number, -1 of a recorded one.
    """

    kind: EncounterKind | None
    features: Floats
    recording: str
    template: int
    pair: Pair | None
    other: int = -1
    scenario: int = -1

    @property
    def kind_name(self) -> str:
        """The kind in words."""
        return self.kind or NO_SHARED_AREA


@dataclass(frozen=True)
class Point:
    """What so many templates cover, alone and with what is generated from them, and how precise the generated are.

    Shares are medians over draws of templates, with the 5 and 95 % quantiles.

    Attributes:
        templates: drawn.
        alone: coverage by the templates.
        generated: coverage by templates and generated.
        precision: of the generated; `recorded`: of the templates themselves.
        multiplier: recordings that cover alone as much (with the quantiles of `generated`), over
            `templates`; inf: more than there are.
    """

    templates: int
    alone: Interval
    generated: Interval
    precision: Interval
    recorded: Interval
    multiplier: Interval


@dataclass(frozen=True)
class Unreached:
    """A recorded encounter that nothing of other recordings comes near, or a scenario that is near no recorded encounter.

    Attributes:
        encounter: its name; of a scenario that of its template.
        kind: of KINDS.
        distance: to the nearest, in units of r.
        feature: in which they differ most.
        scenario: number of the scenario, -1 of an encounter.
    """

    encounter: str
    kind: str
    distance: float
    feature: str
    scenario: int = -1


@dataclass(frozen=True)
class Population:
    """What recordings and the sets generated from them cover.

    Attributes:
        encounters: recorded, by kind.
        scenarios: generated from them, by kind.
        curve: coverage by number of templates, drawn of all kinds.
        by_kind: the same by kind, of templates that are all of that kind; without kinds that hold
            too few.
        unreached: encounters that no other recording's set reaches, the farthest first.
        farthest: scenarios that are farthest from all recorded encounters, at most ten.
        needed: recordings that would cover 0.9 by the curve's extrapolation, inf where it does not
            rise.
    """

    encounters: dict[str, int]
    scenarios: dict[str, int]
    curve: tuple[Point, ...]
    by_kind: dict[str, tuple[Point, ...]]
    unreached: tuple[Unreached, ...]
    farthest: tuple[Unreached, ...]
    needed: float

    @property
    def lead(self) -> str:
        """What was measured, in a sentence."""
        kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(self.encounters.items()))
        recorded, made = (sum(counts.values()) for counts in (self.encounters, self.scenarios))
        return f"{recorded} encounters whose vehicles share an area ({kinds}), {made} scenarios"

    def table(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """Return the columns and the rows of the curves as texts; in brackets the 5 and 95 % quantiles over draws."""
        columns = (
            "of",
            "templates",
            "coverage alone",
            "with generated",
            "precision",
            "of the recorded",
            "stand for",
        )
        rows = []
        for kind, curve in {"all kinds": self.curve, **self.by_kind}.items():
            for point in curve:
                shares = (point.alone, point.generated, point.precision, point.recorded)
                rows.append(
                    (kind, str(point.templates), *map(in_words, shares), _stands_for(point))
                )
        return columns, rows

    def remarks(self) -> list[str]:
        """Return what the curve says, in sentences."""
        needed = (
            f"{self.needed:.0f} recorded encounters"
            if math.isfinite(self.needed)
            else "more encounters than can be told"
        )
        lines = [f"coverage of {WANTED} takes {needed}, if the curve goes on as it does"]
        if self.unreached:
            worst = self.unreached[0]
            farthest = f"the farthest is {worst.encounter} ({worst.kind}): {worst.feature}"
            lines.append(f"{len(self.unreached)} encounters are never reached; {farthest}")
        return lines


def _stands_for(point: Point) -> str:
    """How many recordings, with the quantiles."""

    def words(multiplier: float) -> str:
        return (
            f"{multiplier * point.templates:.0f}"
            if math.isfinite(multiplier)
            else "more than there are"
        )

    return f"{words(point.multiplier.value)} [{words(point.multiplier.low)}, {words(point.multiplier.high)}]"


def in_words(share: Interval) -> str:
    """Return a share with its quantiles in brackets."""
    return f"{share.value:.2f} [{share.low:.2f}, {share.high:.2f}]"


def _over_draws(values: Iterable[float]) -> Interval:
    """The median of one value per draw, and the 5 and 95 % quantiles; NaN are draws of which nothing is told."""
    told = [value for value in values if math.isfinite(value)]
    low, middle, high = np.quantile(told, [0.05, 0.5, 0.95]).tolist() if told else [math.nan] * 3
    return Interval(middle, low, high)


def member_of(
    motion: Encounter | Scenario, recording: str, template: int, pair: Pair | None = None
) -> Member:
    """Return kind and features of a motion's pair, the one that has most to do with each other by default.

    That is, of the pairs that cross or merge the one with the least PET, and where there are none
    the followers nearest to each other. The kind is None where the pair, or every pair, shares no
    area.
    """
    whole = motion.resampled(PERIOD)
    figures = {own.pair: own for own in figures_of(motion) if pair in (None, own.pair)}
    met = conflicts_by_pair(find_conflicts(whole))
    conflicts: dict[Pair, Conflict] = {own: met[own] for own in met if own in figures}
    if not conflicts:
        return Member(None, np.zeros(len(FEATURES)), recording, template, pair)

    def closeness(own: Pair) -> tuple[bool, float]:
        conflict = conflicts[own]
        return conflict.following, figures[
            own
        ].gap if conflict.following else conflict.encroachment

    chosen = min(conflicts, key=closeness)
    conflict, most = conflicts[chosen], figures[chosen]
    first, second = conflict.first, conflict.second
    both = whole.present_slice(first, second)
    gap = _headway(whole, conflict) if conflict.following else conflict.encroachment
    common = [
        np.clip(gap, -LONGEST_S, LONGEST_S),
        min(conflict.arrival_gap, LONGEST_S),
        min(most.gap, FARTHEST_M),
        min(most.ttc, LONGEST_S),
        most.closing_speed,
        min(conflict.entry_second - both.start * whole.dt, 2.0 * LONGEST_S),
    ]
    entries = (conflict.entry_first, conflict.entry_second)
    each = [_driving(whole, n, entry) for n, entry in zip((first, second), entries, strict=True)]
    return Member(
        kind_of(whole, first, second),
        np.array([*common, *each[0], *each[1]]),
        recording,
        template,
        chosen,
    )


def generated_member(scenario: Scenario, template: Member, encounter: Encounter) -> Member:
    """The member that a scenario is, by the pair of its template, whose vehicles may stand in another order."""
    ids = [vehicle.id for vehicle in scenario.vehicles]
    a, b = sorted(ids.index(encounter.vehicles[n].id) for n in template.pair or (0, 1))
    return replace(
        member_of(scenario, template.recording, template.template, (a, b)), scenario=scenario.index
    )


def _headway(motion: Motion, conflict: Conflict) -> float:
    """The median time [s] that the follower needs for the gap to its leader, while it moves."""
    both = motion.present_slice(conflict.first, conflict.second)
    speed = motion.speed[conflict.second, both]
    moves = speed > STANDS_MPS
    gap = footprint_distance(motion, conflict.first, conflict.second)[both]
    return float(np.median(gap[moves] / speed[moves])) if moves.any() else LONGEST_S


def _driving(motion: Motion, n: int, entry: float) -> list[float]:
    """How one vehicle drives: EACH."""
    own = motion.present_slice(n)
    speed = motion.speed[n, own]
    at = int(np.clip(round(entry / motion.dt) - own.start, 0, len(speed) - 1))
    change = (speed[SECOND:] - speed[:-SECOND]) if len(speed) > SECOND else np.zeros(1)
    standing = float((speed < STANDS_MPS).sum() * motion.dt)
    return [
        speed[0],
        speed[: at + 1].min(),
        speed[at],
        max(-change.min(), 0.0),
        max(change.max(), 0.0),
        standing,
    ]


def population_of(
    results: Iterable[tuple[str, GenerationResult]],
    counts: Sequence[int] = (5, 10, 20),
    *,
    draws: int = 200,
    seed: int = 0,
) -> Population:
    """Measure what recordings and the sets generated from them cover.

    Args:
        results: the name of the recording and what was generated from one of its encounters.
        counts: templates to draw; those that the recordings do not hold are left out.
        draws: of templates, recording by recording in a random order.
        seed: of the draws.

    Raises:
        InputError: fewer than two recordings, or none whose vehicles share an area.
    """
    found = members_of(results)
    if found.recordings < 2:
        raise InputError(
            "encounters of at least two recordings are needed; give results of more logs"
        )
    drawn = [n for n in sorted(set(counts)) if n <= CHOSEN * len(found.recorded)]
    if not drawn:
        known, most = len(found.recorded), int(CHOSEN * len(found.recorded))
        raise InputError(
            f"{known} encounters share an area: at most {most} templates can be drawn; ask for fewer, or give more logs"
        )
    near, points = found.near, found.curve(drawn, draws=draws, seed=seed)
    counted, generated = (
        dict(Counter(member.kind_name for member in members))
        for members in (found.recorded, found.made)
    )
    by_kind: dict[str, tuple[Point, ...]] = {}
    for kind in KINDS:
        own = found.of_kind(kind)
        few = [n for n in drawn if n <= CHOSEN * len(own.recorded)]
        if few and own.recordings > 1:
            by_kind[kind] = own.curve(few, draws=draws, seed=seed)
    return Population(
        counted,
        generated,
        points,
        by_kind,
        tuple(near.unreached(found.names)),
        near.farthest(found),
        _needed(points),
    )


@dataclass(frozen=True, eq=False)
class Members:
    """Recorded encounters whose vehicles share an area, their names, and what is generated from them."""

    recorded: Sequence[Member]
    made: Sequence[Member]
    names: Sequence[str] = ()

    @cached_property
    def near(self) -> "_Near":
        """How near they are to each other."""
        return _Near.of(self.recorded, self.made)

    @property
    def recordings(self) -> int:
        """Number of recordings."""
        return len({member.recording for member in self.recorded})

    def name_of(self, member: Member) -> str:
        """Return the name of a member's template."""
        first = self.names[member.template]
        return Recombined(first, self.names[member.other]).name if member.other >= 0 else first

    def of_kind(self, kind: str) -> "Members":
        """Return the recorded of a kind, and what is generated from them, of whatever kind that is."""
        places = {
            n: k
            for k, n in enumerate(n for n, own in enumerate(self.recorded) if own.kind == kind)
        } | {-1: -1}

        def own(members: Sequence[Member]) -> list[Member]:
            return [
                replace(member, template=places[member.template], other=places[member.other])
                for member in members
                if member.template in places
            ]

        return Members(
            own(self.recorded),
            own(self.made),
            [self.names[n] for n in places if 0 <= n < len(self.names)],
        )

    def shares(
        self, count: int, *, draws: int = 200, seed: int = 0
    ) -> tuple[Interval, Interval, Interval, Interval]:
        """Return coverage alone and with what is generated, and precision of the generated and of the templates, as `Point` has.

        Arguments as of `population_of`.
        """
        near, rng = self.near, np.random.default_rng(seed)
        alone, generated, precision, recorded = zip(
            *(near.judged(near.chosen(rng, count)) for _ in range(draws)), strict=True
        )
        return (
            _over_draws(alone),
            _over_draws(generated),
            _over_draws(precision),
            _over_draws(recorded),
        )

    def curve(
        self, counts: Sequence[int], *, draws: int = 200, seed: int = 0
    ) -> tuple[Point, ...]:
        """Return what so many templates cover, and what they stand for; arguments as of `population_of`."""
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
            points.append(Point(n, *shares, Interval(*equal)))
        return tuple(points)


def members_of(results: Iterable[tuple[str, GenerationResult]]) -> Members:
    """Return the members of recordings and of the sets generated from them; arguments as of `population_of`.

    An encounter that is called as two others are together, "A + B", is recombined of these: it is
    no recorded one, and what is generated from it is of both. It is left out where one of these is
    not among the results.
    """
    recorded: list[Member] = []
    made: list[Member] = []
    names: list[str] = []
    recombined: list[tuple[Recombined, list[Member]]] = []
    for recording, result in results:
        own = member_of(result.encounter, recording, len(recorded))
        if own.kind is None:
            continue
        generated = [
            generated_member(join_ego(scenario), own, result.encounter) for scenario in result
        ]
        if isinstance(result.encounter.source, Recombined):
            recombined.append((result.encounter.source, generated))
        else:
            recorded.append(own)
            names.append(result.encounter.name)
            made += generated
    for source, generated in recombined:
        if {source.first, source.second} <= set(names):
            first = recorded[names.index(source.first)]
            second = names.index(source.second)
            made += [
                replace(member, recording=first.recording, template=first.template, other=second)
                for member in generated
            ]
    return Members(recorded, made, names)


def _needed(points: Sequence[Point]) -> float:
    """Templates at which what is not covered, as a power of their number, falls to 0.1; inf where that is too far to be told."""
    missed = np.array([1.0 - point.generated.value for point in points])
    if len(points) < 2 or missed.min() <= 0.0:
        return math.inf
    slope, level = np.polyfit(np.log([point.templates for point in points]), np.log(missed), 1)
    needed = (math.log(1.0 - WANTED) - level) / slope if slope < 0.0 else math.inf
    return (
        math.ceil(math.exp(needed))
        if needed < math.log(FARTHEST_TOLD * points[-1].templates)
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
        apart: (R + M, R) distances to recorded members in units of r, inf between kinds.
    """

    members: Sequence[Member]
    recording: Ints
    template: Ints
    scaled: Floats
    apart: Floats

    @classmethod
    def of(cls, recorded: Sequence[Member], made: Sequence[Member]) -> "_Near":
        """Scale features by kind, and measure all distances."""
        every = [*recorded, *made]
        recording = np.unique([member.recording for member in recorded], return_inverse=True)[1]
        kinds = np.array(
            [-1 if member.kind is None else KINDS.index(member.kind) for member in every]
        )
        scaled = np.array([member.features for member in every])
        apart = np.full((len(every), len(recorded)), math.inf)
        for kind in np.unique(kinds[: len(recorded)]):
            rows, columns = (
                np.flatnonzero(kinds == kind),
                np.flatnonzero(kinds[: len(recorded)] == kind),
            )
            spread = scaled[columns].std(axis=0)
            scaled[rows] /= np.maximum(spread, max(SMALLEST_SHARE * float(spread.max()), 1e-9))
            between = distance.cdist(scaled[rows], scaled[columns]) / math.sqrt(scaled.shape[1])
            others = np.where(
                recording[columns, None] == recording[columns], math.inf, between[: len(columns)]
            )
            nearest = others.min(axis=1)
            known = nearest[np.isfinite(nearest)]
            if len(known):
                apart[np.ix_(rows, columns)] = between / max(float(np.median(known)), SMALLEST_R)
        template = [
            (member.template, member.template if member.other < 0 else member.other)
            for member in made
        ]
        return cls(
            recorded, recording, np.array(template, dtype=np.int64).reshape(-1, 2), scaled, apart
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
        """Return coverage by templates alone, with what is generated, and precision of generated and of templates."""
        unseen = self._unseen(chosen)
        if not unseen.any():
            return (math.nan,) * 4
        members = len(self.recording) + np.flatnonzero(np.isin(self.template, chosen).all(axis=1))
        own = self.recording[self.template[members - len(self.recording)]]
        return (
            self._covered(chosen, unseen),
            self._covered(np.concatenate([chosen, members]), unseen),
            self._precision(members, own),
            self._precision(chosen, self.recording[chosen, None]),
        )

    def _unseen(self, chosen: Ints) -> Bools:
        """(R,) which encounters are of other recordings than those of some templates."""
        return ~np.isin(self.recording, self.recording[chosen])

    def _covered(self, members: Ints, unseen: Bools) -> float:
        """The share of unseen encounters within r of a member."""
        return (
            float((self.apart[members][:, unseen].min(axis=0) <= 1.0).mean())
            if unseen.any()
            else math.nan
        )

    def _precision(self, members: Ints, own: Ints) -> float:
        """The share of members within r of an encounter of another recording than their own (K, 1 or 2)."""
        there = np.where(
            (own[..., None] == self.recording).any(axis=1), math.inf, self.apart[members]
        )
        return float((there.min(axis=1) <= 1.0).mean()) if len(members) else math.nan

    def unreached(self, names: Sequence[str]) -> list[Unreached]:
        """Return the recorded encounters that nothing from other recordings is near, the farthest first."""
        source = np.concatenate(
            [np.repeat(self.recording[:, None], 2, axis=1), self.recording[self.template]]
        )
        found = []
        for n, member in enumerate(self.members):
            far = np.where((source == self.recording[n]).any(axis=1), math.inf, self.apart[:, n])
            nearest = int(far.argmin())
            if far[nearest] > 1.0:
                found.append(
                    Unreached(
                        names[n],
                        member.kind_name,
                        float(far[nearest]),
                        self._differ(nearest, n, far[nearest]),
                    )
                )
        return sorted(found, key=lambda one: -one.distance)

    def farthest(self, found: Members) -> tuple[Unreached, ...]:
        """Return the generated members that are farthest from all recorded ones."""
        away = self.apart[len(self.members) :]
        nearest = away.min(axis=1, initial=math.inf)
        return tuple(
            Unreached(
                found.name_of(own := found.made[n]), own.kind_name, float(nearest[n]),
                self._differ(len(self.members) + n, int(away[n].argmin()), nearest[n]), own.scenario,
            )
            for n in np.argsort(-nearest, kind="stable")[:SHOWN].tolist()
        )  # fmt: skip

    def _differ(self, n: int, recorded: int, apart: float) -> str:
        """In which feature a member differs most from a recorded one, which is so far apart."""
        if not math.isfinite(apart):
            return "no other of its kind"
        return FEATURES[int(np.abs(self.scaled[n] - self.scaled[recorded]).argmax())]

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Features of encounters that do not depend on the place, and the law of recorded ones.

The features (`FEATURES`, `JOINT_FEATURES`) describe the most critical pair of vehicles: speeds,
braking and standstills of both, the approach, the gaps at the conflict, and how the second vehicle
answers the first one. The law is a Gaussian of them. It is learned from the template and the other
recorded encounters of its kind, and shrunk towards a shipped law. With n encounters of features
x_i,

    μ = (a μ₀ + Σ x_i) / (a + n),   S = (b S₀ + Σ (x_i − μ)(x_i − μ)ᵀ) / (b + n),

the conjugate estimates of mean and covariance with a prior that counts as a and b encounters. The
correlations of S are shrunk by a share c. The distance of features x from the mean is
d(x) = sqrt((x − μ)ᵀ S⁻¹ (x − μ) / F); a scenario with d ≤ 0.6 is usual.
`resources/population.json` contains μ₀ and S₀ of each kind, and their source.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
import json
import math
from pathlib import Path
from weakref import WeakKeyDictionary

import numpy as np

import scenario_gen
from scenario_gen.method.evaluation.measures import (
    FIGURE_PERIOD_S,
    figures_of,
    footprint_distance,
    MEASURES,
)
from scenario_gen.method.evaluation.time_shift import STANDSTILL_MPS
from scenario_gen.numerics import Floats
from scenario_gen.situation import (
    Conflict,
    conflicts_by_pair,
    EncounterKind,
    find_conflicts,
    kind_of,
)
from scenario_gen.types import Encounter, Measures, Motion, Pair, Scenario

VEHICLE_FEATURES = (
    "first speed",
    "least speed before",
    "speed at conflict",
    "braking",
    "acceleration",
    "standing time",
)
PAIR_FEATURES = (
    "gap",
    "arrival gap",
    "distance",
    "time to collision",
    "closing speed",
    "approach",
)
FEATURES = (
    *PAIR_FEATURES,
    *(f"{name} of the first" for name in VEHICLE_FEATURES),
    *(f"{name} of the second" for name in VEHICLE_FEATURES),
)
JOINT_FEATURES = (
    "answer of the second",
    "speed of the second at the clearing",
    "way of the second at the clearing",
    "correlation of speeds",
)
"""How the second vehicle answers the first one; only the law of a population holds them."""
DISTANCE = FEATURES.index("distance")
MAX_GAP_S = 10.0  # larger time gaps are alike
MAX_DISTANCE_M = 30.0  # larger distances are alike
_BRAKING_MPS2 = 0.4  # from which a first vehicle brakes
_ENTRY_S = 1.0  # before and after its entry, in which it is answered, too
_END_S = 5.0  # in which speeds are compared
_STILL_MPS = 0.2  # of a speed whose variation is noise


@dataclass(frozen=True, eq=False)
class EncounterFeatures:
    """The features of an encounter, recorded or generated.

    Attributes:
        kind: what the pair does; None if it shares no area.
        features: (F,).
        joint: (J,) JOINT_FEATURES.
        recording: name of the recording; of a generated encounter that of its template.
        template: index of the template among the recorded encounters.
        pair: the vehicles that are described; None if no two share an area.
    """

    kind: EncounterKind | None
    features: Floats
    recording: str
    template: int
    pair: Pair | None
    joint: Floats = field(default_factory=lambda: np.zeros(len(JOINT_FEATURES)))

    @property
    def every(self) -> Floats:
        """(F + J,) the features and the joint ones."""
        return np.concatenate([self.features, self.joint])


def features_of(
    motion: Motion,
    recording: str,
    template: int,
    pair: Pair | None = None,
    kind: EncounterKind | None = None,
) -> EncounterFeatures:
    """Return the features of a pair of vehicles, by default of the most critical pair.

    That is the crossing or merging pair with the least PET or, without one, the following pair
    with the least gap. The kind is None if the pair, or every pair, shares no area; a given kind
    is not computed again unless one of them follows the other.
    """
    motion = motion.resampled(FIGURE_PERIOD_S)
    figures = {figure.pair: figure for figure in figures_of(motion, pair)}
    conflicts: dict[Pair, Conflict] = {
        known: conflict
        for known, conflict in conflicts_by_pair(find_conflicts(motion)).items()
        if known in figures
    }
    if not conflicts:
        return EncounterFeatures(None, np.zeros(len(FEATURES)), recording, template, pair)

    def closeness(known: Pair) -> tuple[bool, float]:
        conflict = conflicts[known]
        if conflict.following:
            return True, figures[known].gap
        return False, conflict.encroachment

    chosen = min(conflicts, key=closeness)
    conflict, figure = conflicts[chosen], figures[chosen]
    start = motion.present_slice(conflict.first, conflict.second).start
    gap = _headway(motion, conflict) if conflict.following else conflict.encroachment
    values = [
        np.clip(gap, -MAX_GAP_S, MAX_GAP_S),
        min(conflict.arrival_gap, MAX_GAP_S),
        min(figure.gap, MAX_DISTANCE_M),
        min(figure.ttc, MAX_GAP_S),
        figure.closing_speed,
        min(conflict.entry_second - start * motion.dt, 2.0 * MAX_GAP_S),
        *_vehicle_features(motion, conflict.first, conflict.entry_first),
        *_vehicle_features(motion, conflict.second, conflict.entry_second),
    ]
    if kind is None or conflict.following != (kind == EncounterKind.FOLLOWING):
        kind = kind_of(motion, conflict.first, conflict.second)
    joint = _joint_features(motion, conflict)
    return EncounterFeatures(
        kind, np.array(values), recording, template, chosen, joint=np.array(joint)
    )


def scenario_features(
    scenario: Scenario,
    template: EncounterFeatures,
    encounter: Encounter,
    kind: EncounterKind | None = None,
) -> EncounterFeatures:
    """Return the features of the template's pair in a scenario; vehicles may be reordered."""
    ids = scenario.ids
    a, b = sorted(ids.index(encounter.vehicles[n].id) for n in template.pair or (0, 1))
    return features_of(scenario, template.recording, template.template, (a, b), kind)


def _headway(motion: Motion, conflict: Conflict) -> float:
    """Return the median time [s] that the moving follower needs for its gap."""
    both = motion.present_slice(conflict.first, conflict.second)
    speed = motion.speed[conflict.second, both]
    moves = speed > STANDSTILL_MPS
    if not moves.any():
        return MAX_GAP_S
    gap = footprint_distance(motion, conflict.first, conflict.second)[both]
    return float(np.median(gap[moves] / speed[moves]))


def _joint_features(motion: Motion, conflict: Conflict) -> list[float]:
    """Return the JOINT_FEATURES of the two vehicles of a conflict."""
    both = motion.present_slice(conflict.first, conflict.second)
    speed = motion.speed[:, both]
    first, second = speed[conflict.first], speed[conflict.second]
    time = motion.time[both]
    acceleration = np.gradient(speed, motion.dt, axis=1) if len(time) > 1 else 0.0 * speed
    is_answered = acceleration[conflict.first] < -_BRAKING_MPS2
    is_answered |= np.abs(time - conflict.entry_first) <= _ENTRY_S
    answer = acceleration[conflict.second][is_answered]
    clears = conflict.exit_first if np.isfinite(conflict.exit_first) else conflict.entry_first
    at, enters = np.searchsorted(time, [clears, conflict.entry_second]).tolist()
    way = np.sign(enters - at) * second[min(at, enters) : max(at, enters)].sum() * motion.dt
    ending = slice(-round(_END_S / motion.dt), None)
    deviation = np.stack(
        [first[ending] - first[ending].mean(), second[ending] - second[ending].mean()]
    )
    scale = np.square(deviation).mean(axis=1) + _STILL_MPS * _STILL_MPS
    return [
        float(answer.mean()) if len(answer) else 0.0,
        float(second[min(at, len(second) - 1)]),
        float(np.clip(way, -MAX_DISTANCE_M, MAX_DISTANCE_M)),
        float(deviation.prod(axis=0).mean() / np.sqrt(scale.prod())),
    ]


def _vehicle_features(motion: Motion, n: int, entry: float) -> list[float]:
    """Return the VEHICLE_FEATURES of a vehicle that enters the conflict area at `entry` [s]."""
    present = motion.present_slice(n)
    speed = motion.speed[n, present]
    at = int(np.clip(round(entry / motion.dt) - present.start, 0, len(speed) - 1))
    second = round(1.0 / FIGURE_PERIOD_S)
    change = speed[second:] - speed[:-second] if len(speed) > second else np.zeros(1)
    return [
        speed[0],
        speed[: at + 1].min(),
        speed[at],
        max(-change.min(), 0.0),
        max(change.max(), 0.0),
        float((speed < STANDSTILL_MPS).sum() * motion.dt),
    ]


SHIPPED = Path(scenario_gen.__file__).parent / "resources" / "population.json"
MEAN_PRIOR_WEIGHT = 2.0  # a: encounters that the shipped mean counts as
COVARIANCE_PRIOR_WEIGHT = 10.0  # b: encounters that the shipped covariance counts as
SHRINKAGE_SHARE = 0.3  # c: reduction of the observed correlations
USUAL_SIGMAS = 0.6  # d of usual encounters, RMS over features


@dataclass(frozen=True, eq=False)
class Law:
    """How encounters of a kind differ.

    Attributes:
        mean: (F,) mean features.
        precision: (F, F) inverse of their covariance.
    """

    mean: Floats
    precision: Floats

    @classmethod
    def of(cls, kind: EncounterKind, seen: Sequence[Floats]) -> "Law":
        """Learn the law of a kind from features (F,) of encounters and the shipped law."""
        laws = _shipped()
        mean, covariance = laws.get(kind) or laws[EncounterKind.CROSSING]
        n = len(seen)
        rows = np.array(seen).reshape(n, len(mean))
        mean = (MEAN_PRIOR_WEIGHT * mean + rows.sum(axis=0)) / (MEAN_PRIOR_WEIGHT + n)
        off = rows - mean
        covariance = (COVARIANCE_PRIOR_WEIGHT * covariance + off.T @ off) / (
            COVARIANCE_PRIOR_WEIGHT + n
        )
        return cls(mean, np.asarray(np.linalg.inv(shrunk(covariance)), dtype=np.float64))

    def distance(self, features: Floats) -> float:
        """Return the RMS distance of features (F,) from the mean, in standard deviations."""
        off = features - self.mean
        return math.sqrt(float(off @ self.precision @ off) / len(off))


def shrunk(covariance: Floats) -> Floats:
    """Return a covariance (F, F) with smaller correlations."""
    diagonal = np.diag(np.diag(covariance))
    return np.asarray((1.0 - SHRINKAGE_SHARE) * covariance + SHRINKAGE_SHARE * diagonal)


def rarity_in(
    encounter: Encounter, population: Sequence[Encounter] = ()
) -> Callable[[Scenario], float]:
    """Return the rarity of a template's scenarios: their distance from the mean over USUAL_SIGMAS.

    The law is that of the template's kind, unless one vehicle follows the other only in one of
    them.
    The rarity is infinite if the vehicles share no area.

    Args:
        encounter: the template; it counts once, even if the population contains it.
        population: recorded encounters; several with the same features count once.
    """
    template = features_of(encounter, encounter.name, 0)
    members = [template]
    for recorded in population:
        member = features_of(recorded, recorded.name, 0)
        if not any(_is_same(member, other) for other in members):
            members.append(member)
    laws = {
        kind: Law.of(kind, [member.every for member in members if member.kind == kind])
        for kind in EncounterKind
    }

    # A pilot's scenario is measured for the bound, as a candidate, and for its facts.
    known: WeakKeyDictionary[Scenario, float] = WeakKeyDictionary()

    def rarity(scenario: Scenario) -> float:
        if scenario not in known:
            member = scenario_features(scenario, template, encounter, template.kind)
            known[scenario] = (
                math.inf
                if member.kind is None
                else laws[member.kind].distance(member.every) / USUAL_SIGMAS
            )
        return known[scenario]

    return rarity


def measures_in(
    drivers: float, encounter: Encounter, population: Sequence[Encounter] = ()
) -> Measures:
    """Return the measures of a template's scenarios, with rarity if drivers differ."""
    if drivers == 0.0:
        return MEASURES
    return replace(MEASURES, rarity=rarity_in(encounter, population))


def _is_same(member: EncounterFeatures, other: EncounterFeatures) -> bool:
    return member.kind == other.kind and np.allclose(member.features, other.features)


@cache
def _shipped() -> dict[str, tuple[Floats, Floats]]:
    """Return mean (F,) and covariance (F, F) by kind."""
    document = json.loads(SHIPPED.read_text())
    assert tuple(document["features"]) == FEATURES + JOINT_FEATURES
    return {
        kind: (np.array(law["mean"]), np.array(law["covariance"]))
        for kind, law in document["kinds"].items()
    }

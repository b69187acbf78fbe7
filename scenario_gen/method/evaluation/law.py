# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The distribution of recorded encounters of one kind, by which scenarios are filtered.

The law is a Gaussian of an encounter's features (FEATURES and JOINT_FEATURES of
`scenario_gen.method.evaluation.encounter_features`): speeds, braking and standstills of both
vehicles, the approach, the gaps at the conflict, and how the second vehicle answers the first one.
It is learned from the template and the other recorded encounters of its kind, and shrunk towards a
shipped law. With n encounters of features x_i,

    μ = (a μ₀ + Σ x_i) / (a + n),   S = (b S₀ + Σ (x_i − μ)(x_i − μ)ᵀ) / (b + n),

the conjugate estimates of mean and covariance with a prior that counts as a and b encounters. The
correlations of S are shrunk by a share c. The distance of features x from the mean is
d(x) = sqrt((x − μ)ᵀ S⁻¹ (x − μ) / F); a scenario with d ≤ 0.6 is usual.
`resources/population.json` contains μ₀ and S₀ of each kind, and their source.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
import json
import math
from pathlib import Path

import numpy as np

import scenario_gen
from scenario_gen.method.evaluation.encounter_features import (
    EncounterFeatures,
    FEATURES,
    features_of,
    JOINT_FEATURES,
    scenario_features,
)
from scenario_gen.method.evaluation.measures import MEASURES
from scenario_gen.numerics import Floats
from scenario_gen.situation import EncounterKind
from scenario_gen.types import Encounter, Measures, Scenario

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
        mean, covariance = _shipped_law(kind)
        n = len(seen)
        rows = np.array(seen).reshape(n, len(mean))
        mean = (MEAN_PRIOR_WEIGHT * mean + rows.sum(axis=0)) / (MEAN_PRIOR_WEIGHT + n)
        off = rows - mean
        covariance = (COVARIANCE_PRIOR_WEIGHT * covariance + off.T @ off) / (
            COVARIANCE_PRIOR_WEIGHT + n
        )
        return cls(mean, np.asarray(np.linalg.inv(shrunk(covariance)), dtype=np.float64))

    @classmethod
    def mixed(cls, kinds: Sequence[EncounterKind]) -> "Law":
        """Return the law of encounters of several kinds, each equally likely.

        It has the mean and the covariance of the mixture of the shipped laws.
        """
        means, covariances = map(np.stack, zip(*map(_shipped_law, kinds), strict=True))
        covariance = covariances.mean(axis=0) + np.cov(means.T, bias=True)
        return cls(means.mean(axis=0), np.asarray(np.linalg.inv(shrunk(covariance))))

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

    def rarity(scenario: Scenario) -> float:
        member = scenario_features(scenario, template, encounter, template.kind)
        if member.kind is None:
            return math.inf
        return laws[member.kind].distance(member.every) / USUAL_SIGMAS

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


def _shipped_law(kind: EncounterKind) -> tuple[Floats, Floats]:
    """Return mean (F,) and covariance (F, F) of a kind; by default those of crossings."""
    laws = _shipped()
    return laws[kind if kind in laws else EncounterKind.CROSSING]


@cache
def _shipped() -> dict[str, tuple[Floats, Floats]]:
    """Return mean (F,) and covariance (F, F) by kind."""
    document = json.loads(SHIPPED.read_text())
    assert tuple(document["features"]) == FEATURES + JOINT_FEATURES
    return {
        kind: (np.array(law["mean"]), np.array(law["covariance"]))
        for kind, law in document["kinds"].items()
    }

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The distribution of recorded encounters of one kind, for `sampling.variety=population`.

The law is a Gaussian of an encounter's features (FEATURES of
`scenario_gen.method.evaluation.population`): speeds, braking and stands of both vehicles, the
approach, their gaps at the conflict. It is learned from the template and the other recorded
encounters of its kind, and shrunk towards a shipped one: with n of them of features x_i, sum over
them Σ,

    μ = (a μ₀ + Σ x_i) / (a + n),   S = (b S₀ + Σ (x_i − μ)(x_i − μ)ᵀ) / (b + n),

the conjugate estimates of mean and covariance with a prior that counts as a and b encounters; the
correlations of S are shrunk by a share c. A scenario of features x is at a distance d(x) = sqrt((x
− μ)ᵀ S⁻¹ (x − μ) / F) from the middle, and up to 0.6 it is usual. `resources/population.json`
holds μ₀ and S₀ of each kind; its source stands there.
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
    scenario_features,
)
from scenario_gen.method.evaluation.measures import MEASURES
from scenario_gen.numerics import Floats
from scenario_gen.situation import EncounterKind
from scenario_gen.types import Encounter, Measures, Scenario

SHIPPED = Path(scenario_gen.__file__).parent / "resources" / "population.json"
MEAN_ENCOUNTERS, SPREAD_ENCOUNTERS = (
    2.0,
    10.0,
)  # a and b: that the shipped mean and covariance count as
UNCORRELATED = 0.3  # c: share by which correlations are smaller than seen
USUAL = 0.6  # d of usual encounters, RMS over features, in standard deviations


@dataclass(frozen=True, eq=False)
class Law:
    """How encounters of a kind differ.

    Attributes:
        mean: (F,) features of the middle.
        precision: (F, F) inverse of their covariance.
    """

    mean: Floats
    precision: Floats

    @classmethod
    def of(cls, kind: EncounterKind, seen: Sequence[Floats]) -> "Law":
        """Learn the law of a kind from features (F,) of encounters and the shipped law."""
        (mean, covariance), n = _shipped_law(kind), len(seen)
        rows = np.array(seen).reshape(n, len(mean))
        mean = (MEAN_ENCOUNTERS * mean + rows.sum(axis=0)) / (MEAN_ENCOUNTERS + n)
        off = rows - mean
        covariance = (SPREAD_ENCOUNTERS * covariance + off.T @ off) / (SPREAD_ENCOUNTERS + n)
        return cls(mean, np.asarray(np.linalg.inv(shrunk(covariance)), dtype=np.float64))

    def distance(self, features: Floats) -> float:
        """Return the RMS distance of features (F,) from the mean, in standard deviations."""
        off = features - self.mean
        return math.sqrt(float(off @ self.precision @ off) / len(off))


def shrunk(covariance: Floats) -> Floats:
    """Return a covariance (F, F) with smaller correlations."""
    return np.asarray(
        (1.0 - UNCORRELATED) * covariance + UNCORRELATED * np.diag(np.diag(covariance))
    )


def rarity_in(
    encounter: Encounter, population: Sequence[Encounter] = ()
) -> Callable[[Scenario], float]:
    """Return the rarity of a template's scenarios: their distance from the mean over USUAL.

    The law is that of the scenario's own kind, which on another road may be another one than the
    template's. Of those whose vehicles share no area nothing is known: their rarity is infinite.

    Args:
        encounter: the template; it counts once, whether it is in the population or not.
        population: recorded encounters; those of the same features are one, whatever they are
            called.
    """
    template = features_of(encounter, encounter.name, 0)
    members = [template]
    for recorded in population:
        member = features_of(recorded, recorded.name, 0)
        if not any(_is_same(member, other) for other in members):
            members.append(member)
    laws = {
        kind: Law.of(kind, [member.features for member in members if member.kind == kind])
        for kind in EncounterKind
    }

    def rarity(scenario: Scenario) -> float:
        member = scenario_features(scenario, template, encounter)
        if member.kind is None:
            return math.inf
        return laws[member.kind].distance(member.features) / USUAL

    return rarity


def measures_in(
    variety: str, encounter: Encounter, population: Sequence[Encounter] = ()
) -> Measures:
    """Return the measures of a template's scenarios, with rarity for variety `population`."""
    return (
        replace(MEASURES, rarity=rarity_in(encounter, population))
        if variety == "population"
        else MEASURES
    )


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
    assert tuple(document["features"]) == FEATURES
    return {
        kind: (np.array(law["mean"]), np.array(law["covariance"]))
        for kind, law in document["kinds"].items()
    }

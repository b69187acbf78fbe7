# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What coverage is compared with: members that no generator made, at the precision of the generated ones.

Of every null the deviations of its members from their template, in features, are multiplied by one number such that it is as
precise as what is generated from MIDDLE templates.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from scenario_gen.method.evaluation.encounter_features import EncounterFeatures, FEATURES
from scenario_gen.method.evaluation.population import KINDS, Members
from scenario_gen.numerics import Bools, Floats
from scenario_gen.situation import EncounterKind
from scenario_gen.types import Interval

JOINT = (
    "gap",
    "arrival gap",
    "distance",
    "time to collision",
    "closing speed",
)  # how one answers the other
MOST_TIMES, STEPS = 4.0, 9  # the largest such number, and halvings by which it is found
DRAWS = 60  # of templates, while it is looked for


def at_precision(null: Members, precision: float, count: int) -> tuple[Interval, Interval]:
    """Return coverage and precision of a null whose deviations are as large as gives this precision with `count` templates."""
    low, high = 0.0, MOST_TIMES
    for _ in range(STEPS):
        times = 0.5 * (low + high)
        precise = scaled(null, times).shares(count, draws=DRAWS)[2].value >= precision
        low, high = (times, high) if precise else (low, times)
    _, coverage, reached, _ = scaled(null, low).shares(count)
    return coverage, reached


def scaled(null: Members, times: float) -> Members:
    """Return members whose deviations from their templates are `times` as large; those of another kind stay."""

    def moved(member: EncounterFeatures) -> EncounterFeatures:
        own = null.recorded[member.template]
        if member.kind != own.kind:
            return member
        return replace(member, features=own.features + times * (member.features - own.features))

    return replace(null, made=[moved(member) for member in null.made])


def jitters(found: Members, rng: np.random.Generator) -> Iterator[tuple[str, Members]]:
    """Yield nulls that add noise to the templates: of the spread of each feature, of one spread for all, of all correlations."""
    noise: dict[str, dict[EncounterKind | None, Floats]] = {
        "per feature": {},
        "isotropic": {},
        "covariance": {},
    }
    for kind in {own.kind for own in found.recorded}:
        own = np.array([member.features for member in found.recorded if member.kind == kind])
        off = deviations(found, kind)
        spread = np.maximum(own.std(axis=0), 1e-9)
        noise["per feature"][kind] = np.diag(np.sqrt(np.square(off).mean(axis=0)))
        noise["isotropic"][kind] = np.diag(spread * np.sqrt(np.square(off / spread).mean()))
        values, vectors = np.linalg.eigh(off.T @ off / len(off))
        noise["covariance"][kind] = vectors * np.sqrt(np.maximum(values, 0.0))
    for name, roots in noise.items():
        made = []
        for member in found.made:
            own_member = found.recorded[member.template]
            moved = own_member.features + roots[own_member.kind] @ rng.standard_normal(
                len(FEATURES)
            )
            made.append(replace(member, kind=own_member.kind, features=moved))
        yield name, replace(found, made=made)


def deviations(found: Members, kind: EncounterKind | None) -> Floats:
    """Return by how much members of a kind differ from their templates (S, F); a row of zeros where there are none."""
    pairs = [(member, found.recorded[member.template]) for member in found.made]
    off = [
        member.features - own.features for member, own in pairs if member.kind == own.kind == kind
    ]
    return np.array(off).reshape(-1, len(FEATURES)) if off else np.zeros((1, len(FEATURES)))


def joint_gain(found: Members, mixed: Members, count: int) -> dict[EncounterKind, float]:
    """Return by kind: precision in JOINT, over that of mixed pairs."""
    gains = {}
    for kind in KINDS:
        of_kind = [sets.of_kind(kind) for sets in (found, mixed)]
        if of_kind[0].recordings < 2:
            continue
        most = max(min(count, len(of_kind[0].recorded) // 2), 1)
        precision = [
            Members(_joint(sets.recorded), _joint(sets.made)).shares(most)[2].value
            for sets in of_kind
        ]
        gains[kind] = precision[0] - precision[1]
    return gains


def _joint(members: Sequence[EncounterFeatures]) -> list[EncounterFeatures]:
    """Return members with JOINT features alone."""
    columns = [FEATURES.index(name) for name in JOINT]
    return [replace(member, features=member.features[columns]) for member in members]


def speed_spread(found: Members) -> float:
    """Return the median over kinds and speeds: standard deviation within a set, of that of the recorded."""
    speeds: Bools = np.array(["speed" in name and "closing" not in name for name in FEATURES])
    shares: list[float] = []
    for kind in {own.kind for own in found.recorded}:
        recorded = np.array([own.features for own in found.recorded if own.kind == kind])[
            :, speeds
        ].std(axis=0)
        sets = [
            np.array(rows)[:, speeds].std(axis=0)
            for n, own in enumerate(found.recorded)
            if own.kind == kind
            and len(
                rows := [
                    member.features
                    for member in found.made
                    if member.template == n and member.kind == kind
                ]
            )
            > 1
        ]
        if sets and recorded.min() > 0.0:
            shares += (np.mean(sets, axis=0) / recorded).tolist()
    return float(np.median(shares)) if shares else 0.0

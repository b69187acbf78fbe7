# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What coverage is compared with, and at which precision.

Sets of a kind are compared at one precision, that of the more precise one: of the other those
members are kept that are nearest to their template, as many as give this precision. The nulls have
no generator: records shifted in time and paced that the checker accepts, and pairs mixed from
different members of a set.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np

from benchmarks._coverage_members import KINDS, Members
from scenario_gen.method.evaluation.law import (
    EncounterFeatures,
    FEATURES,
    JOINT_FEATURES,
)
from scenario_gen.method.sampling.filters import CheckScenarios
from scenario_gen.numerics import Bools, Floats
from scenario_gen.situation import EncounterKind
from scenario_gen.types import Encounter, Interval, Scenario, Verdict

RADIUS_SHARES = (0.8, 0.5)  # of the recorded encounters have another session's one in the radius
JOINT = (
    "gap",
    "arrival gap",
    "distance",
    "time to collision",
    "closing speed",
    *JOINT_FEATURES,
)  # how one answers the other
SHIFT_S, PACE_RATIO = 1.0, 0.06
MIN_SHIFTED_S = 4.0
MAX_DRAWS_RATIO = 10  # of shifted records over those that are kept
HALVINGS = 6  # by which the kept share is found
DRAWS = 60  # of templates, by which a kind is chosen


@dataclass(frozen=True)
class Shares:
    """Coverage and precision with templates of one kind each, weighted means over kinds.

    Attributes:
        alone: coverage by the templates.
        coverage: coverage by templates and members.
        precision: of the members.
        kept: share of the members that were kept.
    """

    alone: Interval
    coverage: Interval
    precision: Interval
    kept: float = 1.0


def kinds_with(found: Members, count: int) -> list[Members]:
    """Return members by kind, of kinds in which a draw of templates leaves enough unseen ones."""
    kinds = [found.of_kind(kind) for kind in KINDS]
    return [
        one
        for one in kinds
        if len(one.recorded) >= 2 * count and np.isfinite(one.shares(count, draws=DRAWS)[0].value)
    ]


def shares_by_kind(kinds: Sequence[Members], count: int, draws: int = 200) -> Shares:
    """Return the shares with `count` templates of each kind."""
    weights = [len(one.recorded) for one in kinds]
    values = [
        [(share.value, share.low, share.high) for share in one.shares(count, draws=draws)[:3]]
        for one in kinds
    ]
    means = np.average(values, axis=0, weights=weights)
    alone, coverage, precision = (Interval(*row.tolist()) for row in means)
    return Shares(alone, coverage, precision)


def at_precision(kinds: Sequence[Members], count: int, precision: float) -> Shares:
    """Return the shares of the members that are nearest to their templates, at a precision."""
    low, high = 0.0, 1.0
    if shares_by_kind(kinds, count).precision.value < precision:
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            kept = [nearest(one, middle) for one in kinds]
            precise = shares_by_kind(kept, count).precision.value >= precision
            low, high = (middle, high) if precise else (low, middle)
    else:
        low = 1.0
    shares = shares_by_kind([nearest(one, low) for one in kinds], count)
    return replace(shares, kept=low)


def nearest(found: Members, share: float) -> Members:
    """Return members without those farthest from their template; a share of each set is kept."""
    near = found.near
    size = len(found.recorded)
    off = near.scaled[size:] - near.scaled[[one.template for one in found.made]]
    distance = np.sqrt(np.square(off).mean(axis=1))
    distance[[one.kind != found.recorded[one.template].kind for one in found.made]] = np.inf
    kept: list[int] = []
    templates = np.array([one.template for one in found.made], dtype=np.int64)
    for template in np.unique(templates):
        rows = np.flatnonzero(templates == template)
        kept += rows[np.argsort(distance[rows], kind="stable")][
            : round(share * len(rows))
        ].tolist()
    return replace(found, made=[found.made[k] for k in sorted(kept)])


def joint_gain(found: Members, mixed: Members, count: int) -> dict[EncounterKind, float]:
    """Return by kind: precision in JOINT, over that of mixed pairs."""
    gains = {}
    for kind in KINDS:
        of_kind = [sets.of_kind(kind) for sets in (found, mixed)]
        if of_kind[0].recordings < 2:
            continue
        most = max(min(count, len(of_kind[0].recorded) // 2), 1)
        precision = [
            replace(sets, recorded=_joint(sets.recorded), made=_joint(sets.made))
            .shares(most)[2]
            .value
            for sets in of_kind
        ]
        if np.isfinite(precision).all():
            gains[kind] = precision[0] - precision[1]
    return gains


def _joint(members: Sequence[EncounterFeatures]) -> list[EncounterFeatures]:
    """Return members with JOINT features alone."""
    names = FEATURES + JOINT_FEATURES
    columns = [names.index(name) for name in JOINT]
    return [replace(member, features=member.every[columns]) for member in members]


def speed_spread(found: Members) -> float:
    """Return the median over kinds and speeds: standard deviation within a set, of that of the recorded."""
    speeds: Bools = np.array(["speed" in name and "closing" not in name for name in FEATURES])
    shares: list[float] = []
    for kind in {one.kind for one in found.recorded}:
        recorded = _speeds(found.recorded, kind, speeds).std(axis=0)
        sets = []
        for n, one in enumerate(found.recorded):
            members = [member for member in found.made if member.template == n]
            rows = _speeds(members, kind, speeds)
            if one.kind == kind and len(rows) > 1:
                sets.append(rows.std(axis=0))
        if sets and recorded.min() > 0.0:
            shares += (np.mean(sets, axis=0) / recorded).tolist()
    return float(np.median(shares)) if shares else 0.0


def _speeds(
    members: Sequence[EncounterFeatures], kind: EncounterKind | None, columns: Bools
) -> Floats:
    """(M, C) some features of the members of a kind."""
    rows = [member.features[columns] for member in members if member.kind == kind]
    return np.array(rows).reshape(len(rows), int(columns.sum()))


def shifted(
    encounter: Encounter, check: CheckScenarios, rng: np.random.Generator, count: int
) -> list[Scenario]:
    """Return up to `count` of the records, moved in time and paced, that are valid."""
    draws = (_shifted_once(encounter, rng) for _ in range(MAX_DRAWS_RATIO * count))
    valid = (one for one in draws if one is not None and _is_valid(check([one])[0]))
    return list(islice(valid, count))


def _is_valid(verdict: Verdict) -> bool:
    return not verdict.violations and not verdict.not_applicable


def _shifted_once(encounter: Encounter, rng: np.random.Generator) -> Scenario | None:
    """Return the records while all are known; None if that is shorter than MIN_SHIFTED_S."""
    time, rows = encounter.time, []
    known = np.ones(len(time), dtype=np.bool_)
    for n in range(len(encounter.vehicles)):
        pace = 1.0 + PACE_RATIO * rng.standard_normal()
        at = time * pace + SHIFT_S * rng.standard_normal()
        known &= (at >= 0.0) & (at <= time[-1])
        track = np.column_stack(
            [encounter.position[n], np.unwrap(encounter.heading[n]), encounter.speed[n] * pace]
        )
        rows.append(np.array([np.interp(at, time, column) for column in track.T]))
    if known.sum() * encounter.dt < MIN_SHIFTED_S:
        return None
    x, y, heading, speed = np.stack(rows, axis=1)[..., known]
    time = time[: int(known.sum())]
    position = np.stack((x, y), axis=-1)
    return Scenario(
        encounter.vehicles, time, position, heading, speed, np.gradient(speed, time, axis=1)
    )


def mixed(members: Sequence[Scenario], rng: np.random.Generator) -> Iterator[Scenario]:
    """Yield scenarios whose vehicles come from different members, as long as the shorter one."""
    for _ in members:
        chosen = rng.permutation(len(members))
        drawn = [members[chosen[n % len(members)]] for n in range(len(members[0].vehicles))]
        count = min(len(one.time) for one in drawn)
        rows: dict[str, Any] = {
            name: np.stack([getattr(one, name)[n, :count] for n, one in enumerate(drawn)])
            for name in ("position", "heading", "speed", "acceleration", "present")
        }
        rows["present"] = np.minimum(rows["present"], count - 1)
        yield replace(members[0], time=drawn[0].time[:count], reference_drive=None, **rows)

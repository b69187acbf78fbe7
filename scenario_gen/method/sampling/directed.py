# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Sampling towards a target: a proposal for the standard normal numbers of candidates, found by the cross-entropy method.

Source: the cross-entropy method (Rubinstein & Kroese 2004), with the samples of all stages weighted together (adaptive multiple
importance sampling, Cornuet et al. 2012) and a defensive mixture (Hesterberg 1995).

A candidate has hundreds of numbers z, and a figure such as its PET hangs on few combinations of them. These are found by ridge
regression of the figures on z; only along them the proposal differs from the standard normal distribution: u = B z has mean m and
standard deviations s, the rest stays as it is. So the weight of a candidate, phi(z) / q(z), is a matter of one to three numbers.
One candidate in ten is drawn as without a target, which bounds every weight by ten.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
import math

import numpy as np
from scipy import linalg, special

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import Bools, Floats
from scenario_gen.types import Cause, Encounter, Measure, Pair, Scenario, Target, UNITS

NATURAL_SHARE = 0.1  # of the proposal's candidates that are drawn as without a target
PLAIN = 0.35  # share of natural candidates that are valid and in the range, from which on no proposal is needed
GOOD = 0.4  # the same share of the proposal's candidates, from which on it is good enough
FAIR, PATIENCE = (
    0.1,
    4,
)  # with this share one stage without a better one ends the search, with less so many do
STAGES = 10  # at most
STAGE = 64  # candidates of a stage
ELITE = 16  # candidates that a proposal is made from, at least
CHUNK = 16  # candidates that are checked together, the nearest to the range first
POOL = 256  # candidates of which the regression is made at most, the latest
HORIZON = 10.0  # s; a time to collision above it says nothing
_RIDGE = (
    0.1  # variance that the regression leaves to what is not linear, as a share of the response's
)
_FEWEST = 8  # candidates of a regression, at least
_PASSES = 3  # of the regression, each with the last one's squared coefficients as prior variances
_INVALID = 1.0  # what is not valid, or not checked, counts as so much farther from the range
_SPREAD = 1.25  # the proposal's standard deviations over the elite's
_LEAST, _MOST = 0.3, 1.5  # the least and greatest of them


class TargetError(RefusedError):
    """The target cannot be had; the message says which range can."""


@dataclass(frozen=True, eq=False)
class Aim:
    """The targets of a request, and what measures them.

    Attributes:
        targets: the ranges; at least one.
        pairs: the vehicles of each, None for the most critical pair.
        measure: returns a figure of a scenario.
        beyond: by how much below the first target's upper bound the search aims; what is nearer to it is taken, too.
        note: what a refusal says besides.
    """

    targets: tuple[Target, ...]
    pairs: tuple[Pair | None, ...]
    measure: Measure
    beyond: float = 0.0
    note: str = ""

    @classmethod
    def of(
        cls,
        targets: tuple[Target, ...],
        encounter: Encounter,
        measure: Measure,
        beyond: float = 0.0,
        note: str = "",
    ) -> "Aim":
        """Resolve the vehicles that the targets name.

        Raises:
            InputError: one of them does not exist.
        """
        return cls(
            targets, tuple(target.pair(encounter) for target in targets), measure, beyond, note
        )

    @property
    def guided(self) -> int:
        """Number of guides."""
        return len(self.targets) + [target.name for target in self.targets].count("ttc")

    def values(self, scenario: Scenario) -> list[float]:
        """Return the figure of each target."""
        return [
            self.measure(scenario, target.name, pair)
            for target, pair in zip(self.targets, self.pairs, strict=True)
        ]

    def holds(self, values: Sequence[float]) -> bool:
        """Whether every figure is in its range."""
        return all(target.holds(value) for target, value in zip(self.targets, values, strict=True))

    def guides(self, scenario: Scenario, values: Sequence[float]) -> list[float]:
        """Return what the regression explains: the figures, of `ttc` its inverse, beside it the gap, which is never infinite."""
        found = []
        for target, pair, value in zip(self.targets, self.pairs, values, strict=True):
            if target.name == "ttc":
                found += [1.0 / max(value, 0.1), self.measure(scenario, "gap", pair)]
            else:
                found.append(value)
        return found

    def distance(
        self, values: Sequence[float], guides: Sequence[float], scale: Sequence[float]
    ) -> float:
        """Return how far the figures are from their ranges, in units of `scale`; NaN counts as infinitely far."""
        total, k = 0.0, 0
        for target, value, unit in zip(self.targets, values, scale, strict=True):
            seen = min(value, HORIZON) if target.name == "ttc" else value
            high = target.high if target is not self.targets[0] else target.high - self.beyond
            total += max(target.low - seen, seen - high, 0.0) / unit
            if target.name == "ttc":
                total += (
                    0.2 * guides[k + 1] if value > HORIZON else 0.0
                )  # on no collision course: first as near as that
            k += 2 if target.name == "ttc" else 1
        return math.inf if math.isnan(total) else total


@dataclass(frozen=True, eq=False)
class Proposal:
    """A distribution of z: a mixture of the standard normal one and one that is moved along a few directions.

    Attributes:
        basis: (k, d) orthonormal rows, the directions.
        mean: (k,) of u = basis z.
        sigma: (k,) standard deviations of u.
    """

    basis: Floats
    mean: Floats
    sigma: Floats

    def moved(self, z: Floats, chooser: Floats) -> Floats:
        """Return samples (S, d) of standard normal numbers z (S, d) and chooser (S,), which says who stays natural."""
        u = z @ self.basis.T
        step = (self.mean + (self.sigma - 1.0) * u) @ self.basis
        natural = special.ndtr(chooser) < NATURAL_SHARE
        return np.where(natural[:, None], z, z + step)

    def ratio(self, z: Floats) -> Floats:
        """Return q(z) / phi(z) (S,), a plain number, at samples z (S, d)."""
        u = z @ self.basis.T
        power = 0.5 * (np.square(u) - np.square((u - self.mean) / self.sigma)).sum(axis=1)
        return np.asarray(
            NATURAL_SHARE
            + (1.0 - NATURAL_SHARE) * np.exp(np.minimum(power, 600.0)) / np.prod(self.sigma)
        )

    def weights(self, z: Floats) -> Floats:
        """Return the importance weights phi(z) / q(z) (S,), at most 1 / NATURAL_SHARE."""
        return np.asarray(1.0 / self.ratio(z))


@dataclass
class Seen:
    """All candidates of all stages, for the regression and the elite.

    Attributes:
        z: (n, d) of each stage.
        guides: (n, g) what the regression explains; NaN where there is no such figure.
        distance: (n,) from the range.
        valid: (n,) whether a candidate was checked and found valid.
        proposals: one per stage, None for the natural distribution.
        values: the figures of those that were found valid.
        figures: those of the targets, of each candidate of each stage.
        refused: why the checked ones that are not valid are not; checked: how many were.
    """

    z: list[Floats] = field(default_factory=list)
    guides: list[Floats] = field(default_factory=list)
    distance: list[Floats] = field(default_factory=list)
    valid: list[Bools] = field(default_factory=list)
    proposals: list[Proposal | None] = field(default_factory=list)
    values: list[list[float]] = field(default_factory=list)
    figures: list[list[list[float]]] = field(default_factory=list)
    refused: Counter[Cause] = field(default_factory=Counter)
    checked: int = 0

    def add(
        self,
        aim: Aim,
        z: Floats,
        proposal: Proposal | None,
        drawn: Sequence[Scenario | None],
        unit: Floats,
    ) -> None:
        """Take in a stage's candidates, none of them checked yet.

        Args:
            aim: the targets.
            z: (S, d) standard normal numbers, of unit 1.
            proposal: what they were drawn with.
            drawn: the candidates.
            unit: (k,) s, m or m/s: the units of the targets' distances.
        """
        figures = [None if scenario is None else aim.values(scenario) for scenario in drawn]
        guides = [
            [math.nan] * aim.guided
            if scenario is None or own is None
            else aim.guides(scenario, own)
            for scenario, own in zip(drawn, figures, strict=True)
        ]
        self.z.append(z)
        self.proposals.append(proposal)
        self.guides.append(np.array(guides))
        self.figures.append(
            [[math.nan] * len(aim.targets) if own is None else own for own in figures]
        )
        self.distance.append(np.zeros(len(z)))
        self.valid.append(np.zeros(len(z), dtype=np.bool_))
        self._measure(aim, unit, len(self.z) - 1)

    def judge(self, aim: Aim, k: int, cause: Cause | None) -> None:
        """Take in why candidate k of the last stage is refused; None: it is valid."""
        self.checked += 1
        self.valid[-1][k] = cause is None
        if cause is None:
            self.values.append(self.figures[-1][k])
            if aim.holds(self.figures[-1][k]):
                self.distance[-1][k] = 0.0  # though the search aims beyond
        else:
            self.refused[cause] += 1

    def scale(self) -> Floats:
        """Return the spread of each figure among the natural candidates (k,) [s, m or m/s], half of the middle two thirds."""
        found = []
        for values in np.array(self.figures[0]).T:
            seen = np.sort(values[np.isfinite(values)])
            found.append(
                0.5 * float(seen[int(0.83 * len(seen))] - seen[int(0.17 * len(seen))])
                if len(seen) > 2
                else 1.0
            )
        return np.asarray(np.maximum(np.array(found), 0.05))

    def rescale(self, aim: Aim, unit: Floats) -> None:
        """Measure the distances of all candidates anew, in units (k,) [s, m or m/s] of the targets."""
        for stage in range(len(self.z)):
            self._measure(aim, unit, stage)

    def _measure(self, aim: Aim, unit: Floats, stage: int) -> None:
        rows = zip(self.figures[stage], self.guides[stage].tolist(), strict=True)
        distance = np.array([aim.distance(own, guides, unit.tolist()) for own, guides in rows])
        taken = self.valid[stage] & np.array([aim.holds(own) for own in self.figures[stage]])
        self.distance[stage] = np.where(taken, 0.0, distance)

    def hits(self) -> int:
        """How many are valid and in the range."""
        return sum(
            int((valid & (distance == 0.0)).sum())
            for valid, distance in zip(self.valid, self.distance, strict=True)
        )

    def proposal(self) -> Proposal | None:
        """Return the next proposal; None if nothing can be learned."""
        z, guides = np.concatenate(self.z), np.concatenate(self.guides)
        distance, valid = np.concatenate(self.distance), np.concatenate(self.valid)
        order = np.argsort(distance + np.where(valid, 0.0, _INVALID), kind="stable")
        elite = order[np.isfinite(distance[order])][: max(ELITE, self.hits())]
        basis = directions(z[-POOL:], guides[-POOL:])
        if len(elite) < 2 or not len(basis):
            return None
        mixture = np.zeros(len(elite))
        for own, proposal in zip(self.z, self.proposals, strict=True):
            mixture += len(own) / len(z) * (1.0 if proposal is None else proposal.ratio(z[elite]))
        weight = 1.0 / mixture
        weight /= weight.sum()
        u = z[elite] @ basis.T
        mean = weight @ u
        spread = np.sqrt(weight @ np.square(u - mean))
        return Proposal(basis, mean, np.clip(_SPREAD * spread, _LEAST, _MOST))


def directions(z: Floats, guides: Floats) -> Floats:
    """Return orthonormal rows (k, d), k <= g, along which the figures change most, by ridge regression.

    A few of the numbers carry most of the effect, so the ridge is repeated with each coefficient's square as the prior variance
    of its own (automatic relevance, MacKay 1992).

    Args:
        z: (n, d) numbers.
        guides: (n, g) figures; rows with one that is not finite are left out.
    """
    known = np.isfinite(guides).all(axis=1)
    if known.sum() < _FEWEST:
        return np.zeros((0, z.shape[1]))
    rows = z[known] - z[known].mean(axis=0)
    found: list[Floats] = []
    for values in guides[known].T:
        response = values - values.mean()
        variance = float(np.square(response).mean())
        if variance < 1e-12:
            continue
        prior = np.full(rows.shape[1], 1.0 / rows.shape[1])
        for _ in range(_PASSES):
            scaled = rows * prior
            kernel = (scaled @ rows.T) * variance
            kernel[np.diag_indices(len(kernel))] += _RIDGE * variance
            beta = variance * (scaled.T @ linalg.solve(kernel, response, assume_a="pos"))
            square = np.square(beta) + 1e-4 * float(np.square(beta).max())
            prior = square / square.sum()
        for other in found:
            beta = beta - (beta @ other) * other
        length = float(np.sqrt(np.square(beta).sum()))
        if length > 1e-9:
            found.append(beta / length)
    return np.array(found).reshape(len(found), z.shape[1])


def estimated(weights: Floats, candidates: int) -> tuple[float, float, float]:
    """Return the share of natural candidates that are hits, with its 95 % interval.

    Args:
        weights: (h,) importance weights of the hits among them.
        candidates: how many there were.
    """
    if not candidates:
        return math.nan, 0.0, 1.0
    share = float(weights.sum()) / candidates
    variance = max(float(np.square(weights).sum()) / candidates - share * share, 0.0) / candidates
    half = 1.96 * math.sqrt(variance)
    most = float(weights.max()) if len(weights) else 1.0 / NATURAL_SHARE
    return (
        share,
        max(0.0, share - half),
        min(1.0, share + half + (0.0 if len(weights) else 3.0 * most / candidates)),
    )


def reachable(aim: Aim, seen_all: Seen) -> str:
    """Say which range of each target the valid candidates had, or, where none of these has the figure, all of them."""
    messages = []
    for k, target in enumerate(aim.targets):
        seen = np.sort([row[k] for row in seen_all.values if math.isfinite(row[k])])
        if not len(seen):
            every = [
                row[k] for stage in seen_all.figures for row in stage if math.isfinite(row[k])
            ]
            those = (
                f"of {len(every)} others it is {min(every):.2f} to {max(every):.2f} {UNITS[target.name]}"
                if every
                else "nor any other"
            )
            messages.append(f"{target.label}: no valid candidate has this figure, {those}")
            continue
        low, high = seen[int(0.05 * (len(seen) - 1))], seen[int(0.95 * (len(seen) - 1))]
        unit = UNITS[target.name]
        messages.append(
            f"{target.label} from {low:.2f} to {high:.2f} {unit} (5 % to 95 % of {len(seen)} valid candidates seen; "
            f"all: {seen[0]:.2f} to {seen[-1]:.2f} {unit})"
        )
    causes = ", ".join(
        f"{number} × {cause.value}" for cause, number in seen_all.refused.most_common(3)
    )
    return (
        "; ".join(messages)
        + (f"; of {seen_all.checked} checked were refused: {causes}" if causes else "")
        + aim.note
    )

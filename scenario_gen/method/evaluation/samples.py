# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The inputs of metrics: scenarios, their template and its replay, on common clocks."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from scenario_gen.method.evaluation.config import EvaluationConfig
from scenario_gen.method.evaluation.distributions import Bootstrap, values_of
from scenario_gen.method.evaluation.dtw import Distance
from scenario_gen.method.evaluation.measures import Criticality, criticality
from scenario_gen.method.evaluation.similarity import pair_similarity, PairSimilarity
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.types import cut, Encounter, Fit, FittedVehicle, Motion, Scenario, ScenarioSet

MAX_UNIT_COUNT = 128  # in a bootstrap of E
MIN_COMMON_S = 1.0  # two vehicles that are present together for less are not compared


@dataclass(frozen=True, eq=False)
class Template:
    """The recorded encounter as the reference of every set, with the vehicles of all sets.

    Attributes:
        encounter: as recorded.
        ids: of the vehicles that are measured.
        steps: T, number of even instants.
        replayed: the fitted template, or None.
        config: how to measure.
        seed: of the bootstrap.
    """

    encounter: Encounter
    ids: tuple[str, ...]
    steps: int
    replayed: Scenario | None
    config: EvaluationConfig
    seed: int

    def even(self, source: Encounter | Scenario) -> Motion:
        """Return the motion of these vehicles at T instants spread evenly over the duration."""
        return chosen(source.with_samples(self.steps), self.ids)

    def periodic(self, source: Encounter | Scenario) -> Motion:
        """Return the motion of these vehicles at the period of distributions and criticality."""
        return chosen(source.resampled(self.config.period), self.ids)

    @cached_property
    def motion(self) -> Motion:
        """The encounter at the even instants."""
        return self.even(self.encounter)

    @cached_property
    def fitted(self) -> Motion | None:
        """The fitted template at the even instants."""
        return self.even(self.replayed) if self.replayed else None

    @cached_property
    def values(self) -> dict[str, Floats]:
        """(n,) values of the encounter by quantity, in the units of `QUANTITIES` (m, s, rad)."""
        return values_of(self.periodic(self.encounter))

    @cached_property
    def critical(self) -> Criticality:
        """The encounter's criticality."""
        return criticality(self.periodic(self.encounter), self.config.ttc_horizon)


@dataclass(frozen=True, eq=False)
class Samples:
    """The scenarios of a set that are measured, beside their template.

    Attributes:
        scenarios: S of them.
        counts: the set with the account of all candidates, or None.
        template: what they were generated from.
    """

    scenarios: Sequence[Scenario]
    counts: ScenarioSet | None
    template: Template

    @cached_property
    def motions(self) -> tuple[Motion, ...]:
        """S motions at the template's even instants."""
        return tuple(map(self.template.even, self.scenarios))

    @cached_property
    def periodic(self) -> tuple[Motion, ...]:
        """S motions on the clock of distributions and criticality."""
        return tuple(map(self.template.periodic, self.scenarios))

    @cached_property
    def is_present(self) -> Bools:
        """(N, T) vehicles and even instants that the template and all samples have."""
        masks = [self.template.motion.is_present, *(motion.is_present for motion in self.motions)]
        return np.asarray(np.logical_and.reduce(masks))

    @cached_property
    def bootstrap(self) -> Bootstrap:
        """The bootstrap of one figure per sample or of a statistic of weights."""
        config = self.template.config
        return Bootstrap.draw(
            antithetic_pairs(self.scenarios), config.resamples, config.level, self.template.seed
        )

    @cached_property
    def pooled(self) -> Bootstrap:
        """The bootstrap of at most MAX_UNIT_COUNT units: the cost of E grows with their square."""
        unit, config = self.bootstrap.unit, self.template.config
        size = -(-(int(unit.max()) + 1) // MAX_UNIT_COUNT)
        return (
            self.bootstrap
            if size == 1
            else Bootstrap.draw(unit // size, config.resamples, config.level, self.template.seed)
        )

    @cached_property
    def pairs(self) -> tuple["VehiclePair", ...]:
        """Pairs that are present together for MIN_COMMON_S in the template and all samples."""
        template, steps = self.template.motion, self.template.steps
        throughout = all(motion.all_present for motion in (template, *self.motions))
        whole = stacked(self.motions)
        pairs = []
        for a, b in combinations(range(len(template.vehicles)), 2):
            if throughout:
                rows = [a, b]
                target = template.position[rows], template.speed[rows], template.heading[rows]
                pairs.append(VehiclePair(target, tuple(values[:, rows] for values in whole)))
                continue
            names = template.vehicles[a].id, template.vehicles[b].id
            sources: list[Encounter | Scenario] = [self.template.encounter, *self.scenarios]
            common = [
                motion
                for source in sources
                if (motion := common_motion(source, names, steps)) is not None
            ]
            if len(common) == len(sources):
                target = common[0].position, common[0].speed, common[0].heading
                pairs.append(VehiclePair(target, stacked(common[1:])))
        return tuple(pairs)


@dataclass(frozen=True, eq=False)
class VehiclePair:
    """Two vehicles while both are present, in the template and S samples, at T instants.

    `template` holds positions (2, T, 2) [m], speeds (2, T) [m/s] and headings (2, T) [rad],
    `samples` the same of S.
    """

    template: tuple[Floats, ...]
    samples: tuple[Floats, ...]

    def similarity(
        self, k: int, distance: Distance, unit: Ints, least: float = 0.0
    ) -> PairSimilarity:
        """Compare one of the three arrays, as `pair_similarity` does."""
        target, series = self.template[k], self.samples[k]
        if target.ndim == 2:
            target, series = target[..., None], series[..., None]
        target, series = np.moveaxis(target, -1, -2), np.moveaxis(series, -1, -2)
        return pair_similarity(
            (target[0], target[1]), (series[:, 0], series[:, 1]), distance, unit, least
        )


def chosen(motion: Motion, ids: Sequence[str]) -> Motion:
    """Return the motion of the vehicles with these ids, in their order."""
    present = motion.ids
    rows = [present.index(known) for known in ids]
    return motion if rows == list(range(len(present))) else motion.of_vehicles(rows)


def common_motion(motion: Motion, ids: tuple[str, str], samples: int) -> Motion | None:
    """Return two vehicles, by their ids, at `samples` times spread evenly while both are present.

    None if they are together for less than MIN_COMMON_S.
    """
    known = motion.ids
    i, j = (known.index(name) for name in ids)
    both = motion.present_slice(i, j)
    if both.stop - both.start < 2:
        return None
    common = motion.pair(i, j)
    return None if common.duration < MIN_COMMON_S else common.with_samples(samples)


def stacked(motions: Sequence[Motion]) -> tuple[Floats, Floats, Floats]:
    """Stack S motions: positions (S, N, T, 2) [m], speeds [m/s], headings [rad] (S, N, T)."""
    return (
        np.stack([motion.position for motion in motions]),
        np.stack([motion.speed for motion in motions]),
        np.stack([motion.heading for motion in motions]),
    )


def antithetic_pairs(scenarios: Sequence[Scenario]) -> Ints:
    """Return the number (S,) of each scenario's antithetic pair.

    The sampler draws candidates 2k and 2k + 1 of a seed as mirror images.
    Scenarios that share a number were not numbered by the sampler; each gets its own number.
    """
    numbers = [(scenario.seed, scenario.index) for scenario in scenarios]
    if len(set(numbers)) < len(numbers):
        return np.arange(len(numbers))
    pairs: dict[tuple[int, int], int] = {}
    return np.array(
        [pairs.setdefault((seed, index // 2), len(pairs)) for seed, index in numbers],
        dtype=np.int64,
    )


MIN_DIRECTED_CHORD_M = 0.5
"""A shorter chord gives no direction (eq 8) and no scale (eq 9)."""


def replay(encounter: Encounter, fit: Fit, frame_id: str = "map") -> Scenario:
    """Map each piece between two anchors onto the road by its own similarity (eqs 7-9).

    Start goes to start and end to end; speeds scale with the lengths. A standing primitive stands
    at its anchor. A piece whose chord is too short to give a direction keeps its shape and is
    turned by the headings of its start.
    """
    first, last = int(fit.anchor_index[0]), int(fit.anchor_index[-1])
    window = slice(first, last + 1)
    states = [
        _replayed(
            encounter.position[n],
            encounter.heading[n],
            encounter.speed[n],
            fit.anchor_index,
            fitted,
        )[window]
        for n, fitted in enumerate(fit.fitted)
    ]
    state = np.stack(states)
    time = encounter.time[window] - encounter.time[first]
    return Scenario(
        vehicles=fit.vehicles,
        time=time,
        position=state[..., :2],
        heading=state[..., 2],
        speed=state[..., 3],
        acceleration=np.gradient(state[..., 3], encounter.dt, axis=1),
        frame_id=frame_id,
        present=cut(encounter.present, first, last + 1),
    )


def _replayed(
    position: Floats, heading: Floats, speed: Floats, index: np.ndarray, fitted: FittedVehicle
) -> Floats:
    """Return (T, 4): x, y, yaw, speed of one vehicle on the road."""
    out = np.empty((len(speed), 4))
    for k in range(len(index) - 1):
        i, j = int(index[k]), int(index[k + 1])
        piece = slice(i, j + 1)
        start, end = fitted.anchors[k], fitted.anchors[k + 1]
        if fitted.stands[k]:
            out[piece] = [*start, 0.0]
            continue
        offset = position[piece] - position[i]
        u, v = offset[-1], end[:2] - start[:2]
        chord, target = np.hypot(*u), np.hypot(*v)
        if chord < MIN_DIRECTED_CHORD_M or target < MIN_DIRECTED_CHORD_M:
            scale, turn = 1.0, start[2] - heading[i]
        else:
            scale, turn = target / chord, np.arctan2(u[0] * v[1] - u[1] * v[0], u @ v)
        c, s = np.cos(turn), np.sin(turn)
        moved = (scale * offset) @ np.array([[c, s], [-s, c]])
        miss = v - moved[-1]  # zero to rounding unless the chord was too short
        out[piece, :2] = start[:2] + moved + np.linspace(0.0, 1.0, j - i + 1)[:, None] * miss
        out[piece, 2] = heading[piece] + turn
        out[piece, 3] = scale * speed[piece]
    return out

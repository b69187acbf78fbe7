# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Candidates by their index: seed and index determine a candidate."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
import hashlib
import itertools
from typing import NamedTuple

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.method.sampling.candidates import CandidateModel
from scenario_gen.method.sampling.importance_sampling import Proposal
from scenario_gen.method.sampling.vehicle_model import NoiseScale
from scenario_gen.numerics import Floats
from scenario_gen.types import Facts, Scenario, with_witness

Label = Callable[[Scenario], Facts]

LEVELS = (
    NoiseScale(),
    NoiseScale(lateral=0.5, vehicle_clock=0.5),
    NoiseScale(lateral=0.5, longitudinal=0.5, vehicle_clock=0.25),
    NoiseScale(lateral=0.25, longitudinal=0.25, time=0.5, vehicle_clock=0.1),
    NoiseScale(lateral=0.1, longitudinal=0.1, time=0.25, vehicle_clock=0.03),
)
"""The levels of standard deviations, tried in this order."""
LEVEL_CANDIDATES = 1 << 20  # of one level whose indices are consecutive
INDEX_LEVELS = 8  # slots of an index; the next candidates of the first level follow the last slot
BLOCK_CANDIDATES = 32  # whose random numbers are drawn together
DIRECTED_SLOT, STAGE_SLOT = 5, 6  # of a proposal's candidates, and of those that find it
SEARCH_SLOT = 7  # of scenarios whose numbers a search selected


def index_of(level: int, candidate: int) -> int:
    """Return the index of a level's candidate."""
    page, within = divmod(candidate, LEVEL_CANDIDATES)
    return (page * INDEX_LEVELS + level) * LEVEL_CANDIDATES + within


def searched_index(numbers: Floats) -> int:
    """Return the index of a scenario whose numbers (d,) a search selected.

    It follows from the SHA-256 of the numbers, rounded to a millionth so that any CPU agrees.
    """
    rounded = np.round(numbers * 1e6).astype(np.int64)
    digest = hashlib.sha256(rounded.tobytes()).digest()[:5]
    return index_of(SEARCH_SLOT, int.from_bytes(digest))


def place_of(index: int) -> tuple[int, int]:
    """Return level and number of the candidate with this index.

    Raises:
        InputError: no candidate has it.
    """
    slot, within = divmod(index, LEVEL_CANDIDATES)
    page, level = divmod(slot, INDEX_LEVELS)
    if index < 0 or level > DIRECTED_SLOT:
        raise InputError(f"no candidate has the index {index}; use one from `scenarios/info`")
    return level, page * LEVEL_CANDIDATES + within


class Block(NamedTuple):
    """Candidates that are drawn together; None for one without a speed profile."""

    indices: list[int]
    scenarios: list[Scenario | None]


@dataclass(frozen=True, eq=False)
class Sampler:
    """Draws candidates by their index.

    Attributes:
        model: of the candidates.
        seed: of all randomness.
        frame_id: the road's frame.
        ego: the vehicle that is left out of published scenarios and becomes the reference drive.
        base: the level whose standard deviations a proposal's candidates have.
        proposal: of the numbers; None for independent standard normal numbers.
        label: returns the facts of a candidate of all vehicles.
    """

    model: CandidateModel
    seed: int
    frame_id: str
    ego: int | None = None
    base: int = 0
    proposal: Proposal | None = None
    label: Label = lambda _: Facts()

    def block(self, level: int, number: int) -> Block:
        """Return a block of a level's candidates."""
        first = index_of(level, number * BLOCK_CANDIDATES)
        indices = list(range(first, first + BLOCK_CANDIDATES))
        batch = self.model.draw(self.numbers(level, number), self._scale(level))
        return Block(indices, batch.scenarios(self.seed, indices, self.frame_id))

    def blocks(self, level: int, first: int = 0) -> Iterator[Block]:
        """Yield the blocks of a level, from a number on."""
        for number in itertools.count(first):
            yield self.block(level, number)

    @property
    def varies(self) -> bool:
        """Whether vehicles have clocks, places, end speeds or sizes that vary."""
        return any(vehicle.variation is not None for vehicle in self.model.vehicles)

    def undisturbed(self) -> Scenario | None:
        """Return the drive without deviations.

        None if nothing varies and no vehicle reacts, or if it has no speed profile.
        """
        if not self.varies and not self.model.reactions.edges:
            return None
        batch = self.model.draw(np.zeros((1, self.model.size)), LEVELS[0])
        return batch.scenarios(self.seed, [0], self.frame_id)[0]

    def published(self, whole: Scenario) -> Scenario:
        """Return a candidate of all vehicles as it is published, with its facts."""
        facts = replace(self.label(whole), lights=whole.facts.lights)
        if self.proposal is not None:
            facts = replace(facts, weight=self.weight(whole.index))
        named = whole.with_facts(facts)
        return named if self.ego is None else with_witness(named, self.ego)

    def weight(self, index: int) -> float:
        """Return the importance weight of a candidate; 1 where there is no proposal."""
        level, candidate = place_of(index)
        if self.proposal is None or level != DIRECTED_SLOT:
            return 1.0
        number, row = divmod(candidate, BLOCK_CANDIDATES)
        numbers = self.numbers(level, number)[row : row + 1]
        return float(self.proposal.weights(numbers)[0])

    def numbers(self, level: int, number: int) -> Floats:
        """Return the numbers (S, size) of a block, those of a proposal transformed by it."""
        if self.proposal is None or level < DIRECTED_SLOT:
            return self._normal(level, number, self.model.size)
        z = self._normal(level, number, self.model.size + 1)
        return self.proposal.transform(z[:, :-1], z[:, -1])

    def _scale(self, level: int) -> NoiseScale:
        return LEVELS[level if level < DIRECTED_SLOT else self.base]

    def _normal(self, level: int, number: int, size: int) -> Floats:
        """Return standard normal numbers (S, size), every other row mirrors the one before.

        So the mean of a set is the drive without deviations, to first order, however few samples
        it has (antithetic variates, Hammersley and Morton 1956).
        """
        seed = np.random.SeedSequence([self.seed, level, number])
        generator = np.random.Generator(np.random.PCG64(seed))
        z = generator.standard_normal((BLOCK_CANDIDATES // 2, size))
        return np.stack([z, -z], axis=1).reshape(BLOCK_CANDIDATES, -1)

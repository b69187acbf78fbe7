# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One candidate by its index, the same whatever was drawn before: of a level of standard deviations, or of a proposal."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
import hashlib
from typing import overload

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.method.sampling.candidates import Scale
from scenario_gen.method.sampling.directed import Proposal
from scenario_gen.method.sampling.model import CandidateModel
from scenario_gen.numerics import Floats, Ints
from scenario_gen.types import (
    Facts,
    Scenario,
    with_witness,
)

Label = Callable[[Scenario], Facts]

LEVELS = (
    Scale(),
    Scale(lateral=0.5, own=0.5),
    Scale(lateral=0.5, longitudinal=0.5, own=0.25),
    Scale(lateral=0.25, longitudinal=0.25, time=0.5, own=0.1),
    Scale(lateral=0.1, longitudinal=0.1, time=0.25, own=0.03),
)
LEVEL_SIZE = 1 << 20  # candidates of one level whose indices follow each other
LEVEL_SLOTS = 8  # levels that an index has room for; after them come the next LEVEL_SIZE candidates of the first
BLOCK = 32  # candidates whose random numbers are drawn together
DIRECTED, STAGED = 5, 6  # slots of the candidates of a proposal, and of those by which it is found
SEARCHED = 7  # slot of scenarios whose numbers a search chose
ENOUGH = {
    "narrow": 0.3,
    "wide": 0.1,
}  # share of valid candidates below which the next level is tried


def index_of(level: int, candidate: int) -> int:
    """Return the index of a level's candidate: level * LEVEL_SIZE + candidate while that suffices, and unique beyond."""
    page, within = divmod(candidate, LEVEL_SIZE)
    return (page * LEVEL_SLOTS + level) * LEVEL_SIZE + within


def searched_index(numbers: Floats) -> int:
    """Return the index of a scenario whose numbers (d,) a search chose: made of their SHA-256, to a millionth as on any CPU."""
    rounded = np.round(numbers * 1e6).astype(np.int64)
    page, within = divmod(
        int.from_bytes(hashlib.sha256(rounded.tobytes()).digest()[:5]), LEVEL_SIZE
    )
    return (page * LEVEL_SLOTS + SEARCHED) * LEVEL_SIZE + within


def place_of(index: int) -> tuple[int, int]:
    """Return level and number of the candidate with this index.

    Raises:
        InputError: no candidate has it.
    """
    slot, within = divmod(index, LEVEL_SIZE)
    page, level = divmod(slot, LEVEL_SLOTS)
    if index < 0 or level > DIRECTED:
        raise InputError(f"no candidate has the index {index}; take one of `scenarios/info`")
    return level, page * LEVEL_SIZE + within


@dataclass(frozen=True, eq=False)
class Sampler:
    """Draws candidates by their index: the same seed and index give the same candidate, whatever was drawn before."""

    model: CandidateModel
    seed: int
    frame_id: str
    ego: int | None = (
        None  # of the vehicle that is left out of what is published, and is its witness
    )
    base: int = 0  # level whose standard deviations the candidates of a proposal have
    proposal: Proposal | None = None
    label: Label = lambda _: Facts()  # facts of a candidate of all vehicles

    def block(self, level: int, number: int) -> tuple[list[int], list[Scenario | None]]:
        """The indices of candidates number·BLOCK … of a level, and these; None for one without a speed profile."""
        first = index_of(level, number * BLOCK)
        index = list(range(first, first + BLOCK))
        drawn = self.model.draw(self.numbers(level, number), self._scale(level))
        return index, drawn.scenarios(self.seed, index, self.frame_id)

    def scenario(self, index: int) -> Scenario | None:
        """The candidate with this index, to rounding as in a whole set; None if it has no speed profile."""
        level, candidate = place_of(index)
        number, row = divmod(candidate, BLOCK)
        batch = self.model.draw(self.numbers(level, number)[row : row + 1], self._scale(level))
        (whole,) = batch.scenarios(self.seed, [index], self.frame_id)
        return None if whole is None else self.published(whole)

    @property
    def free(self) -> bool:
        """Whether vehicles have clocks of their own."""
        return any(vehicle.freedom is not None for vehicle in self.model.vehicles)

    def undisturbed(self) -> Scenario | None:
        """The drive without deviations; None where nothing is free and nobody reacts, or it has no speed profile."""
        if not self.free and not self.model.reactions.edges:
            return None
        return self.model.draw(np.zeros((1, self.model.size)), LEVELS[0]).scenarios(
            self.seed, [0], self.frame_id
        )[0]

    def published(self, whole: Scenario) -> Scenario:
        """A candidate of all vehicles as it is published: with its facts, the ego's motion apart, as witness."""
        facts = self.label(whole)
        if self.proposal is not None:
            facts = replace(facts, weight=self.weight(whole.index))
        named = replace(whole, facts=facts)
        return named if self.ego is None else with_witness(named, self.ego)

    def weight(self, index: int) -> float:
        """The importance weight of the candidate with this index against natural ones; 1 where there is no proposal."""
        level, candidate = place_of(index)
        if self.proposal is None or level != DIRECTED:
            return 1.0
        number, row = divmod(candidate, BLOCK)
        return float(self.proposal.weights(self.numbers(level, number)[row : row + 1])[0])

    def numbers(self, level: int, number: int) -> Floats:
        """The numbers (S, size) of a block of S = BLOCK candidates: standard normal ones, of a proposal moved by it."""
        if self.proposal is None or level < DIRECTED:
            return self._normal(level, number, self.model.size)
        z = self._normal(level, number, self.model.size + 1)
        return self.proposal.moved(z[:, :-1], z[:, -1])

    def _scale(self, level: int) -> Scale:
        return LEVELS[level if level < DIRECTED else self.base]

    def _normal(self, level: int, number: int, size: int) -> Floats:
        """Standard normal numbers (BLOCK, size), every other row the mirror image of the one before.

        The mean of a set is then the drive without deviations, to first order, however few samples the set has (antithetic
        variates, Hammersley and Morton 1956).
        """
        generator = np.random.Generator(
            np.random.PCG64(np.random.SeedSequence([self.seed, level, number]))
        )
        z = generator.standard_normal((BLOCK // 2, size))
        return np.stack([z, -z], axis=1).reshape(BLOCK, -1)


@dataclass(frozen=True, eq=False)
class RedrawnScenarios(Sequence[Scenario]):
    """The scenarios of a large set, redrawn at each access: eight bytes of memory for each.

    Attributes:
        sampler: draws them.
        index: (S,) indices of candidates that are known to be valid.
    """

    sampler: Sampler
    index: Ints

    def __len__(self) -> int:
        return len(self.index)

    @overload
    def __getitem__(self, at: int) -> Scenario: ...

    @overload
    def __getitem__(self, at: slice) -> "RedrawnScenarios": ...

    def __getitem__(self, at: int | slice) -> "Scenario | RedrawnScenarios":
        if isinstance(at, slice):
            return RedrawnScenarios(self.sampler, self.index[at])
        scenario = self.sampler.scenario(int(self.index[at]))
        assert scenario is not None
        return scenario

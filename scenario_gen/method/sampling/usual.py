# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which valid candidates `sampling.variety=population` keeps: those that are usual among recorded encounters of the kind.

A template may be unusual itself, and then nothing generated from it is usual. So kept is what has a rarity of at most 1, or the
two fifths of the valid candidates that are least rare. The bound is found with the first candidates, and is the same for all.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math

from scenario_gen.method.sampling.adapt import Judge
from scenario_gen.method.sampling.sampler import BLOCK, LEVELS, Sampler
from scenario_gen.types import (
    Note,
    NoteKind,
    Scenario,
)

PILOT = 2 * BLOCK  # candidates by which a level is judged
FEW = 20  # valid candidates that are too few to find the bound by
LEAST_RARE = 0.4  # share of the valid candidates that is kept at least


@dataclass(frozen=True, eq=False)
class Usual:
    """Says whether a valid candidate is kept.

    Attributes:
        rarity: returns that of a scenario; None: all are kept.
        most: the greatest rarity that is kept.
    """

    rarity: Callable[[Scenario], float] | None = None
    most: float = math.inf

    @classmethod
    def among(cls, rarity: Callable[[Scenario], float], valid: Sequence[Scenario]) -> "Usual":
        """Find the bound by the first valid candidates."""
        rarities = sorted(map(rarity, valid))
        return cls(
            rarity, max(1.0, rarities[int(LEAST_RARE * len(rarities))]) if rarities else math.inf
        )

    def __call__(self, scenario: Scenario) -> bool:
        """Whether it is."""
        return self.rarity is None or self.rarity(scenario) <= self.most

    @property
    def valid_each(self) -> int:
        """Valid candidates of which one is kept, in the worst case."""
        return 1 if self.rarity is None else math.ceil(1.0 / LEAST_RARE)

    def notes(self) -> tuple[Note, ...]:
        """Return what is to be said of the bound: nothing where what is kept is usual."""
        if self.rarity is None or self.most <= 1.0:
            return ()
        if math.isinf(self.most):
            return (Note.of(NoteKind.NO_SHARED_AREA),)
        return (Note.of(NoteKind.UNUSUAL, rarity=self.most),)


def pilot(sampler: Sampler, judge: Judge, few: int = 0) -> tuple[int, list[Scenario]]:
    """Return the first level of which enough candidates are valid, or the best, and its first valid candidates.

    Where these are fewer than `few`, candidates are drawn until there are five times as many.
    """

    def valid(level: int, blocks: range) -> list[Scenario]:
        drawn = [
            scenario
            for k in blocks
            for scenario in sampler.block(level, k)[1]
            if scenario is not None
        ]
        return [
            scenario
            for scenario, cause in zip(drawn, judge(drawn) if drawn else [], strict=True)
            if cause is None
        ]

    found: dict[int, list[Scenario]] = {}
    for level in range(len(LEVELS)):
        found[level] = valid(level, range(PILOT // BLOCK))
        if len(found[level]) >= judge.enough * PILOT:
            break
    best = max(found, key=lambda level: len(found[level]))
    if len(found[best]) < few:
        found[best] += valid(best, range(PILOT // BLOCK, 5 * PILOT // BLOCK))
    return best, found[best]

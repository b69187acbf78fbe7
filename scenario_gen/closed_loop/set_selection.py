# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which valid scenarios are kept for testing: blind planners fail, and who looks passes."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
import math

import numpy as np

from scenario_gen.closed_loop.blind import blind_family, blind_passes, BlindPlanner, BlindRate
from scenario_gen.closed_loop.planners import IdmFollower, ReferenceFollower
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.numerics import Ints

MAX_BLIND_SHARE = 0.1  # of a set that tests, which a blind planner may pass
PROBED_COUNT = 4  # blind planners that are driven first


class Unfit(StrEnum):
    """Why a valid scenario is not kept for testing."""

    BLIND = "passed by blind planners"
    REFERENCE = "failed by the reference drive"
    HARSH = "failed, or passed with hard braking, by IdmFollower"


@dataclass
class Selection:
    """The scenarios that are kept so far, by what blind planners do in them.

    Attributes:
        family: the blind planners.
        passed: (M,) number of kept scenarios that each of them passes.
        seen: (M,) number of scenarios that each was seen to pass.
        kept: number of kept scenarios.
        unfit: number of other scenarios, by cause.
    """

    family: Sequence[BlindPlanner]
    passed: Ints
    seen: Ints
    kept: int = 0
    unfit: Counter[Unfit] = field(default_factory=Counter)

    @classmethod
    def of(cls, top_speed: float) -> "Selection":
        """Return an empty selection for reference drives with a highest speed [m/s]."""
        family = blind_family(top_speed)
        return cls(family, *np.zeros((2, len(family)), dtype=np.int64))

    def keeps(self, loop: ClosedLoop) -> bool:
        """Keep a scenario if the set tests with it; return whether it is kept."""
        cause = self._cause(loop)
        if cause is not None:
            self.unfit[cause] += 1
        return cause is None

    def _cause(self, loop: ClosedLoop) -> Unfit | None:
        allowed = math.floor(MAX_BLIND_SHARE * (self.kept + 1)) - self.passed
        passes = np.zeros(len(self.family), dtype=np.int64)
        order = np.argsort(-self.seen, kind="stable")
        for rows in (order[:PROBED_COUNT], order[PROBED_COUNT:]):
            passes[rows] = blind_passes(loop, [self.family[row] for row in rows])
            self.seen[rows] += passes[rows]
            if (passes > allowed)[rows].any():
                return Unfit.BLIND
        if not judge(loop, loop.drive(ReferenceFollower(loop))).passed:
            return Unfit.REFERENCE
        verdict = judge(loop, loop.drive(IdmFollower(speed=loop.task().speed)))
        if not verdict.passed or verdict.hardest_braking > loop.config.hard_braking:
            return Unfit.HARSH
        self.passed += passes
        self.kept += 1
        return None

    def rate(self) -> BlindRate:
        """Return how the best blind planner does in the set."""
        return BlindRate.of(self.family, self.passed, self.kept)

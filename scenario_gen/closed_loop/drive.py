# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The record of one drive in closed loop."""

from dataclasses import dataclass

from scenario_gen.numerics import Bools, Floats
from scenario_gen.types import Road, Scenario


@dataclass(frozen=True, eq=False)
class Drive:
    """One drive from start to end; N vehicles, T instants.

    Attributes:
        motion: the driven motion of all vehicles, the ego in its witness' row: a scenario like the
            certified one.
        ego: index of the ego.
        present: (N, T) whether each vehicle was in the scene.
        clock: (N, T) as in `State`.
        accelerations: (T,) accelerations of the ego [m/s²].
        forced: number of times that one of the others braked harder or more suddenly than drivers
            do, to preserve the order.
        faults: steps of faulty commands, and their descriptions.
        jumps: the instants before which the ego jumped.
        road: the drivable area for the ego's type, while the drive is judged; None if not known.
    """

    motion: Scenario
    ego: int
    present: Bools
    clock: Floats
    accelerations: Floats
    forced: int
    faults: tuple[tuple[int, str], ...]
    jumps: tuple[int, ...] = ()
    road: Road | None = None

    @property
    def driven(self) -> int:
        """Number of instants before the first jump."""
        return min((*self.jumps, len(self.motion.time)))

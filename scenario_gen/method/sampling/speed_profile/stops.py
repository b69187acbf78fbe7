# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Waits on a sample's clock: which part stands, which moves slowly, and how short they may become."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scenario_gen.method.sampling.time_warp import SHORTEST_SHARE
from scenario_gen.numerics import Bools, Floats, runs
from scenario_gen.situation import STANDSTILL_SPEED_MPS, Wait
from scenario_gen.types import Encounter

SHORTEST_WAIT = 1.25  # s; shorter waits are lengthened to it, so that they are still waits on the published grid
_LEAST_WAIT = 1.15  # s, to which a fast clock may shorten one


def standing_part(encounter: Encounter, wait: Wait) -> Wait:
    """The part of a wait in which the vehicle stands, not yet or no longer moves slowly; a slow wait as it is.

    A wait begins below 0.5 m/s, so a vehicle that brakes gently still rolls for a while.
    """
    inside = (encounter.time >= wait.start) & (encounter.time <= wait.end)
    stands = encounter.time[inside & (encounter.speed[wait.vehicle] <= STANDSTILL_SPEED_MPS)]
    if wait.moves_slowly or len(stands) == 0:
        return wait
    start = wait.start if wait.start <= encounter.time[0] else float(stands[0])
    end = wait.end if wait.end >= encounter.time[-1] else float(stands[-1])
    return replace(wait, start=start, end=end)


def standing_within(
    times: Floats,
    dwells: Bools,
    stands: Sequence[tuple[float, float]],
    time: Floats,
    speed: Floats,
) -> tuple[list[tuple[float, float]], Bools]:
    """Replace dwells by the parts of them in which the template stands: a vehicle still rolls when a primitive begins.

    Args:
        times: (K + 2,) of start, changepoints and end [s].
        dwells: (K + 1,) primitives in which the route does not move.
        stands: begin and end [s] of the waits in which it stands.
        time: (T,) the template's samples [s].
        speed: (T,) its speeds [m/s].

    Returns:
        The stands with those of dwells, and the dwells (K + 1,) that are left: of those it is never slow enough to stand.
    """
    stands_kept, left = list(stands), dwells.copy()
    for a, b in runs(dwells):
        inside = (time >= times[a]) & (time <= times[b])
        still = time[inside & (speed <= STANDSTILL_SPEED_MPS)]
        if len(still):
            start = times[a] if a == 0 and speed[0] <= STANDSTILL_SPEED_MPS else still[0]
            end = times[b] if b == len(dwells) and speed[-1] <= STANDSTILL_SPEED_MPS else still[-1]
            stands_kept.append((float(start), float(end)))
            left[a:b] = False
    return stands_kept, left


def least_shares(grid: Floats, waits: Sequence[Wait]) -> Floats:
    """(G,) the slowest that a clock may run at template times (G,) [s], as a share of the nominal, so that waits remain waits."""
    shares = np.full(len(grid), SHORTEST_SHARE)
    for wait in waits:
        inside = (grid > wait.start - 1.0) & (grid < wait.end + 1.0)
        least = _LEAST_WAIT / max(wait.end - wait.start, SHORTEST_WAIT)
        shares[inside] = np.maximum(shares[inside], least)
    return shares


def lengthened(n: int, waits: Sequence[Wait], *, creeping: bool) -> list[tuple[float, float]]:
    """Begin and end [s] of vehicle n's waits of one kind, short ones lengthened."""
    own = [wait for wait in waits if wait.vehicle == n and wait.moves_slowly == creeping]
    pads = [max(0.0, 0.5 * (SHORTEST_WAIT - (wait.end - wait.start))) for wait in own]
    return [(wait.start - pad, wait.end + pad) for wait, pad in zip(own, pads, strict=True)]

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What is known of a scenario before it is driven: its motion by the clock of its certificate, and the order of its events.

Every vehicle i has a clock τ_i: it is where the certified scenario has it at time τ_i. All clocks
equal and running is the certified execution; a vehicle that is held up has a clock that runs more
slowly. For two vehicles the certificate says that no collision lies on τ_i = τ_j. A collision at
τ_i > τ_j is at a place that j passed first: i may come there only when j has gone. So `order[i,
j]` says how far the clock of i may go for each clock of j, and it may always go as far as that of
j (docs/closed_loop.md).
Source: priorities in the coordination space, Gregoire, Bonnabel & de La Fortelle 2014, on clocks
instead of path lengths.
"""

from typing import NamedTuple

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Bools, Floats, frozen
from scenario_gen.numerics.boxes import boxes_meet, fill_box
from scenario_gen.numerics.hermite import cubic, interval_at
from scenario_gen.numerics.kernels import B1, F, F1, F2, F3, I, kernel, named, OUT2, OUT3
from scenario_gen.numerics.plane import unit
from scenario_gen.situation import conflict_of, passing
from scenario_gen.types import Scenario, tokens, YIELD

CELL = 0.1  # seconds of a certified clock that are taken together
ROOM = 0.05  # metres by which the box of a cell is larger than its ends ask for: what bends between them, and a little distance
BESIDE_LANE = 0.75  # metres beside the footprints of all that drive which belong to their lanes: 3.4 m of a car's
PARKED = 1.0  # metres; who drives less stands on no lane of its own
STANDS = (
    0.5  # m/s; who is slower at the end of a scenario stands there, who is faster leaves the scene
)


class World(NamedTuple):
    """A certified scenario as the closed loop needs it, and the step; N vehicles, T instants, K cells of the clock.

    Attributes:
        step: time between two decisions [s].
        time: (T,) the scenario's instants [s].
        motion: (N, T, 6) x, y [m], yaw [rad], speed [m/s], velocity x, y [m/s] at these.
        half: (N, 2) half lengths and widths [m].
        spans: (N, 2) clocks [s] at which each vehicle comes onto the scene and at which its
            certified motion ends.
        leaves: (N,) whether it leaves the scene then; who stands at the scenario's end stays.
        cells: (N, K, 8) of each cell of the clock: the box that holds the footprint throughout
            (centre x, y [m], cos and sin of its yaw, half length, half width [m], radius [m]), and
            the way driven [m] at its start.
        cell: length of a cell [s].
        order: (N, N, K) `order[i, j, k]`: clock [s] that vehicle i may not pass while the clock of
            j is in cell k, unless that of j is there, too; inf if nothing is in its way. It holds
            back who waits for j in the template, too.
        ego: index of the ego's witness.
        walks: (N,) who is on foot.
        kerbs: (N, K) clock [s] at which one on foot, in each cell, next steps onto a lane where
            somebody drives; the cell's start if it is on one, inf if it never does, and for who
            drives.
    """

    step: float
    time: Floats
    motion: Floats
    half: Floats
    spans: Floats
    leaves: Bools
    cells: Floats
    cell: float
    order: Floats
    ego: int
    walks: Bools
    kerbs: Floats


WORLD = named(World, F, F1, F3, F2, F2, B1, F3, F, F3, I, B1, F2)


def world_of(scenario: Scenario, ego: int | str, step: float = 0.1) -> World:
    """Prepare a scenario for being driven in steps [s], with one of its vehicles, by index or id, as the ego's witness.

    Raises:
        InputError: it has no such vehicle, or starts at another time than 0.
    """
    ids = [vehicle.id for vehicle in scenario.vehicles]
    if isinstance(ego, str):
        if ego not in ids:
            raise InputError(
                f"scenario {scenario.index} has no vehicle {ego!r} to be the ego; it has {', '.join(ids)}"
            )
        ego = ids.index(ego)
    if not 0 <= ego < len(ids):
        raise InputError(
            f"scenario {scenario.index} has no vehicle number {ego} to be the ego; it has {len(ids)}"
        )
    time = scenario.time
    if len(time) < 2 or time[0] != 0.0:
        raise InputError(
            f"scenario {scenario.index} must start at 0 s and have two samples at least"
        )
    speed, yaw = scenario.speed, scenario.heading
    velocity = speed[..., None] * unit(yaw)
    motion = frozen(
        np.concatenate([scenario.position, yaw[..., None], speed[..., None], velocity], axis=2)
    )
    half = frozen([vehicle.half for vehicle in scenario.vehicles])
    n, count = len(ids), int(np.ceil(time[-1] / CELL - 1e-9))
    cells, order = np.empty((n, count, 8)), np.empty((n, n, count))
    spans = frozen(time[scenario.present])
    fill_cells(time, motion, half, spans, CELL, cells)
    fill_order(cells, CELL, order)
    names = tokens(ids)
    for reaction in scenario.facts.reactions:
        if reaction.kind != YIELD or not {reaction.who, reaction.whom} <= set(names):
            continue
        who, whom = names.index(reaction.who), names.index(reaction.whom)
        if ego not in (who, whom):
            _keep_waiting(scenario, who, whom, order[who, whom])
    leaves = np.asarray((speed[:, -1] >= STANDS) | (spans[:, 1] < time[-1]))
    walks, kerbs = (
        np.array([vehicle.kind.walks for vehicle in scenario.vehicles]),
        np.full((n, count), np.inf),
    )
    fill_kerbs(cells, walks, CELL, kerbs)
    return World(
        step,
        time,
        motion,
        half,
        spans,
        leaves,
        frozen(cells),
        CELL,
        frozen(order),
        ego,
        walks,
        frozen(kerbs),
    )


def _keep_waiting(scenario: Scenario, who: int, whom: int, order: Floats) -> None:
    """Lower the `order` (K,) of a yielder and the one it waits for: until that one has cleared it does not enter.

    Its clock is held where that one clears, or where it enters, if that is earlier. So its gap
    behind the clearing stays.
    """
    conflict = conflict_of(scenario, who, whom)
    if conflict is None or conflict.second != who:
        return
    cleared, enters = passing(scenario, conflict, merges=conflict.following)
    held = np.floor(min(cleared, enters) / CELL) * CELL
    before = np.arange(len(order)) * CELL < cleared
    order[before] = np.minimum(order[before], held)


@kernel(inline=True)
def pose_at(time: Floats, motion: Floats, clock: float, out: Floats) -> None:
    """Write x, y, yaw, speed, acceleration of one vehicle's motion (T, 6) at a clock [s] into `out` (5,).

    The motion between two samples is that of `Motion`; beyond the ends it stays there.
    """
    t = min(max(clock, 0.0), time[time.shape[0] - 1])
    k = interval_at(time, t)
    h = time[k + 1] - time[k]
    u = (t - time[k]) / h
    a, b = motion[k], motion[k + 1]
    out[0] = cubic(a[0], a[4], b[0], b[4], h, u)
    out[1] = cubic(a[1], a[5], b[1], b[5], h, u)
    out[2] = a[2] + u * (b[2] - a[2])
    out[3] = a[3] + u * (b[3] - a[3])
    out[4] = (b[3] - a[3]) / h


FAR = 1e15  # metres; where the boxes are of a vehicle that is not on the scene


@kernel(F1, F3, F2, F2, F, OUT3)
def fill_cells(
    time: Floats, motion: Floats, half: Floats, spans: Floats, cell: float, out: Floats
) -> None:
    """Fill `cells` (N, K, 8) of `World`, from the motion (N, T, 6), half sizes (N, 2) [m], spans and the cells' length [s].

    The box stands at the middle pose, is longer and wider by what the ends ask for, by what the
    turn adds, and by ROOM.
    """
    a, b, m = np.empty(5), np.empty(5), np.empty(5)
    for i in range(out.shape[0]):
        way = 0.0
        for k in range(out.shape[1]):
            start, end = max(k * cell, spans[i, 0]), min((k + 1) * cell, spans[i, 1])
            if start > end:
                fill_box(FAR, FAR, 0.0, 0.0, 0.0, out[i, k])
                out[i, k, 7] = way
                continue
            pose_at(time, motion[i], start, a)
            pose_at(time, motion[i], end, b)
            pose_at(time, motion[i], 0.5 * (start + end), m)
            c, s = np.cos(m[2]), np.sin(m[2])
            ahead = max(
                abs((a[0] - m[0]) * c + (a[1] - m[1]) * s),
                abs((b[0] - m[0]) * c + (b[1] - m[1]) * s),
            )
            aside = max(
                abs((a[1] - m[1]) * c - (a[0] - m[0]) * s),
                abs((b[1] - m[1]) * c - (b[0] - m[0]) * s),
            )
            turn = max(abs(a[2] - m[2]), abs(b[2] - m[2]))
            length = half[i, 0] + ahead + half[i, 1] * turn + ROOM
            width = half[i, 1] + aside + half[i, 0] * turn + ROOM
            fill_box(m[0], m[1], m[2], length, width, out[i, k])
            out[i, k, 7] = way
            way += np.hypot(m[0] - a[0], m[1] - a[1]) + np.hypot(b[0] - m[0], b[1] - m[1])


@kernel(F3, F, OUT3)
def fill_order(cells: Floats, cell: float, out: Floats) -> None:
    """Fill `out` (N, N, K) with `order` of `World`, from the cells (N, K, 8) and their length [s].

    For each cell k of j the first cell l >= k of i whose boxes meet, at whose start i must wait;
    then the least over all later k, for what j has not passed yet it may still come to. The price
    of taking cells together is waiting a little farther away.
    """
    n, count = cells.shape[0], cells.shape[1]
    for i in range(n):
        for j in range(n):
            least = np.inf
            for k in range(count - 1, -1, -1):
                if i != j:
                    last = count if least == np.inf else min(count, int(least / cell + 0.5))
                    for l in range(k, last):  # noqa: E741 - the next letter
                        if boxes_meet(cells[j, k], cells[i, l]):
                            least = l * cell
                            break
                out[i, j, k] = least


@kernel(F3, B1, F, OUT2)
def fill_kerbs(cells: Floats, walks: Bools, cell: float, out: Floats) -> None:
    """Fill `out` (N, K) with `kerbs` of `World`; it holds inf. Cells (N, K, 8), their length [s], who is on foot (N,)."""
    n, count = cells.shape[0], cells.shape[1]
    for i in range(n):
        for j in range(n):
            if not walks[i] or walks[j] or cells[j, count - 1, 7] < PARKED:
                continue
            for l in range(count):  # noqa: E741 - the next letter
                lane = cells[j, l, :7].copy()
                lane[4] += BESIDE_LANE
                lane[5] += BESIDE_LANE
                lane[6] += 2.0 * BESIDE_LANE
                for k in range(count):
                    if out[i, k] == np.inf and boxes_meet(cells[i, k], lane):
                        out[i, k] = k * cell
        for k in range(count - 2, -1, -1):
            if out[i, k] == np.inf:
                out[i, k] = out[i, k + 1]

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A scenario before it is driven: its motion over certified clocks, and the order of its events.

Every vehicle i has a clock τ_i: the vehicle is where the certified scenario has it at time τ_i.
In the certified execution all clocks are equal and run at rate 1. The clock of a delayed vehicle
runs more slowly. The certificate says that no two vehicles collide on τ_i = τ_j. A collision at
τ_i > τ_j is at a place that j passed first: i must not get there before j has gone. So
`order[i, j]` is the limit of clock i for each value of clock j. Clock i may always reach clock j
(docs/closed_loop.md).

Source: priorities in the coordination space, Gregoire, Bonnabel & de La Fortelle 2014, with clocks
instead of path lengths.
"""

from typing import NamedTuple

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.lights import red_phases
from scenario_gen.numerics import Bools, Floats, frozen, unit
from scenario_gen.numerics.boxes import boxes_meet, fill_box
from scenario_gen.numerics.hermite import cubic, interval_at
from scenario_gen.numerics.kernels import B1, F, F1, F2, F3, I, kernel, named, OUT2, OUT3
from scenario_gen.situation import conflict_of, passing
from scenario_gen.types import FOLLOW, Scenario, tokens

CELL_S = 0.1  # length of a cell of the clock; events within a cell are not distinguished
BOX_MARGIN_M = 0.05  # for the curvature between the poses of a cell, and some distance
LANE_MARGIN_M = 0.75  # a lane is wider than the footprints on it by this: 3.4 m for a car
MIN_LANE_WAY_M = 1.0  # a vehicle that drives less occupies no lane
MAX_STANDING_SPEED_MPS = 0.5  # a faster vehicle leaves the scene at the end of its motion
MAX_REACTION_GAP_S = 3.0  # longer after the other one a vehicle does not react to it
FREE_SPEED_RATIO = 1.15  # free speed of a driver, of its highest recorded one
LATERAL_MPS2 = 3.0  # lateral acceleration of a driver that hurries through a bend
BRAKING_MPS2 = 2.0  # its braking before a bend
FAR_AWAY_M = 1e15  # place of the boxes of a vehicle that is not on the scene


class World(NamedTuple):
    """A certified scenario for the closed loop; N vehicles, T instants, K cells of the clock.

    Attributes:
        step: time between two decisions [s].
        time: (T,) instants of the scenario [s].
        motion: (N, T, 6) x, y [m], yaw [rad], speed [m/s], velocity x, y [m/s].
        half: (N, 2) half lengths and widths [m].
        spans: (N, 2) clocks [s] at which each vehicle enters the scene and its certified motion
            ends.
        leaves: (N,) whether it leaves the scene then; a vehicle that stands at the end stays.
        cells: (N, K, 8) of each cell of the clock: the box that covers the footprint in the cell
            (centre x, y [m], cos and sin of its yaw, half length, half width [m], radius [m]), and
            the driven way [m] at its start.
        cell: length of a cell [s].
        order: (N, N, K) `order[i, j, k]`: clock [s] that vehicle i may not pass while the clock of
            j is in cell k, unless the clock of j has passed it, too; infinity if nothing limits i.
            It includes the waits of the template.
        ego: index of the witness of the ego.
        meets: (N, K, 2) clocks [s] of the ego at the start of its first and at the end of its last
            cell whose box meets that of a vehicle's cell; infinity and -infinity if none does.
        reacts: (N, N) clock [s] until which vehicle i reacts to vehicle j: it follows j, or lets j
            pass shortly before itself; 0 if it does not.
        free: (N, K) speed [m/s] at which each vehicle hurries to one that it reacts to.
        walks: (N,) whether each is a pedestrian.
        kerbs: (N, K) clock [s] at which a pedestrian, in each cell, next steps onto a lane that a
            vehicle uses: the start of the cell on a lane; infinity if never, and for vehicles.
        reds: (N, R, 3) as `red_phases` returns them.
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
    meets: Floats
    reacts: Floats
    free: Floats
    walks: Bools
    kerbs: Floats
    reds: Floats


WORLD = named(World, F, F1, F3, F2, F2, B1, F3, F, F3, I, F3, F2, F2, B1, F2, F3)


def ego_index(scenario: Scenario, ego: int | str) -> int:
    """Return the index of the vehicle that the ego replaces, from its index or id.

    Raises:
        InputError: the scenario has no such vehicle.
    """
    ids = scenario.ids
    if isinstance(ego, int) and 0 <= ego < len(ids):
        return ego
    if ego in ids:
        return ids.index(str(ego))
    raise InputError(
        f"scenario {scenario.index} has no vehicle {ego!r} to be the ego; it has {', '.join(ids)}"
    )


def world_of(scenario: Scenario, ego: int | str, step: float = 0.1) -> World:
    """Prepare a scenario for drives in which the ego replaces one of its vehicles.

    Args:
        scenario: certified.
        ego: index or id of the vehicle that the ego replaces, its witness.
        step: time between two decisions [s].

    Raises:
        InputError: it has no such vehicle, or does not start at 0 s.
    """
    ego = ego_index(scenario, ego)
    time = scenario.time
    if len(time) < 2 or time[0] != 0.0:
        raise InputError(
            f"scenario {scenario.index} must start at 0 s and have two samples at least"
        )
    speed = scenario.speed
    yaw = scenario.heading
    velocity = speed[..., None] * unit(yaw)
    motion = frozen(
        np.concatenate([scenario.position, yaw[..., None], speed[..., None], velocity], axis=2)
    )
    half = frozen([vehicle.half for vehicle in scenario.vehicles])
    spans = frozen(time[scenario.present])
    n = len(scenario.vehicles)
    count = int(np.ceil(time[-1] / CELL_S - 1e-9))
    cells = np.empty((n, count, 8))
    fill_cells(time, motion, half, spans, CELL_S, cells)
    order = np.empty((n, n, count))
    fill_order(cells, CELL_S, order)
    for trailer, vehicle in scenario.towed:  # they move as one
        order[trailer, vehicle] = order[vehicle, trailer] = np.inf
    reacts = _add_reactions(scenario, ego, order)
    meets = np.empty((n, count, 2))
    fill_meetings(cells, ego, CELL_S, meets)
    free = np.empty((n, count))
    fill_free_speeds(time, motion, reacts.max(axis=1), CELL_S, free)
    walks = np.array([vehicle.kind.walks for vehicle in scenario.vehicles])
    kerbs = np.full((n, count), np.inf)
    fill_kerbs(cells, walks, CELL_S, kerbs)
    return World(
        step=step,
        time=time,
        motion=motion,
        half=half,
        spans=spans,
        leaves=np.asarray((speed[:, -1] >= MAX_STANDING_SPEED_MPS) | (spans[:, 1] < time[-1])),
        cells=frozen(cells),
        cell=CELL_S,
        order=frozen(order),
        ego=ego,
        meets=frozen(meets),
        reacts=frozen(reacts),
        free=frozen(free),
        walks=walks,
        kerbs=frozen(kerbs),
        reds=frozen(red_phases(scenario)),
    )


def _add_reactions(scenario: Scenario, ego: int, order: Floats) -> Floats:
    """Add the waits among the other vehicles to the `order` (N, N, K); return `World.reacts`."""
    n = len(scenario.vehicles)
    reacts = np.zeros((n, n))
    kinds = dict.fromkeys(((who, ego) for who in range(n) if who != ego), "")
    kinds |= _known_reactions(scenario)
    for (who, whom), kind in kinds.items():
        if kind == FOLLOW:
            reacts[who, whom] = np.inf
            continue
        conflict = conflict_of(scenario, who, whom)
        if conflict is None or conflict.second != who:
            continue
        cleared, enters = passing(scenario, conflict, merges=conflict.following)
        until = np.inf if conflict.following else enters
        reacts[who, whom] = until if kind or enters - cleared < MAX_REACTION_GAP_S else 0.0
        if ego not in (who, whom):
            _add_wait(order[who, whom], cleared, enters)
    return reacts


def _known_reactions(scenario: Scenario) -> dict[tuple[int, int], str]:
    """Return the kinds of the reactions of a scenario, by the indices of who reacts to whom."""
    names = tokens([vehicle.id for vehicle in scenario.vehicles])
    return {
        (names.index(reaction.who), names.index(reaction.whom)): reaction.kind
        for reaction in scenario.facts.reactions
        if {reaction.who, reaction.whom} <= set(names)
    }


def _add_wait(order: Floats, cleared: float, enters: float) -> None:
    """Lower the `order` (K,) of a yielder: it does not enter before the other has cleared.

    Its limit is its clock when the other clears, or when it enters, if that is earlier [s]. So the
    yielder keeps its time gap to the other.
    """
    limit = np.floor(min(cleared, enters) / CELL_S) * CELL_S
    before = np.arange(len(order)) * CELL_S < cleared
    order[before] = np.minimum(order[before], limit)


@kernel(inline=True, forced=True)
def pose_at(time: Floats, motion: Floats, clock: float, out: Floats) -> None:
    """Write x, y, yaw, speed and acceleration (5,) of a motion (T, 6) at a clock [s].

    Between samples the motion is that of `Motion`; beyond its ends the vehicle stands.
    """
    t = min(max(clock, 0.0), time[time.shape[0] - 1])
    k = interval_at(time, t)
    h = time[k + 1] - time[k]
    u = (t - time[k]) / h
    a = motion[k]
    b = motion[k + 1]
    out[0] = cubic(a[0], a[4], b[0], b[4], h, u)
    out[1] = cubic(a[1], a[5], b[1], b[5], h, u)
    out[2] = a[2] + u * (b[2] - a[2])
    out[3] = a[3] + u * (b[3] - a[3])
    out[4] = (b[3] - a[3]) / h


@kernel(F1, F3, F2, F2, F, OUT3)
def fill_cells(
    time: Floats, motion: Floats, half: Floats, spans: Floats, cell: float, out: Floats
) -> None:
    """Fill the `cells` (N, K, 8) of `World`.

    The box has the middle pose of the cell. It is longer and wider by the distance of the end
    poses, by the effect of the turn, and by BOX_MARGIN_M.

    Args:
        time: (T,) instants [s].
        motion: (N, T, 6) as in `World`.
        half: (N, 2) half lengths and widths [m].
        spans: (N, 2) as in `World`.
        cell: length of a cell [s].
        out: (N, K, 8).
    """
    a = np.empty(5)
    b = np.empty(5)
    m = np.empty(5)
    for i in range(out.shape[0]):
        way = 0.0
        for k in range(out.shape[1]):
            out[i, k, 7] = way
            start = max(k * cell, spans[i, 0])
            end = min((k + 1) * cell, spans[i, 1])
            if start > end:
                fill_box((1 + i) * FAR_AWAY_M, FAR_AWAY_M, 0.0, 0.0, 0.0, out[i, k])
                continue
            pose_at(time, motion[i], start, a)
            pose_at(time, motion[i], end, b)
            pose_at(time, motion[i], 0.5 * (start + end), m)
            c = np.cos(m[2])
            s = np.sin(m[2])
            along = max(
                abs((a[0] - m[0]) * c + (a[1] - m[1]) * s),
                abs((b[0] - m[0]) * c + (b[1] - m[1]) * s),
            )
            across = max(
                abs((a[1] - m[1]) * c - (a[0] - m[0]) * s),
                abs((b[1] - m[1]) * c - (b[0] - m[0]) * s),
            )
            turn = max(abs(a[2] - m[2]), abs(b[2] - m[2]))
            length = half[i, 0] + along + half[i, 1] * turn + BOX_MARGIN_M
            width = half[i, 1] + across + half[i, 0] * turn + BOX_MARGIN_M
            fill_box(m[0], m[1], m[2], length, width, out[i, k])
            way += np.hypot(m[0] - a[0], m[1] - a[1]) + np.hypot(b[0] - m[0], b[1] - m[1])


@kernel(inline=True)
def _first_meeting(box: Floats, cells: Floats, first: int, last: int) -> int:
    """Return the first of the cells (K, 8), from `first` to before `last`, that meets a box.

    -1 if none does.
    """
    for k in range(first, last):
        if boxes_meet(box, cells[k]):
            return k
    return -1


@kernel(inline=True)
def _cells_on_scene(cells: Floats) -> tuple[int, int]:
    """Return the first cell (K, 8) in which a vehicle is on the scene, and the first behind it."""
    first = 0
    end = cells.shape[0]
    while first < end and cells[first, 6] == 0.0:
        first += 1
    while end > first and cells[end - 1, 6] == 0.0:
        end -= 1
    return first, end


@kernel(F3, F, OUT3)
def fill_order(cells: Floats, cell: float, out: Floats) -> None:
    """Fill the `order` (N, N, K) of `World` from the cells (N, K, 8) and their length [s].

    For each cell k of j, vehicle i waits at the start of its first cell l >= k whose box meets
    that of j. The limit is the minimum over all later k, which j has not passed yet. Because of
    the cells, vehicles wait a little earlier than necessary.
    """
    n = cells.shape[0]
    count = cells.shape[1]
    out[:] = np.inf
    for pair in range(n * n):
        i = pair // n
        j = pair % n
        if i == j:
            continue
        first, last = _cells_on_scene(cells[i])
        begin, end = _cells_on_scene(cells[j])
        limit = np.inf
        for k in range(count - 1, -1, -1):
            meeting = -1
            if begin <= k < end:
                meeting = _first_meeting(cells[j, k], cells[i], max(k, first), last)
            if meeting >= 0:
                last = meeting
                limit = meeting * cell
            out[i, j, k] = limit


@kernel(F3, I, F, OUT3)
def fill_meetings(cells: Floats, ego: int, cell: float, out: Floats) -> None:
    """Fill the `meets` (N, K, 2) of `World` from the cells (N, K, 8) and their length [s]."""
    count = out.shape[1]
    out[:, :, 0] = np.inf
    out[:, :, 1] = -np.inf
    first, end = _cells_on_scene(cells[ego])
    for place in range(out.shape[0] * count):
        i = place // count
        k = place % count
        for m in range(first, end):
            if i != ego and boxes_meet(cells[i, k], cells[ego, m]):
                out[i, k, 0] = min(out[i, k, 0], m * cell)
                out[i, k, 1] = (m + 1) * cell


@kernel(F1, F3, F1, F, OUT2)
def fill_free_speeds(
    time: Floats, motion: Floats, until: Floats, cell: float, out: Floats
) -> None:
    """Fill the `free` (N, K) of `World`.

    Until the end of its reactions a vehicle drives as fast as it ever does, but slows down in
    bends; then it drives at its certified speed.

    Args:
        time: (T,) instants [s].
        motion: (N, T, 6) as in `World`.
        until: (N,) clocks [s] at which the reactions end.
        cell: length of a cell [s].
        out: (N, K).
    """
    a = np.empty(5)
    b = np.empty(5)
    for i in range(out.shape[0]):
        fastest = FREE_SPEED_RATIO * motion[i, :, 3].max()
        following = np.inf
        for k in range(out.shape[1] - 1, -1, -1):
            pose_at(time, motion[i], k * cell, a)
            pose_at(time, motion[i], (k + 1) * cell, b)
            way = np.hypot(b[0] - a[0], b[1] - a[1])
            free = max(a[3], b[3])
            if k * cell < until[i]:
                bend = abs(b[2] - a[2]) / max(way, 0.01)
                free = max(free, min(fastest, np.sqrt(LATERAL_MPS2 / max(bend, 1e-6))))
            following = min(free, np.sqrt(following * following + 2.0 * BRAKING_MPS2 * way))
            out[i, k] = following


@kernel(inline=True)
def _mark_lane(vehicle: Floats, cells: Floats, cell: float, out: Floats) -> None:
    """Write the starts of the cells (K, 8) of a pedestrian on the lane of a vehicle (K, 8)."""
    for m in range(vehicle.shape[0]):
        lane = vehicle[m, :7].copy()
        lane[4] += LANE_MARGIN_M
        lane[5] += LANE_MARGIN_M
        lane[6] += 2.0 * LANE_MARGIN_M
        for k in range(cells.shape[0]):
            if out[k] == np.inf and boxes_meet(cells[k], lane):
                out[k] = k * cell


@kernel(F3, B1, F, OUT2)
def fill_kerbs(cells: Floats, walks: Bools, cell: float, out: Floats) -> None:
    """Fill the `kerbs` (N, K) of `World`, which are infinity before.

    Args:
        cells: (N, K, 8) as in `World`.
        walks: (N,) whether each is a pedestrian.
        cell: length of a cell [s].
        out: (N, K).
    """
    n = cells.shape[0]
    count = cells.shape[1]
    for i in range(n):
        if not walks[i]:
            continue
        for j in range(n):
            if not walks[j] and cells[j, count - 1, 7] >= MIN_LANE_WAY_M:
                _mark_lane(cells[j], cells[i], cell, out[i])
        for k in range(count - 2, -1, -1):
            if out[i, k] == np.inf:
                out[i, k] = out[i, k + 1]

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The others in one step: how fast each clock runs, so that they stay clear of the ego and never meet each other.

Each vehicle keeps its certified path and never exceeds its certified speed there: its clock runs at a rate of 0 to 1. Three
things slow it down, the strongest counts:

- who is ahead on its path, the ego included (IDM), but only if nearer than in the certified execution at the same place;
- the weakest of a few brakings that keeps it clear of where the ego will be if it goes on as it does, and behind what the order
  of events lets it do;
- the order itself, without exception: see order.py.
"""

import numpy as np

from scenario_gen.closed_loop.certified import boxes_meet, fill_box, pose_at
from scenario_gen.closed_loop.order import keep_order, limit
from scenario_gen.numerics import Bools, exact, Floats
from scenario_gen.numerics.kernels import kernel

FORESEEN = 5.0  # seconds that a vehicle looks ahead
AHEAD = 60.0  # metres of its path that it looks along for who is ahead
LEVELS = 5  # brakings it can choose from, none among them
CREEP = 0.5  # m/s; the foresight lets everyone creep, so that nobody waits for one who waits for it
SLOW = 0.2  # m/s, certified speed below which a clock runs or stands, for there is nothing to brake
STAND = 0.02  # m/s, certified speed of a stand, which passes whatever there is
NEARER = 0.1  # metres by which a gap must be smaller than the certified one to be minded
LATE = 0.05  # seconds by which the ego's clock is uncertain
HARDER = 1.0  # m/s² by which an ego on its witness' path must brake harder than that one to be foreseen to go on so
ENTRY = 3.0  # metres ahead of and behind its place that the ego must leave free for one who comes onto the scene


@kernel(inline=True)
def _going_on(r: float, v: float, a: float, taking_up: float, h: float) -> float:
    """Rate after a step with nothing in the way: back to 1, with the given acceleration at most."""
    if v < SLOW:
        return 1.0
    return min(r + max((taking_up - r * r * a) / v, 0.0) * h, 1.0)


@kernel(inline=True)
def _rate(r: float, v: float, a: float, braking: float, taking_up: float, h: float) -> float:
    """Rate after a step of braking [m/s²]; at rate r the speed is r v, and its change v dr/dt + r² a."""
    on = _going_on(r, v, a, taking_up, h)
    if braking <= 0.0:
        return on
    if v < SLOW:
        return 1.0 if v < STAND else 0.0
    return min(max(r + (-braking - r * r * a) / v * h, 0.0), on)


@kernel(inline=True)
def _gap(cells: Floats, cell: float, clock: float, box: Floats, here: Floats) -> tuple[float, int]:
    """Way [m] that a vehicle can drive on its path (K, 8) until it meets a box, and the cell of its clock there.

    Infinity and -1 if it does not within AHEAD, or if the box lies behind it; `here` is its pose (5,).
    """
    count = cells.shape[0]
    first = min(int(clock / cell), count - 1)
    after = cells[first + 1, 7] if first + 1 < count else cells[first, 7]
    start = cells[first, 7] + (after - cells[first, 7]) * min(clock / cell - first, 1.0)
    for k in range(first, count):
        if cells[k, 7] - start > AHEAD:
            break
        if boxes_meet(cells[k], box):
            c, s = cells[first, 2], cells[first, 3]
            if (box[0] - here[0]) * c + (box[1] - here[1]) * s <= 0.0:
                break
            return float(max(cells[k, 7] - start, 0.0)), k
    return np.inf, -1


@kernel(inline=True)
def _idm(gap: float, u: float, ahead: float, driving: Floats) -> float:
    """Braking [m/s²] behind one at `gap` [m] whose speed along the path is `ahead` [m/s]; none where the gap is wide enough.

    Source: intelligent driver model, Treiber, Hennecke & Helbing 2000; its braking term, for the free one is the certificate.
    """
    headway, standstill, a, b = driving[0], driving[1], driving[2], driving[3]
    wanted = standstill + max(0.0, u * headway + u * (u - ahead) / (2.0 * np.sqrt(a * b)))
    share = wanted / max(gap, 0.1)
    return float(min(max(a * (share * share - 1.0), 0.0), b))


@kernel(inline=True)
def react(  # noqa: PLR0912, PLR0915 - one loop after the other
    h: float,
    time: Floats,
    motion: Floats,
    half: Floats,
    spans: Floats,
    leaves: Bools,
    cells: Floats,
    cell: float,
    order: Floats,
    ego: int,
    body: Floats,
    witness: Floats,
    yields: bool,
    driving: Floats,
    clock: Floats,
    rate: Floats,
    new_clock: Floats,
    new_rate: Floats,
    forced: Floats,
) -> None:
    """Write clocks and rates of all vehicles one step later; those of the ego stay as they are.

    Args:
        h: step [s].
        time: (T,) of the scenario [s].
        motion: (N, T, 6) as in `Certified`.
        half: (N, 2) half lengths and widths [m].
        spans: (N, 2) as in `Certified`.
        leaves: (N,) as in `Certified`.
        cells: (N, K, 8) as in `Certified`.
        cell: length of a cell [s].
        order: (N, N, K) as in `Certified`.
        ego: index of the ego's witness.
        body: (6,) the ego at the end of this step, as in `EgoState`.
        witness: (3,) clock of the ego on its witness' path [s], its rate, and 1 if it is on that path.
        yields: whether the others wait for the ego where the template did.
        driving: (5,) headway [s], standstill gap [m], acceleration, comfortable and strongest braking [m/s²].
        clock: (N,) seconds.
        rate: (N,) rates of the clocks.
        new_clock: (N,) likewise, one step later.
        new_rate: (N,) likewise.
        forced: (N,) above 0 where the order stopped a vehicle at once.
    """
    n = clock.shape[0]
    steps = int(np.ceil(FORESEEN / h))
    future = np.empty((steps + 1, 7))
    _foresee_ego(h, time, motion[ego], half[ego], body, witness, future)
    box, pose, other, same = np.empty(7), np.empty((n, 5)), np.empty(7), np.empty(5)
    fill_box(body[0], body[1], body[2], half[ego, 0], half[ego, 1], box)
    coming = np.empty((n, steps + 1))
    level = np.zeros(n)
    goes, here = np.empty(n, dtype=np.bool_), np.empty(n, dtype=np.bool_)  # whose clock runs; who is on the scene
    for i in range(n):
        goes[i] = not (leaves[i] and clock[i] >= spans[i, 1])
        here[i] = goes[i] and clock[i] >= spans[i, 0]
        new_clock[i], new_rate[i], forced[i] = clock[i], rate[i], 0.0
        pose_at(time, motion[i], clock[i], pose[i])
    for i in range(n):  # with regard to the ego alone
        if i == ego or not goes[i]:
            continue
        if not here[i]:  # it comes when it is due, unless the ego is in its place
            new_rate[i] = 1.0
            if clock[i] + 0.5 * (rate[i] + 1.0) * h >= spans[i, 0]:
                pose_at(time, motion[i], spans[i, 0], same)
                fill_box(same[0], same[1], same[2], half[i, 0] + ENTRY, half[i, 1], other)
                if boxes_meet(other, box):
                    new_rate[i] = 0.0
            continue
        v, a, u = pose[i, 3], pose[i, 4], rate[i] * pose[i, 3]
        least = _minded(time, motion, half, cells, cell, i, ego, clock[i], u, pose[i], box, body[2], body[3], h, driving)
        level[i] = _weakest(
            h, time, motion, half, cell, order, i, ego, clock, rate, least, future, witness, yields, coming, False, driving
        )
        new_rate[i] = _rate(rate[i], v, a, level[i], driving[2], h)
    for i in range(n):
        for m in range(steps + 1):
            if m == 0:
                coming[i, 0] = clock[i]
                r = rate[i]
            else:
                after = min(max(rate[i] + (new_rate[i] - rate[i]) * m, 0.0), 1.0) if goes[i] else 1.0
                coming[i, m] = coming[i, m - 1] + 0.5 * (r + after) * h
                r = after
    if n > 2:
        for i in range(n):  # and to each other
            if i == ego or not here[i]:
                continue
            v, a, u, least = pose[i, 3], pose[i, 4], rate[i] * pose[i, 3], level[i]
            for j in range(n):
                if j not in (i, ego) and here[j] and clock[j] < clock[i]:
                    fill_box(pose[j, 0], pose[j, 1], pose[j, 2], half[j, 0], half[j, 1], other)
                    speed = rate[j] * pose[j, 3]
                    braking = _minded(
                        time, motion, half, cells, cell, i, j, clock[i], u, pose[i], other, pose[j, 2], speed, 0.0, driving
                    )
                    least = max(least, braking)
            least = _weakest(
                h, time, motion, half, cell, order, i, ego, clock, rate, least, future, witness, yields, coming, True, driving
            )
            if least > level[i]:
                slower = _rate(rate[i], v, a, least, driving[2], h)
                same[0] = min(CREEP / v, 1.0) if v > CREEP else 1.0
                new_rate[i] = min(new_rate[i], max(slower, same[0]))
    for i in range(n):
        if i != ego and goes[i]:
            new_clock[i] = clock[i] + 0.5 * (rate[i] + new_rate[i]) * h
            if not here[i] and new_rate[i] == 0.0:
                new_clock[i] = clock[i]
    keep_order(h, cell, order, ego, goes, clock, rate, new_clock, new_rate, forced)
    for i in range(n):
        if i != ego and goes[i]:
            new_clock[i] = min(new_clock[i], time[-1])


@kernel(inline=True)
def _foresee_ego(h: float, time: Floats, motion: Floats, half: Floats, body: Floats, witness: Floats, out: Floats) -> None:
    """Fill `out` (M, 7) with the ego's boxes at the end of this step and of the following ones.

    On its witness' path it goes on as the witness did, at its own rate; else straight on. If it brakes, on that path harder than
    the witness, it goes on braking.
    """
    pose = np.empty(5)
    c, s = np.empty(7), body[3]
    fill_box(body[0], body[1], body[2], half[0], half[1], c)
    usual = 0.0  # the witness' own braking there, in the step that is over and after it
    for back in range(3):
        pose_at(time, motion, witness[0] - (1.0 - 0.5 * back) * h * witness[1], pose)
        usual = min(usual, pose[4])
    on_path = witness[2] > 0.0
    keeps = on_path and body[5] > witness[1] * witness[1] * usual - HARDER
    braking, way, clock = max(-body[5], 0.0), 0.0, witness[0]
    out[0] = c
    for m in range(1, out.shape[0]):
        after = max(s - braking * h, 0.0)
        moved = 0.5 * (s + after) * h if after > 0.0 or braking == 0.0 else 0.5 * s * s / braking
        s = after
        if on_path:
            clock += witness[1] * h if keeps else min(moved / max(pose[3], SLOW), h)
            pose_at(time, motion, clock, pose)
            fill_box(pose[0], pose[1], pose[2], half[0], half[1], out[m])
        else:
            way += moved
            out[m] = c
            out[m, 0], out[m, 1] = body[0] + way * c[2], body[1] + way * c[3]


@kernel(inline=True)
def _minded(
    time: Floats,
    motion: Floats,
    half: Floats,
    cells: Floats,
    cell: float,
    i: int,
    j: int,
    clock: float,
    u: float,
    pose: Floats,
    box: Floats,
    yaw: float,
    speed: float,
    later: float,
    driving: Floats,
) -> float:
    """Braking [m/s²] of vehicle i, at speed u [m/s], for j, whose box, yaw and speed are given, if it is on its path.

    None if j is no nearer than in the certified execution at the same clock; `later` [s] than that of i is what is given of j.
    """
    gap, at = _gap(cells[i], cell, clock, box, pose)
    if at < 0:
        return 0.0
    ahead = speed * max(exact.cos(yaw) * cells[i, at, 2] + exact.sin(yaw) * cells[i, at, 3], 0.0)
    braking = _idm(gap, u, ahead, driving)
    if braking <= 0.0:
        return 0.0
    certain, there = np.empty(5), np.empty(7)
    pose_at(time, motion[j], clock + later, certain)
    fill_box(certain[0], certain[1], certain[2], half[j, 0], half[j, 1], there)
    usual, _ = _gap(cells[i], cell, clock, there, pose)
    return braking if gap < usual - NEARER else 0.0


@kernel(inline=True)
def _weakest(
    h: float,
    time: Floats,
    motion: Floats,
    half: Floats,
    cell: float,
    order: Floats,
    i: int,
    ego: int,
    clock: Floats,
    rate: Floats,
    least: float,
    future: Floats,
    witness: Floats,
    yields: bool,
    coming: Floats,
    others: bool,
    driving: Floats,
) -> float:
    """The weakest braking [m/s²], `least` or more, with which vehicle i meets nothing that it foresees; the strongest if none."""
    comfortable, strongest = driving[3], driving[4]
    for k in range(LEVELS):
        if k == 0:
            braking = least
        elif k <= 2:
            braking = 0.5 * k * comfortable
        else:
            braking = comfortable + (strongest - comfortable) * (k - 2) / (LEVELS - 3)
        if braking < least:
            continue
        if _clear(
            h, time, motion, half, cell, order, i, ego, clock, rate, braking, future, witness, yields, coming, others, driving
        ):
            return braking
    return float(max(strongest, least))


@kernel(inline=True)
def _clear(
    h: float,
    time: Floats,
    motion: Floats,
    half: Floats,
    cell: float,
    order: Floats,
    i: int,
    ego: int,
    clock: Floats,
    rate: Floats,
    braking: float,
    future: Floats,
    witness: Floats,
    yields: bool,
    coming: Floats,
    others: bool,
    driving: Floats,
) -> bool:
    """Whether vehicle i, braking so, stays clear of the ego ahead of it, and keeps to what the order is foreseen to let it do."""
    pose, box = np.empty(5), np.empty(7)
    t, r = clock[i], rate[i]
    pose_at(time, motion[i], t, pose)
    for m in range(future.shape[0] - 1):
        after = _rate(r, pose[3], pose[4], braking, driving[2], h)
        t += 0.5 * (r + after) * h
        r = after
        pose_at(time, motion[i], t, pose)
        fill_box(pose[0], pose[1], pose[2], half[i, 0], half[i, 1], box)
        if boxes_meet(box, future[m]) and (future[m, 0] - box[0]) * box[2] + (future[m, 1] - box[1]) * box[3] > 0.0:
            return False
        if yields and witness[2] > 0.0 and t > limit(order[i, ego], cell, witness[0] + witness[1] * m * h) + LATE:
            return False
        if others:
            for j in range(coming.shape[0]):
                if j not in (i, ego) and t > limit(order[i, j], cell, coming[j, m + 1]) + 1e-09:
                    return False
        if braking > 0.0 and r == 0.0:
            return True
    return True

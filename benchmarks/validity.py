# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Throughput of the checker and of the conflict finder, CPU time of one core; published scenarios checked again independently."""

from collections.abc import Callable
from time import process_time

import numpy as np

from benchmarks._recheck import recheck_published
from benchmarks._size import sized
from benchmarks.row import higher, lower, Row
from scenario_gen.method.validity import Checker
from scenario_gen.numerics.arrays import Floats
from scenario_gen.situation import find_conflicts, Wait
from scenario_gen.types import Motion, Vehicle
from scenario_gen.types.road import Road
from scenario_gen.types.scenario import BoundaryStates, Scenario

Drive = tuple[float, float, float, float]  # x [m], y [m], yaw [rad], speed [m/s]

CASES: dict[str, tuple[Drive, ...]] = {
    "opposite directions": ((-90, -1.75, 0, 9), (90, 1.75, np.pi, 9)),
    "crossing": ((-90, -1.75, 0, 7.5), (1.75, -90, np.pi / 2, 4.5)),
    "following": ((-90, -1.75, 0, 7), (-78, -1.75, 0, 7.2)),
}
PLATOONS: tuple[Drive, ...] = tuple((13.0 * i - 90, -1.75, 0, 4) for i in range(4)) + tuple(
    (90 - 13.0 * i, 1.75, np.pi, 4) for i in range(4)
)


def run(count: int = sized(1000, quick=4)) -> list[Row]:
    """Measure; `count` published scenarios of recorded encounters are re-checked (100,000 take some 15 min of CPU time)."""
    rows = []
    for name, drives in CASES.items():
        rate = 1.0 / _seconds_per_check(drives, 201)
        rows.append(higher(f"two vehicles, 20 s, T = 201, {name}", rate, "1/s", 4000.0))
    base = _seconds_per_check(CASES["opposite directions"], 201)
    longer = _seconds_per_check(CASES["opposite directions"], 801) / base
    rows.append(lower("cost of four times the samples (20 s, T = 801)", longer, "×", 4.0))
    more = _seconds_per_check(PLATOONS, 201) / base
    rows.append(lower("cost of four times the vehicles (two platoons of four)", more, "×", 16.0))
    time, position, heading = _motion(PLATOONS[::2], 401)
    vehicles = tuple(Vehicle(str(i)) for i in range(4))
    conflict = _seconds(
        lambda: find_conflicts(Motion(vehicles, time, position, heading, np.zeros_like(heading)))
    )
    rows.append(lower("find_conflicts, four vehicles, T = 401", 1e3 * conflict, "ms", 10.0))
    return rows + _rechecked(count)


def _rechecked(count: int) -> list[Row]:
    """What an independent checker finds in published scenarios."""
    account, planned = recheck_published(count)
    if not account.scenarios:
        return [higher("scenarios re-checked independently", 0.0, "", 1.0, "no recorded data")]
    wrong, moving = account.found.pop("passing_order", 0), account.found.pop("stop_not_kept", 0)
    causes = ", ".join(f"{n} × {cause}" for cause, n in account.found.most_common())
    size = (
        f"{planned} encounters × roads, {account.vehicles} vehicles, {account.instants} instants"
    )
    orders = f"{account.orders} orders, {account.ties} ties, {account.absent} without a conflict"
    return [
        higher("scenarios re-checked independently", account.scenarios, "", count, size),
        lower("violations found by the re-check", account.found.total(), "", 0.0, causes),
        lower("wrong passing orders", wrong, "", 0.0, orders),
        lower("moving waits", moving, "", 0.0, f"{account.waits} waits"),
    ]


def _motion(drives: tuple[Drive, ...], samples: int) -> tuple[Floats, Floats, Floats]:
    time = np.linspace(0.0, 20.0, samples)
    x, y, yaw, speed = (np.array(column)[:, None] for column in zip(*drives, strict=True))
    position = np.stack((x + speed * np.cos(yaw) * time, y + speed * np.sin(yaw) * time), axis=-1)
    return time, position, np.broadcast_to(yaw, (len(drives), samples)).copy()


def _seconds_per_check(drives: tuple[Drive, ...], samples: int) -> float:
    """CPU seconds per valid scenario; everything is checked: road, asked states, conflicts, waits, limits."""
    time, position, heading = _motion(drives, samples)
    speed = np.repeat([[drive[3]] for drive in drives], samples, axis=1)
    vehicles = tuple(Vehicle(str(i)) for i in range(len(drives)))
    scenario = Scenario(vehicles, time, position, heading, speed, np.zeros_like(speed))
    start, end = (np.column_stack((position[:, k], heading[:, k], speed[:, k])) for k in (0, -1))
    waits: tuple[Wait, ...] = ()
    checker = Checker(
        _t_intersection(),
        BoundaryStates(start, end),
        find_conflicts(Motion(vehicles, time, position, heading, np.zeros_like(heading))),
        waits,
    )
    (verdict,) = checker.check([scenario])
    if not verdict.valid:
        raise RuntimeError(f"the measured scenario must be valid: {verdict.violations}")
    batch = [scenario] * 200
    return _seconds(lambda: checker.check(batch)) / len(batch)


def _seconds(work: Callable[[], object]) -> float:
    """CPU seconds of one call: the best of five rounds of at least 50 ms."""
    best, calls = np.inf, 1
    for _ in range(sized(5, quick=1)):
        started, done = process_time(), 0
        while process_time() - started < 0.05:
            for _ in range(calls):
                work()
            done += calls
        best = min(best, (process_time() - started) / done)
    return float(best)


def _t_intersection() -> Road:
    drivable = np.zeros((1000, 1000), dtype=np.bool_)
    drivable[482:518] = True
    drivable[:500, 482:518] = True
    origin, none = np.array((-100.0, -100.0)), np.empty((0, 3))
    return Road("T, 0.2 m cells", drivable, 0.2, origin, none, none)

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Small scenarios written down, for what only looks at their form."""

import numpy as np

from scenario_gen.logs import LogConfig, read_raw
from scenario_gen.output.exchange.cases import Case, Exported
from scenario_gen.output.exchange.lanes import LaneMap
from scenario_gen.types import Vehicle
from scenario_gen.types.lanes import Lane, LaneNetwork
from scenario_gen.types.scenario import Scenario


def moving(rows, *, vehicles=None, step=0.1, count=61, present=None, index=0):
    """Vehicles that drive straight on or in a circle: rows of x, y, yaw, speed, acceleration, yaw rate."""
    t = np.arange(count) * step
    rows = np.array(rows, dtype=float)
    speed = np.maximum(rows[:, 3:4] + rows[:, 4:5] * t, 0.0)
    heading = rows[:, 2:3] + rows[:, 5:6] * t
    fine = np.linspace(0.0, t[-1], 50 * (count - 1) + 1)
    v = np.maximum(rows[:, 3:4] + rows[:, 4:5] * fine, 0.0)
    h = rows[:, 2:3] + rows[:, 5:6] * fine
    steps = np.diff(fine)
    way = [
        np.cumsum(0.5 * steps * (f[:, 1:] + f[:, :-1]), axis=1)
        for f in (v * np.cos(h), v * np.sin(h))
    ]
    place = (
        np.stack(
            [np.concatenate([np.zeros((len(rows), 1)), w], axis=1)[:, ::50] for w in way], axis=-1
        )
        + rows[:, None, :2]
    )
    names = vehicles or [
        Vehicle(str(n + 1), 4.8 - 0.3 * n, 1.9 - 0.05 * n) for n in range(len(rows))
    ]
    more = {} if present is None else {"present": np.array(present)}
    return Scenario(
        tuple(names),
        t,
        place,
        heading,
        speed,
        np.repeat(rows[:, 4:5], count, axis=1),
        index=index,
        **more,
    )


def observed(path):
    """What is read of a file of others: the raw log."""
    return read_raw([path], LogConfig())


def crossing(present=None, index=0):
    """One drives east and brakes, one comes from the south in a bend."""
    return moving(
        [[-30.0, 1.0, 0.1, 9.0, -0.7, 0.02], [5.0, -40.0, 1.5, 6.0, 0.4, -0.05]],
        present=present,
        index=index,
    )


def one_vehicle():
    """One alone, 0.1 s longer than the others."""
    return moving(
        [[0.0, 30.0, -1.2, 7.0, 0.2, 0.04]], vehicles=[Vehicle("ego", 5.1, 2.0)], count=62
    )


def case_of(scenario, ego=None, lane_map=None):
    one = Exported(3, 7, "ab" * 32, scenario, ego)
    border = np.array([[-100.0, 100.0], [200.0, 100.0]])
    network = LaneNetwork("wide", (Lane("1", border, border - (0.0, 200.0)),))
    lanes = lane_map or LaneMap(network, "wide")
    return Case(1, "/case_1", "some road", 1_767_225_600 * 10**9, (one,), lanes), one

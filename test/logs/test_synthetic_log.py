# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The bundled log: the paper's three cases (V-A, Fig. 3), named synthetic, read back to what was driven.

a: one vehicle waits at the side road; the other brakes, stands and turns right. b: one slows down for an oncoming vehicle and turns
left. c: two in opposite directions change their speeds.
"""

from typing import NamedTuple

import numpy as np
import pytest

from scenario_gen.logs import LogConfig, read_log
from scenario_gen.logs.synthetic import bundled, CASES, DRAWN, RECORDED
from scenario_gen.situation import find_waits

START_NS = 1_767_225_600 * 10**9  # 2026-01-01 00:00:00 UTC


class Drive(NamedTuple):
    """Where a vehicle begins, its speed between changepoints, and how far it turns to the left."""

    place: tuple[float, float]  # m
    heading: float  # rad
    seconds: tuple[float, ...]
    speeds: tuple[float, ...]  # m/s
    turn_deg: float = 0.0


DRIVES = {
    "a": (
        Drive((1.75, -9.0), 0.5 * np.pi, (0.0, 18.0), (0.0, 0.0)),
        Drive((-50.25, -1.75), 0.0, (0.0, 7.0, 10.0, 18.0), (11.0, 0.0, 0.0, 5.6), -90.0),
    ),
    "b": (
        Drive((-36.0, -1.75), 0.0, (0.0, 15.0), (5.0, 11.75)),
        Drive((60.25, 1.75), np.pi, (0.0, 7.0, 15.0), (10.5, 3.5, 7.5), 90.0),
    ),
    "c": (
        Drive((-46.0, -1.75), 0.0, (0.0, 4.0, 8.0, 12.0, 16.0), (8.0, 8.0, 3.0, 3.0, 9.0)),
        Drive((47.0, 1.75), np.pi, (0.0, 4.0, 8.0, 12.0, 16.0), (4.0, 4.0, 8.0, 8.0, 4.0)),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_reading_recovers_the_truth(case):
    result = read_log(bundled(case), LogConfig(origin="42.3,-83.7"))
    (encounter,) = result.encounters
    assert encounter.name == f"synthetic_{case}"
    assert "synthetic" in (bundled(case) / "metadata.yaml").read_text()
    assert encounter.duration > DRIVES[case][0].seconds[-1] - 0.35
    time = (encounter.start_ns - START_NS) * 1e-9 + encounter.time
    for n, drive in enumerate(DRIVES[case]):
        speed = np.interp(time, drive.seconds, drive.speeds)
        assert np.sqrt(((encounter.speed[n] - speed) ** 2).mean()) < 0.12
        assert np.abs(encounter.speed[n] - speed).max() < 0.45
        way = np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * encounter.dt)))
        direction = np.array([np.cos(drive.heading), np.sin(drive.heading)])
        place = drive.place + (way + time[0] * drive.speeds[0])[:, None] * direction
        is_straight = way < 35.0  # the turns begin after 40 m and more
        error = np.hypot(*(encounter.position[n] - place).T)
        assert error[is_straight].max() < 1.0  # GPS noise of 0.3 m per axis that lasts for 20 s
        off = np.angle(np.exp(1j * (encounter.heading[n] - drive.heading)))
        assert np.abs(off[is_straight]).max() < 0.16
        assert abs(off[-1] - np.radians(drive.turn_deg)) < 0.16
    assert not result.quality.encounters[0].overlaps
    reasons = {drop.reason for drop in result.quality.dropped}
    assert reasons == {"stamp repeated"}
    assert all(vehicle.bridged > 3 for vehicle in result.quality.vehicles)
    if case == "a":
        waits = find_waits(encounter)
        assert [wait.vehicle for wait in waits] == [0, 1]
        assert waits[1].start == pytest.approx(7.0, abs=0.6)
        assert waits[1].end == pytest.approx(10.0, abs=0.8)


def test_unknown_case_lists_the_known():
    with pytest.raises(ValueError, match="nothing") as refused:
        bundled("nothing")
    assert all(name in str(refused.value) for name in (*RECORDED, *CASES, *DRAWN))

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The bundled log: made up, believable, and read back to its ground truth."""

import numpy as np
import pytest
from support.synthetic_cases import make_case, ORIGIN, START_NS

from scenario_gen.logs import LogConfig, read_log
from scenario_gen.logs.synthetic import bundled, CASES, DRAWN, RECORDED
from scenario_gen.situation import find_waits


@pytest.fixture(params=CASES)
def case(request):
    return make_case(request.param)


def test_reading_recovers_the_truth(case):
    result = read_log(bundled(case.name[-1]), LogConfig(origin=f"{ORIGIN[0]},{ORIGIN[1]}"))
    (encounter,) = result.encounters
    assert encounter.name == case.name
    assert "synthetic" in (bundled(case.name[-1]) / "metadata.yaml").read_text()
    assert encounter.duration > case.duration - 0.35
    time = (encounter.start_ns - START_NS) * 1e-9 + encounter.time
    for n, drive in enumerate(case.drives):
        truth = drive.state(time)
        error = np.hypot(*(encounter.position[n] - truth[:, :2]).T)
        assert error.max() < 1.0  # GPS noise of 0.3 m per axis that lasts for 20 s
        assert np.sqrt(((encounter.speed[n] - truth[:, 3]) ** 2).mean()) < 0.12
        assert np.abs(encounter.speed[n] - truth[:, 3]).max() < 0.45
        off = np.angle(np.exp(1j * (encounter.heading[n] - truth[:, 2])))
        assert np.abs(off).max() < 0.16
    assert not result.quality.encounters[0].overlaps
    reasons = {drop.reason for drop in result.quality.dropped}
    assert reasons == {"stamp repeated"}
    assert all(vehicle.bridged > 3 for vehicle in result.quality.vehicles)
    if case.name == "synthetic_a":
        waits = find_waits(encounter)
        assert [wait.vehicle for wait in waits] == [0, 1]
        assert waits[1].start == pytest.approx(7.0, abs=0.6)
        assert waits[1].end == pytest.approx(10.0, abs=0.8)


def test_unknown_case_lists_the_known():
    with pytest.raises(ValueError, match="nothing") as refused:
        bundled("nothing")
    assert all(name in str(refused.value) for name in (*RECORDED, *CASES, *DRAWN))

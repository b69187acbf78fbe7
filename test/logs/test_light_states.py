# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""States of traffic lights in logs: what they show, where they stop traffic, and bad input."""

import numpy as np
import pytest
from support.signalised import crossing_map, signalised

from scenario_gen import read_log
from scenario_gen.base.errors import InputError
from scenario_gen.logs.signals import sampled_schedule
from scenario_gen.types import SignalSchedule


def test_table_with_states():
    (encounter,) = read_log(signalised(green=13.0)).encounters
    lights = {light.id: light for light in encounter.lights}
    assert set(lights) == {"A", "B"}
    at = encounter.start_ns * 1e-9
    assert [lights["B"].schedule.at(t - at) for t in (9.0, 12.95, 13.05)] == [
        "red",
        "red",
        "green",
    ]
    assert lights["B"].schedule.at(60.0) == "unknown"  # nobody saw it
    assert np.abs(lights["B"].line[:, 1] + 8.0).max() < 0.7  # a period of the fastest vehicle
    assert lights["B"].yaw == pytest.approx(np.pi / 2.0, abs=0.01)
    later = encounter.select([0, 1], 20)
    assert later.lights[1].schedule.at(11.05 - at) == lights["B"].schedule.at(13.05 - at)


def test_states_are_unknown_in_gaps():
    """But for 0.4 of the gap on either side of it, 2 s at most."""
    times = (0.0, 1.0, 2.0, 6.0, 7.0, 8.0, 18.0, 19.0)
    schedule = sampled_schedule(times, ["green"] * len(times), "light")
    for time in np.linspace(0.025, 19.025, 381):
        is_unknown = 3.6 < time < 4.4 or 10.0 < time < 16.0
        assert schedule.at(time) == ("unknown" if is_unknown else "green")


def test_commonroad_with_cycles(tmp_path):
    file = tmp_path / "map.xml"
    file.write_text(crossing_map(["green:80 yellow:30 red:290", "red:130 green:270"]))
    (encounter,) = read_log(file).encounters
    lights = {light.id: light.schedule for light in encounter.lights}
    start = encounter.start_ns * 1e-9
    cycle = SignalSchedule.cycle((8.0, 3.0, 29.0), ("green", "yellow", "red"))
    for time in np.linspace(0.01, 120.0, 100):
        assert lights["11"].at(time - start) == cycle.at(time)
    assert encounter.lights[0].lanes == ("1",)
    file.write_text(file.read_text().replace('<trafficLightRef ref="11"/>', ""))
    notes = read_log(file).quality.notes
    assert "traffic lights without a lane are left out: 11" in notes


@pytest.mark.parametrize(
    ("cycles", "words"),
    [
        (["green:200 red:200", "green:200 red:200"], "traffic light 12 and 11 are both green"),
        (["green:200 blue:200", "red:9"], "signal state 'blue'"),
        (["green:0 red:9", "red:9"], "traffic light 11: its phases do not follow each other"),
    ],
)
def test_contradictions_name_file_and_light(tmp_path, cycles, words):
    file = tmp_path / "map.xml"
    file.write_text(crossing_map(cycles))
    with pytest.raises(InputError) as error:
        read_log(file)
    assert words in str(error.value) and str(file) in str(error.value)
    assert "\n" not in str(error.value)
    assert read_log(file, {"signals": "ignored"}).encounters[0].lights == ()


def test_signal_tables_with_contradictions_are_refused(tmp_path):
    table = signalised(queue=2)
    table.loc[(table.vehicle == "3") & (table.time < 9.0), "signal"] = "green"
    with pytest.raises(InputError, match=r"traffic light B is (red|green) and"):
        read_log(table)
    table = signalised()
    table.loc[table.vehicle == "1", ["signal", "signal_id"]] = "blue", "A"
    table.loc[table.vehicle == "2", ["signal", "signal_id"]] = "red", "B"
    result = read_log(table)
    assert result.encounters[0].lights == ()
    notes = "; ".join(result.quality.notes)
    assert "unknown signal states are left out: blue" in notes
    assert "no vehicle passes traffic lights B" in notes

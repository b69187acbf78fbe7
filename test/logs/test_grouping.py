# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Who belongs to an encounter, and for how long."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pandas as pd
import pytest
from support.log_builders import save

from scenario_gen.base.errors import InputError
from scenario_gen.logs import LogConfig, read_log
from scenario_gen.situation import Situation
from scenario_gen.situation.kind import EncounterKind


def car(name, begin, end, x, y, vx=0.0, vy=0.0):
    """A car with constant velocity from `begin` to `end` [s]; (x, y) is where it is at 0 s."""
    time = np.round(np.arange(begin, end + 0.05, 0.1), 3)
    speed = float(np.hypot(vx, vy))
    return pd.DataFrame(
        {
            "t_s": time,
            "vehicle_id": name,
            "x_m": x + vx * time,
            "y_m": y + vy * time,
            "speed_mps": speed,
        }
    )


def groups(tmp_path, *cars, **options):
    result = read_log(save(pd.concat(cars), tmp_path), LogConfig(**options))
    return [
        (",".join(v.id for v in e.vehicles), round(e.duration, 1)) for e in result.encounters
    ], result.quality


def test_mostly_present_vehicle_shortens_the_encounter(tmp_path):
    cars = (car("1", 0, 10, 0, 0, 8), car("2", 0, 10, 0, 4, 8), car("3", 0, 7, 20, 0, 8))
    found, quality = groups(tmp_path, *cars, whole=True)
    assert found == [("1,2,3", 7.0)]
    assert quality.notes == ("vehicle 3 shortens its encounter to 7.0 of 10.0 s",)


def test_briefly_present_vehicle_is_left_out(tmp_path):
    cars = (car("1", 0, 20, 0, 0, 8), car("2", 0, 20, 0, 4, 8), car("3", 0, 4, 20, 0, 8))
    found, quality = groups(tmp_path, *cars, whole=True)
    assert found == [("1,2", 20.0)]
    assert quality.notes == ("vehicle 3 is in no encounter; it was recorded for 4.0 s",)


def presence(tmp_path, *cars, **options):
    result = read_log(save(pd.concat(cars), tmp_path), LogConfig(whole=False, **options))
    return [
        {v.id: tuple(row) for v, row in zip(e.vehicles, e.present.tolist(), strict=True)}
        for e in result.encounters
    ], result


def test_vehicles_may_arrive_late_leave_early(tmp_path):
    cars = (
        car("1", 0, 20, 0, 0, 8),
        car("2", 0, 20, 0, 4, 8),
        car("3", 8, 20, 20, 0, 8),
        car("4", 5, 9, 20, 4, 8),
    )
    (found,), result = presence(tmp_path, *cars)
    assert found == {"1": (0, 200), "2": (0, 200), "3": (80, 200), "4": (50, 90)}
    (encounter,) = result.encounters
    assert encounter.position[2, 80] == pytest.approx([84.0, 0.0], abs=0.1)
    assert (encounter.position[3, 91:] == encounter.position[3, 90]).all()
    assert any("vehicle 4 from 5.0 to 9.0 s" in line for line in result.quality.lines())


def test_vehicles_arrive_when_within_100_m(tmp_path):
    (found,), _ = presence(
        tmp_path, car("1", 0, 20, 0, 0, 8), car("2", 0, 20, 0, 4, 8), car("3", 0, 20, 250, 8, -8)
    )
    assert found["1"] == found["2"] == (0, 200)
    assert found["3"] == pytest.approx((94, 200), abs=2)  # 250 m at 16 m/s


def test_moment_at_edge_shortens_the_encounter(tmp_path):
    (found,), result = presence(
        tmp_path, car("1", 0, 20, 0, 0, 8), car("2", 0, 20, 0, 4, 8), car("3", 0.8, 20, 20, 0, 8)
    )
    assert set(found.values()) == {(0, 192)}
    assert not result.quality.notes


def test_nobody_is_left_out_in_silence(tmp_path):
    cars = [car(str(k), 0, 10, 12 * k, 0, 10) for k in range(4)] + [
        car("brief", 0, 2, 0, 4, 10),
        car("far", 0, 10, 9e3, 0, 1),
    ]
    _, result = presence(tmp_path, *cars)
    assert result.quality.notes == tuple(
        f"vehicle {name} is in no encounter; it was recorded for {seconds} s"
        for name, seconds in (("brief", "2.0"), ("far", "10.0"))
    )
    _, result = presence(tmp_path, *cars, max_vehicles=3)
    assert any(
        "left out of an encounter of 3 vehicles (max_vehicles)" in note
        for note in result.quality.notes
    )
    once = pd.DataFrame(
        {"t_s": [0.0], "vehicle_id": "once", "x_m": 0.0, "y_m": 0.0, "speed_mps": 1.0}
    )
    _, result = presence(tmp_path, *cars, once)
    assert "fewer than two usable positions: vehicle once" in result.quality.notes


@given(
    st.lists(
        st.tuples(st.integers(0, 8), st.integers(1, 20), st.integers(-60, 60)),
        min_size=2,
        max_size=6,
    )
)
@settings(max_examples=10)
def test_everybody_is_in_encounters_or_named(tmp_path_factory, cars):
    tracks = [
        car(f"v{k}", begin, begin + lasts, x - 8 * begin, 3.5 * k, 8)
        for k, (begin, lasts, x) in enumerate(cars)
    ]
    try:
        _, result = presence(tmp_path_factory.mktemp("log"), *tracks)
    except InputError:
        return  # nobody meets
    inside = {vehicle.id for encounter in result.encounters for vehicle in encounter.vehicles}
    said = " ".join(result.quality.notes)
    assert all(f"v{k}" in inside or f"v{k}" in said for k in range(len(cars)))
    for encounter in result.encounters:
        assert (np.diff(encounter.present, axis=1) * encounter.dt >= 3.0).all()


def test_proximity_bounds_the_encounter(tmp_path):
    found, _ = groups(tmp_path, car("1", 0, 40, -150, 0, 10), car("2", 0, 40, 150, 4, -10))
    ((name, seconds),) = found
    assert name == "1,2"
    assert seconds == pytest.approx(10.0, abs=0.25)  # nearer than 100 m from 10 s to 20 s


def test_chain_of_neighbours_is_one_encounter(tmp_path):
    found, _ = groups(tmp_path, *(car(str(k), 0, 10, 60 * k, 0, 10) for k in range(4)))
    assert found == [("0,1,2,3", 10.0)]  # the ends are 180 m apart


def test_parked_cars_are_no_encounter(tmp_path):
    with pytest.raises(InputError, match="while one drives 5 m"):
        groups(tmp_path, car("1", 0, 20, 0, 0), car("2", 0, 20, 10, 0))


def test_a_long_standstill_ends_an_encounter(tmp_path):
    drive, stand = car("1", 0, 10, -80, 0, 8), car("1", 10.1, 40, 0, 0)
    again = car("1", 40.1, 50, -320.8, 0, 8)
    found, _ = groups(tmp_path, drive, stand, again, car("2", 0, 50, 5, 5))
    assert [name for name, _ in found] == ["1,2", "1,2"]
    assert all(10.0 < seconds < 14.0 for _, seconds in found)  # two seconds of standing stay


def test_long_meetings_are_cut(tmp_path):
    found, _ = groups(
        tmp_path,
        car("1", 0, 100, 0, 0, 8),
        car("2", 0, 100, 0, 4, 8),
        car("3", 0, 100, 0, 8, 8),
        max_duration=30.0,
    )
    assert {name for name, _ in found} == {"1,2,3"}
    assert all(seconds <= 30.0 for _, seconds in found)
    assert sum(seconds for _, seconds in found) > 95.0


def test_only_interacting_vehicles_meet_in_crowds(tmp_path):
    """Six cars: two pairs pass each other, a queue stands by; four at most in one encounter."""
    cars = [
        car("1", 0, 10, -40, 0, 8),
        car("2", 0, 10, 40, 3.5, -8),
        car("3", 0, 10, -40, 50, 8),
        car("4", 0, 10, 40, 53.5, -8),
        car("5", 0, 10, 0, 25),
        car("6", 0, 10, 8, 25),
    ]
    found, _ = groups(tmp_path, *cars, max_vehicles=4)
    assert found == [("1,2", 10.0), ("3,4", 10.0)]


def test_the_largest_group_is_a_parameter(tmp_path):
    cars = [car(str(k), 0, 10, 12 * k, 0, 10) for k in range(7)]
    found, _ = groups(tmp_path, *cars, max_vehicles=7)
    assert found == [("0,1,2,3,4,5,6", 10.0)]
    found, _ = groups(tmp_path, *cars, max_vehicles=2)
    assert all(len(name.split(",")) == 2 for name, _ in found)
    assert {"0,1", "1,2", "2,3", "3,4", "4,5", "5,6"} <= {name for name, _ in found}


def test_a_reversal_cuts_the_track(tmp_path):
    there, stand = car("1", 0, 10, -80, 0, 8), car("1", 10.1, 13, 0, 0)
    back = car("1", 13.1, 25, 104.8, 0, -8)
    found, quality = groups(tmp_path, there, stand, back, car("2", 0, 25, 5, 5))
    assert quality.vehicles[0].reversals == 1
    assert [name for name, _ in found] == ["1,2", "1,2"]


def test_column_of_13_is_several_encounters(tmp_path):
    found, _ = groups(tmp_path, *(car(str(k + 1), 0, 19.9, -66 * k, 0, 33) for k in range(13)))
    assert [names for names, _ in found] == [f"{k},{k + 1},{k + 2}" for k in range(1, 13, 2)]


def test_left_turn_with_far_oncoming_car(tmp_path):
    """The turner waits until the other one is 100 m away, and for longer."""
    time = np.round(np.arange(0.0, 60.05, 0.1), 3)
    driven = np.interp(time, [0, 5, 12, 18, 60], [0, 50, 50, 74, 494])  # waits from 5 to 12 s
    bend = np.clip((driven - 50.0) / 10.0, 0.0, np.pi / 2.0)  # radius 10 m
    straight = np.maximum(driven - 50.0 - 5.0 * np.pi, 0.0)
    turner = pd.DataFrame(
        {
            "t_s": time,
            "vehicle_id": "turner",
            "x_m": 2.0 - 10.0 * (1.0 - np.cos(bend)) - straight,
            "y_m": np.minimum(driven, 50.0) - 60.0 + 10.0 * np.sin(bend),
        }
    )
    oncoming = car("oncoming", 0, 60, -2, 60, 0, -14).drop(columns="speed_mps")
    ((spans,), result) = presence(tmp_path, turner, oncoming)
    (encounter,) = result.encounters
    assert encounter.duration < 30.0
    row = encounter.ids.index("turner")
    heading = encounter.heading[row, : spans["turner"][1] + 1]
    assert np.degrees(heading[-1] - heading[0]) == pytest.approx(90.0, abs=3.0)
    assert encounter.time[spans["oncoming"][1]] < 17.0
    assert Situation.of(encounter).kind(0, 1) == EncounterKind.LEFT_TURN


def test_only_vehicles_that_meet_are_smoothed(tmp_path, monkeypatch):
    near = car("1", 0, 10, 0, 0, 8), car("2", 0, 10, 0, 4, 8)
    found, quality = groups(tmp_path, *near, car("3", 0, 10, 0, 5000, 8))
    assert found == [("1,2", 10.0)]
    assert [vehicle.smoothed for vehicle in quality.vehicles] == [True, True, False]
    assert quality.notes == ("vehicle 3 is in no encounter; it was recorded for 10.0 s",)

    monkeypatch.delattr("scenario_gen.logs.encounters.smooth_piece")
    with pytest.raises(InputError, match=r"2 and 3 .* come as near as 4996 m"):
        groups(tmp_path, near[1], car("3", 0, 10, 0, 5000, 8))

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What cannot be true is dropped, counted and named; what cannot be repaired is refused."""

from dataclasses import replace
import re

from hypothesis import given, HealthCheck, settings
from hypothesis import strategies as st
import numpy as np
import pandas as pd
import pytest
from support.log_builders import crossing, geographic, save

from scenario_gen.base.errors import InputError
from scenario_gen.logs import LogConfig, NoEncounterError, read_log

PLAIN = LogConfig()


def drops(result):
    return {
        drop.reason: (drop.count, drop.first.rpartition(" ")[2]) for drop in result.quality.dropped
    }


def assert_close_to(result, rows, tmp_path, config=PLAIN, atol=0.3):
    """The damage leaves no trace beyond `atol` metres."""
    (clean,) = read_log(save(rows, tmp_path, "clean.csv"), config).encounters
    (encounter,) = result.encounters
    assert encounter.speed.shape == clean.speed.shape
    np.testing.assert_allclose(encounter.position, clean.position, atol=atol)


def test_nan_and_zero_fixes(tmp_path):
    good = geographic(crossing())
    rows = good.copy()
    rows.loc[40, "lat_deg"] = np.nan
    rows.loc[[60, 62], ["lat_deg", "lon_deg"]] = 0.0
    rows.loc[80, "speed_mps"] = np.nan
    rows.loc[82, "speed_mps"] = 163.8
    rows.loc[84, "speed_mps"] = -1.0
    rows.loc[86, "lat_deg"] = 300.0
    config = LogConfig(origin="48.0,11.0")
    result = read_log(save(rows, tmp_path), config)
    assert drops(result) == {
        "position is not a number": (1, "42"),
        "position is (0, 0)": (2, "62"),
        "position is not on Earth": (1, "88"),
        "speed is not a number": (1, "82"),
        "speed is negative": (1, "86"),
        "speed is above 70 m/s": (1, "84"),
    }
    assert_close_to(result, good, tmp_path, config)


def test_text_among_numbers(tmp_path):
    rows = crossing().astype(object)
    rows.loc[30, "x_m"] = "twelve"
    rows.loc[50, "t_s"] = "noon"
    rows.loc[52, "vehicle_id"] = ""
    result = read_log(save(rows, tmp_path))
    assert drops(result)["position is not a number"] == (1, "32")
    assert drops(result)["stamp is not a number"] == (1, "52")
    assert drops(result)["no vehicle"] == (1, "54")


def test_duplicates_and_disorder(tmp_path):
    good = crossing()
    rows = pd.concat([good, good.iloc[[30, 31, 50]]], ignore_index=True)
    order = np.arange(len(rows))
    order[[100, 140]] = order[[140, 100]]
    result = read_log(save(rows.iloc[order], tmp_path))
    assert drops(result)["stamp repeated"][0] == 3
    assert drops(result)["stamp out of order (sorted)"][0] >= 2
    assert_close_to(result, good, tmp_path, atol=1e-3)


def test_jumps(tmp_path):
    good = crossing()
    rows = good.copy()
    rows.loc[100, "x_m"] += 60.0
    rows.loc[[121, 123], "y_m"] -= 25.0
    result = read_log(save(rows, tmp_path))
    assert drops(result) == {"position jumps": (3, "102")}
    assert_close_to(result, good, tmp_path)


def test_lasting_jump_is_a_new_place(tmp_path):
    rows = crossing(seconds=24.0)
    rows.loc[(rows["vehicle_id"] == "a") & (rows["t_s"] > 1012.0), "y_m"] -= 45.0
    result = read_log(save(rows, tmp_path))
    assert len(result.encounters) == 2
    assert result.encounters[0].duration == pytest.approx(12.0, abs=0.2)
    assert not drops(result)


def test_gaps_are_bridged_or_cut(tmp_path):
    rows = crossing(seconds=24.0)
    time = rows["t_s"] - 1000.0
    a = rows["vehicle_id"] == "a"
    rows = rows[~(a & (((time > 4.05) & (time < 4.85)) | ((time > 10.05) & (time < 12.05))))]
    result = read_log(save(rows, tmp_path), LogConfig(proximity=500.0))
    vehicle = result.quality.vehicles[0]
    assert (vehicle.bridged, vehicle.cut) == (1, 1)
    assert vehicle.longest_bridged == pytest.approx(0.9)
    assert vehicle.longest_cut == pytest.approx(2.1)
    assert [round(encounter.duration, 1) for encounter in result.encounters] == [10.0, 11.9]
    bridged = read_log(save(rows, tmp_path), LogConfig(proximity=500.0, longest_gap=3.0))
    assert [round(encounter.duration, 1) for encounter in bridged.encounters] == [24.0]


def test_slow_source_is_not_cut_up(tmp_path):
    result = read_log(save(crossing(seconds=20.0, rate=1.0), tmp_path), LogConfig(proximity=500.0))
    (encounter,) = result.encounters
    assert encounter.duration == pytest.approx(20.0)
    np.testing.assert_allclose(encounter.position[0, :, 0], -40.0 + 8.0 * encounter.time, atol=0.3)


UNUSABLE = {
    "all NaN": lambda rows: rows.assign(x_m=np.nan),
    "one vehicle": lambda rows: rows[rows.vehicle_id == "a"],
    "clock stands": lambda rows: rows.assign(t_s=5.0),
    "far apart": lambda rows: rows.assign(x_m=rows.x_m + 500.0 * (rows.vehicle_id == "a")),
    "too short": lambda rows: rows.iloc[:40],
    "other times": lambda rows: rows.assign(t_s=rows.t_s + 100.0 * (rows.vehicle_id == "a")),
}


@pytest.mark.parametrize("damage", UNUSABLE.values(), ids=UNUSABLE)
def test_what_cannot_be_used_is_refused(tmp_path, damage):
    with pytest.raises(InputError, match="log"):
        read_log(save(damage(crossing()), tmp_path))


@pytest.mark.parametrize(
    ("config", "words"),
    [
        (LogConfig(vehicles="a,x"), "no vehicle 'x'; it has a, b"),
        (LogConfig(start=100.0), "only 12.0 s long"),
        (LogConfig(start=5.0, end=4.0), "must be after start"),
        (LogConfig(start=8.0, end=9.0), "no two vehicles"),
    ],
)
def test_parameters_that_leave_nothing(tmp_path, config, words):
    with pytest.raises(InputError, match=words):
        read_log(save(crossing(), tmp_path), config)


def test_strict_refuses_to_repair(tmp_path):
    rows = crossing()
    rows.loc[40, "x_m"] = np.nan
    path = save(rows, tmp_path)
    with pytest.raises(InputError, match=r"log\.csv, line 42: position is not a number"):
        read_log(path, LogConfig(strict=True))
    read_log(save(crossing(), tmp_path), LogConfig(strict=True))


@given(
    seed=st.integers(0, 2**32 - 1),
    noise=st.floats(0.0, 1.0),
    lost=st.floats(0.0, 0.4),
    repeated=st.floats(0.0, 0.3),
    outliers=st.integers(0, 10),
)
@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_whatever_the_damage_no_nan_leaves(tmp_path, seed, noise, lost, repeated, outliers):
    """Noise, losses, repeats, jitter, outliers and disorder: finite encounters near the truth, or a refusal."""
    rng = np.random.Generator(np.random.PCG64(seed))
    rows = crossing()
    rows = rows[rng.random(len(rows)) >= lost]
    rows = (
        pd.concat([rows, rows[rng.random(len(rows)) < repeated]])
        .sample(frac=1.0, random_state=seed)
        .sort_values("t_s")
    )
    rows["t_s"] += rng.normal(0.0, 0.02, len(rows))
    rows[["x_m", "y_m"]] += rng.normal(0.0, noise, (len(rows), 2))
    rows["speed_mps"] = np.maximum(rows["speed_mps"] * 1.02 + rng.normal(0.0, 0.2, len(rows)), 0.0)
    where = rng.integers(0, len(rows), outliers)
    rows.iloc[where, rows.columns.get_loc("x_m")] = rng.choice(
        [np.nan, 1e6, np.inf, -500.0], outliers
    )
    try:
        result = read_log(save(rows, tmp_path))
    except InputError:
        good = rows.drop(rows.index[where])
        longest = max(np.diff(np.sort(own)).max() for _, own in good.groupby("vehicle_id")["t_s"])
        assert (
            longest > 0.8
        )  # a gap above a second is cut; beside it a noisy fix on either side may go, 0.1 s each
        return
    for encounter in result.encounters:
        assert np.isfinite(encounter.position).all() and (encounter.speed >= 0.0).all()
        time = (encounter.start_ns * 1e-9 - 1000.0) + encounter.time
        error = encounter.position[0] - np.column_stack([-40.0 + 8.0 * time, np.zeros(len(time))])
        assert np.sqrt((error**2).sum(axis=1).mean()) < 0.5 + noise


@pytest.mark.parametrize(
    "config",
    [LogConfig(proximity=2.0), LogConfig(min_duration=30.0), LogConfig(travel=1000.0)],
    ids=["never near", "too short", "hardly driven"],
)
def test_missing_encounter_has_reason_and_remedy(tmp_path, config):
    path = save(crossing(), tmp_path)
    with pytest.raises(NoEncounterError) as error:
        read_log(path, config)
    name, value = re.search(r"--set log\.(\w+)=([\d.]+)", str(error.value)).groups()
    assert len(read_log(path, replace(config, **{name: float(value)})).encounters) == 1, (
        "what it says helps"
    )

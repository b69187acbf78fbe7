# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Public recordings: small files written to their definitions give the positions, speeds, headings and sizes that went in."""

import json
import math

import numpy as np
from pyarrow import parquet
import pytest
from support.recording_files import (
    argoverse2,
    commonroad,
    highd,
    ind,
    interaction,
    motion,
    nocturne,
    omega_prime,
    SIZES,
    tracked,
)

from scenario_gen.base.errors import InputError
from scenario_gen.logs import LogConfig, read_log

MADE = {
    f.__name__: f
    for f in (argoverse2, interaction, ind, highd, commonroad, nocturne, omega_prime, tracked)
}


@pytest.mark.parametrize("name", MADE)
def test_what_was_written_is_read(tmp_path, name):
    path, types = MADE[name](tmp_path)
    (encounter,) = read_log(path).encounters
    ids = [
        bytes([int(track)] * 16).hex() if name == "tracked" else track for track in (*SIZES, "9")
    ]
    assert [(vehicle.id, vehicle.type) for vehicle in encounter.vehicles] == list(
        zip(ids, types, strict=False)
    )
    if "pedestrian" in types:
        assert (encounter.vehicles[2].length, encounter.vehicles[2].width) == (0.5, 0.5)
    for n, track in enumerate(SIZES):
        vehicle = encounter.vehicles[n]
        says_sizes = name != "argoverse2" or track != "7"
        if says_sizes:  # otherwise those of its type
            assert (vehicle.length, vehicle.width) == pytest.approx(SIZES[track], abs=0.06)
        if name == "highd":
            sign = 1.0 if track == "7" else -1.0
            assert np.allclose(
                encounter.heading[n] % (2 * math.pi), 0.0 if sign > 0 else math.pi, atol=0.01
            )
            assert np.allclose(encounter.speed[n], 10.0, atol=0.1)
            assert abs(encounter.position[n, 5, 1] - (4.0 if track == "7" else 8.0)) < 0.1
            assert np.sign(encounter.position[n, -1, 0] - encounter.position[n, 0, 0]) == sign
            continue
        start = encounter.start_ns * 1e-9 - (0.1 if name == "interaction" else 0.0)
        x, y, vx, vy, heading = motion(track, start + encounter.time)
        assert np.abs(encounter.position[n] - np.column_stack((x, y))).max() < 0.1
        assert np.allclose(encounter.speed[n], math.hypot(vx, vy), atol=0.1)
        assert np.allclose(encounter.heading[n], heading, atol=0.05)


def test_what_is_missing_is_named(tmp_path):
    path, _ = ind(tmp_path)
    (tmp_path / "00_recordingMeta.csv").unlink()
    with pytest.raises(InputError, match=r"00_recordingMeta\.csv in the same folder"):
        read_log(path)
    with pytest.raises(InputError, match=r"lacks columns of INTERACTION: agent_type"):
        read_log(path, LogConfig(format="interaction"))


@pytest.mark.parametrize("column", ["position_x", "object_category"])
def test_a_repeated_column_is_named(tmp_path, column):
    path, _ = argoverse2(tmp_path)
    table = parquet.read_table(path)
    parquet.write_table(table.append_column(column, table.column(column)), path)
    with pytest.raises(InputError, match=rf"scenario_s1\.parquet has several columns '{column}'"):
        read_log(path)


def test_unknown_types_are_counted_or_omitted(tmp_path):
    folder, _ = interaction(tmp_path)
    tracks_file = folder / "vehicle_tracks_000.csv"
    tracks_file.write_text(
        tracks_file.read_text()
        + "98,1,100,tram,0,0,0,1,0,30,2.5\n99,1,100,hovercraft,0,0,0,1,0,30,2.5\n"
    )
    notes = read_log(folder).quality.notes
    assert "left out: 1 × tram" in notes
    assert "unknown types, guessed from the sizes: 1 × hovercraft" in notes
    cars = read_log(folder, LogConfig(types="car"))
    assert [vehicle.type for vehicle in cars.encounters[0].vehicles] == ["car", "car"]
    assert "left out: 1 × hovercraft, 1 × pedestrian/bicycle, 1 × tram" in cars.quality.notes
    with pytest.raises(
        InputError, match=r"log\.types: there is no type 'cars'; choose one of car, van"
    ):
        read_log(folder, LogConfig(types="cars"))


def test_type_contradicting_its_motion_is_reported(tmp_path):
    folder, _ = interaction(tmp_path)
    tracks_file = folder / "vehicle_tracks_000.csv"
    tracks_file.write_text(tracks_file.read_text().replace("car", "pedestrian"))
    result = read_log(folder)
    assert [vehicle.type for vehicle in result.encounters[0].vehicles] == [
        "other",
        "pedestrian",
        "pedestrian",
    ]
    assert any(
        "vehicle 7 is a pedestrian in the log but drives 8" in note
        for note in result.quality.notes
    )


def test_two_recordings_are_refused(tmp_path):
    interaction(tmp_path)
    (tmp_path / "vehicle_tracks_001.csv").write_bytes(
        (tmp_path / "vehicle_tracks_000.csv").read_bytes()
    )
    with pytest.raises(InputError, match="one recording at a time"):
        read_log(tmp_path)


def test_broken_scenario_has_its_line(tmp_path):
    path, _ = commonroad(tmp_path)
    text = path.read_text()
    for old, new, said in (
        ("<exact>3</exact>", "<exact>three</exact>", "line 1, <exact>: 'three' is not a number"),
        ("<point>", "<circle>", "not XML"),
        ('timeStepSize="0.1"', 'timeStepSize="0"', "timeStepSize is 0 s"),
        ("<commonRoad ", "<!DOCTYPE x []><commonRoad ", "document type"),
    ):
        path.write_text(text.replace(old, new, 1))
        with pytest.raises(InputError, match=said):
            read_log(path)


def test_large_scene_headings_are_degrees(tmp_path):
    in_degrees = read_log(nocturne(tmp_path)[0])
    in_radians = read_log(nocturne(tmp_path, float)[0])
    assert any("headings in degrees" in note for note in in_degrees.quality.notes)
    assert any("headings in rad" in note for note in in_radians.quality.notes)
    (one,), (other,) = in_degrees.encounters, in_radians.encounters
    assert np.allclose(one.heading, other.heading, atol=1e-6)
    assert np.allclose(one.position, other.position, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda scene: scene["objects"][0].pop("valid"), "object 1 has no 'valid'"),
        (
            lambda scene: scene["objects"][1]["heading"].pop(),
            "object 2: position, velocity, heading and valid have",
        ),
        (
            lambda scene: scene["objects"][1]["position"].__setitem__(0, {"x": "a", "y": 0}),
            "object 2: .*not a list with a number",
        ),
        (lambda scene: scene.update(objects=[1] * 20), "`objects` is not a list of objects"),
    ],
    ids=["key", "length", "numbers", "vehicles"],
)
def test_broken_scene_has_its_object(tmp_path, change, said):
    path, _ = nocturne(tmp_path)
    scene = json.loads(path.read_text())
    change(scene)
    path.write_text(json.dumps(scene))
    with pytest.raises(InputError, match=f"scene.json.*{said}"):
        read_log(path)
    path.write_text(path.read_text()[:-20])
    with pytest.raises(InputError, match=r"scene\.json is not JSON"):
        read_log(path)

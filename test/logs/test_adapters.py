# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Public recordings: small files written to their definitions give the positions, speeds, headings and sizes that went in."""

import json
import math

import numpy as np
import pandas as pd
from pyarrow import parquet
import pytest

from scenario_gen.base.errors import InputError
from scenario_gen.logs import config, LogConfig, read, read_log

SIZES = {"7": (4.5, 1.8), "8": (12.0, 2.5)}
T = np.arange(0.0, 8.0, 0.1)


def motion(vehicle, t):
    """Three that meet: x, y, vx, vy, heading; they drive east at 8 m/s and north-west at 5 m/s, and walk north at 1.5 m/s."""
    if vehicle == "7":
        return -30.0 + 8.0 * t, 0.0 * t, 8.0, 0.0, 0.0
    if vehicle == "9":
        return 5.0 + 0.0 * t, -20.0 + 1.5 * t, 0.0, 1.5, 0.5 * math.pi
    c = 5.0 / math.sqrt(2.0)
    return 20.0 - c * t, -10.0 + c * t, -c, c, 0.75 * math.pi


def argoverse2(folder):
    rows = []
    for track, kind in (("7", "vehicle"), ("8", "bus"), ("9", "pedestrian"), ("AV", "static")):
        x, y, vx, vy, heading = motion(track, T)
        rows += [
            (
                True,
                track,
                kind,
                2,
                k,
                x[k],
                y[k],
                heading,
                vx,
                vy,
                "s1",
                0,
                0,
                len(T),
                "7",
                "austin",
            )
            for k in range(len(T))
        ]
    names = "observed track_id object_type object_category timestep position_x position_y heading velocity_x velocity_y scenario_id"
    names += " start_timestamp end_timestamp num_timestamps focal_track_id city"
    path = folder / "scenario_s1.parquet"
    pd.DataFrame(rows, columns=names.split()).to_parquet(path)
    return path, ("car", "bus", "pedestrian")


def interaction(folder):
    rows = []
    for track, size in SIZES.items():
        x, y, vx, vy, heading = motion(track, T)
        rows += [
            (track, k + 1, 100 * (k + 1), "car", x[k], y[k], vx, vy, heading, *size)
            for k in range(len(T))
        ]
    names = "track_id frame_id timestamp_ms agent_type x y vx vy psi_rad length width"
    pd.DataFrame(rows, columns=names.split()).to_csv(
        folder / "vehicle_tracks_000.csv", index=False
    )
    x, y, vx, vy, _ = motion("9", T)
    walker = [
        ("9", k, 100 * (k + 1), "pedestrian/bicycle", x[k], y[k], vx, vy) for k in range(len(T))
    ]
    pd.DataFrame(walker, columns=names.split()[:8]).to_csv(
        folder / "pedestrian_tracks_000.csv", index=False
    )
    return folder, ("car", "car", "pedestrian")


def levelx(folder, tracks, classes):
    tracks.to_csv(folder / "00_tracks.csv", index=False)
    classes.to_csv(folder / "00_tracksMeta.csv", index=False)
    pd.DataFrame({"recordingId": [0], "frameRate": [25]}).to_csv(
        folder / "00_recordingMeta.csv", index=False
    )


def ind(folder):
    rows = []
    for track in (*SIZES, "9"):
        x, y, vx, vy, heading = motion(track, np.arange(200) / 25.0)
        length, width = SIZES.get(track, (0.0, 0.0))
        turned = math.degrees(heading) % 360.0
        rows += [
            (0, int(track), k, k, x[k], y[k], turned, width, length, vx, vy, 0.0, 0.0)
            for k in range(200)
        ]
    names = "recordingId trackId frame trackLifetime xCenter yCenter heading width length xVelocity yVelocity"
    names += " xAcceleration yAcceleration"
    classes = pd.DataFrame(
        {"recordingId": 0, "trackId": [7, 8, 9], "class": ["car", "truck_bus", "bicycle"]}
    )
    levelx(folder, pd.DataFrame(rows, columns=names.split()), classes)
    return folder / "00_tracks.csv", ("car", "truck", "bicycle")


def highd(folder):
    """Y grows downwards, x and y are the box's upper left corner; all drive along x."""
    rows = []
    for track, (length, width) in SIZES.items():
        sign = 1.0 if track == "7" else -1.0
        for k in range(200):
            x, y = sign * (-40.0 + 10.0 * k / 25.0), 4.0 if track == "7" else 8.0  # ours; y is up
            rows.append(
                (
                    k + 1,
                    int(track),
                    x - length / 2.0,
                    -y - width / 2.0,
                    length,
                    width,
                    10.0 * sign,
                    0.0,
                    0.0,
                    0.0,
                    2,
                )
            )
    names = "frame id x y width height xVelocity yVelocity xAcceleration yAcceleration laneId"
    classes = pd.DataFrame({"id": [7, 8], "class": ["Car", "Truck"]})
    levelx(folder, pd.DataFrame(rows, columns=names.split()), classes)
    return folder, ("car", "truck")


def commonroad(folder):
    text = ""
    for track, kind in (("7", "car"), ("8", "bus"), ("9", "pedestrian")):
        x, y, vx, vy, heading = motion(track, T)
        length, width = SIZES.get(track, (0.5, 0.5))

        def state(tag, k, x=x, y=y, heading=heading, speed=math.hypot(vx, vy)):
            return (
                f"<{tag}><position><point><x>{float(x[k])!r}</x><y>{float(y[k])!r}</y></point></position>"
                f"<orientation><exact>{heading}</exact></orientation>"
                f"<time><exact>{k}</exact></time><velocity><exact>{speed}</exact></velocity></{tag}>"
            )

        states = "".join(state("state", k) for k in range(1, len(T)))
        text += (
            f'<dynamicObstacle id="{track}"><type>{kind}</type><shape><rectangle><length>{length}</length>'
            f"<width>{width}</width></rectangle></shape>{state('initialState', 0)}"
            f"<trajectory>{states}</trajectory></dynamicObstacle>"
        )
    path = folder / "scenario.xml"
    path.write_text(
        f'<?xml version="1.0"?><commonRoad commonRoadVersion="2020a" timeStepSize="0.1">{text}</commonRoad>'
    )
    return path, ("car", "bus", "pedestrian")


def nocturne(folder, unit=math.degrees):
    """A scene as Nocturne has it; headings in the unit that `unit` makes of rad, and vehicle 8 absent at the end."""
    objects = []
    for track, kind in (("7", "vehicle"), ("8", "vehicle"), ("9", "pedestrian")):
        x, y, vx, vy, heading = motion(track, T)
        length, width = SIZES.get(track, (0.5, 0.5))
        there = [track != "8" or k < len(T) - 3 for k in range(len(T))]
        objects.append(
            {
                "position": [
                    {"x": float(a), "y": float(b)} if at else ABSENT
                    for a, b, at in zip(x, y, there, strict=True)
                ],
                "width": width,
                "length": length,
                "heading": [unit(heading) if at else -10000.0 for at in there],
                "velocity": [{"x": float(vx), "y": float(vy)} if at else ABSENT for at in there],
                "valid": there,
                "type": kind,
                "id": int(track),
            }
        )
    path = folder / "scene.json"
    path.write_text(json.dumps({"name": "scene.json", "objects": objects, "roads": []}))
    return path, ("car", "truck", "pedestrian")


def omega_prime(folder):
    """A table of omega-prime: numbers for the kinds of objects."""
    rows = []
    for track, (kind, more) in (("7", (2, 4)), ("8", (2, 12)), ("9", (3, -1))):
        x, y, vx, vy, heading = motion(track, T)
        length, width = SIZES.get(track, (0.5, 0.5))
        after = (vx, vy, heading, length, width, kind, more, -1)
        rows += [(round(T[k] * 1e9), int(track), x[k], y[k], 0.7, *after) for k in range(len(T))]
    names = "total_nanos idx x y z vel_x vel_y yaw length width type subtype role"
    path = folder / "omega.csv"
    pd.DataFrame(rows, columns=names.split()).to_csv(path, index=False)
    return path, ("car", "bus", "pedestrian")


def pulling(betterosi, kind, trailer):
    """A class of OSI, of a vehicle that may have a trailer."""
    number = betterosi.Identifier(value=int(trailer)) if trailer else None
    return betterosi.MovingObject.VehicleClassification(
        type=kind, has_trailer=bool(trailer), trailer_id=number
    )


def test_whose_trailer_it_is_is_said(tmp_path):
    found = read.read_raw([osi(tmp_path)[0]], LogConfig())
    assert (
        "trailer 7 belongs to 8: read as a road user by itself" in found.notes
        and len(found.vehicles) == 3
    )


def osi(folder):
    """A trace of OSI, written with its own library."""
    betterosi = pytest.importorskip("betterosi")
    path, kinds = folder / "trace.mcap", betterosi.MovingObject.VehicleClassification.Type
    with betterosi.Writer(path) as writer:
        for k, t in enumerate(T):
            things = []
            for track, kind in (("7", kinds.CAR), ("8", kinds.BUS), ("9", None)):
                x, y, vx, vy, heading = motion(track, T)
                length, width = SIZES.get(track, (0.5, 0.5))
                things.append(
                    betterosi.MovingObject(
                        id=betterosi.Identifier(value=int(track)),
                        type=betterosi.MovingObject.Type.VEHICLE
                        if kind
                        else betterosi.MovingObject.Type.PEDESTRIAN,
                        base=betterosi.BaseMoving(
                            dimension=betterosi.Dimension3d(
                                length=length, width=width, height=1.5
                            ),
                            position=betterosi.Vector3d(x=float(x[k]), y=float(y[k]), z=0.75),
                            orientation=betterosi.Orientation3d(roll=0.0, pitch=0.0, yaw=heading),
                            velocity=betterosi.Vector3d(x=vx, y=vy, z=0.0),
                        ),
                        vehicle_classification=kind
                        and pulling(betterosi, kind, "7" if track == "8" else ""),
                    )
                )
            nanos = round(t * 1e9)
            stamp = betterosi.Timestamp(seconds=nanos // 10**9, nanos=nanos % 10**9)
            writer.add(
                betterosi.GroundTruth(timestamp=stamp, moving_object=things),
                topic="ground_truth",
                log_time=nanos,
            )
    return path, ("car", "bus", "pedestrian")


ABSENT = {"x": -10000.0, "y": -10000.0}


def tracked(folder):
    """Write a bag of autoware_perception_msgs/TrackedObjects."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    from scenario_gen.bags.storage.definitions import TRACKED, type_store
    from scenario_gen.bags.vehicles import KINDS

    types = type_store().types

    def make(name, **values):
        return types[name](**values)

    def zero(name, count):
        return make(
            f"geometry_msgs/msg/{name}", **dict.fromkeys(("x", "y", "z", "w")[:count], 0.0)
        )

    def with_covariance(kind, **values):
        body = make(f"geometry_msgs/msg/{kind}", **values)
        return make(
            f"geometry_msgs/msg/{kind}WithCovariance",
            covariance=np.zeros(36),
            **{kind.lower(): body},
        )

    path = folder / "perception"
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        connection = bag.add_connection(
            "/perception/object_recognition/tracking/objects", TRACKED, typestore=type_store()
        )
        for k, t in enumerate(T):
            objects = []
            for track, label in (("7", "car"), ("8", "bus"), ("9", "pedestrian")):
                x, y, vx, vy, heading = motion(track, T)
                length, width = SIZES.get(track, (0.5, 0.5))
                point, turn = zero("Point", 3), zero("Quaternion", 4)
                point.x, point.y, turn.z, turn.w = (
                    float(x[k]),
                    float(y[k]),
                    math.sin(heading / 2.0),
                    math.cos(heading / 2.0),
                )
                linear, size = zero("Vector3", 3), zero("Vector3", 3)
                linear.x, size.x, size.y = math.hypot(vx, vy), length, width
                kinematics = make(
                    "autoware_perception_msgs/msg/TrackedObjectKinematics",
                    pose_with_covariance=with_covariance("Pose", position=point, orientation=turn),
                    twist_with_covariance=with_covariance(
                        "Twist", linear=linear, angular=zero("Vector3", 3)
                    ),
                    acceleration_with_covariance=with_covariance(
                        "Accel", linear=zero("Vector3", 3), angular=zero("Vector3", 3)
                    ),
                    orientation_availability=2,
                    is_stationary=False,
                )
                shape = make(
                    "autoware_perception_msgs/msg/Shape",
                    type=0,
                    footprint=make("geometry_msgs/msg/Polygon", points=[]),
                    dimensions=size,
                )
                kind = make(
                    "autoware_perception_msgs/msg/ObjectClassification",
                    label=KINDS.index(label),
                    probability=0.9,
                )
                doubt = make(
                    "autoware_perception_msgs/msg/ObjectClassification", label=0, probability=0.1
                )
                number = make(
                    "unique_identifier_msgs/msg/UUID", uuid=np.full(16, int(track), dtype=np.uint8)
                )
                objects.append(
                    make(
                        "autoware_perception_msgs/msg/TrackedObject",
                        object_id=number,
                        existence_probability=1.0,
                        classification=[doubt, kind],
                        kinematics=kinematics,
                        shape=shape,
                    )
                )
            stamp = make("builtin_interfaces/msg/Time", sec=int(t), nanosec=round((t % 1.0) * 1e9))
            message = make(
                TRACKED,
                header=make("std_msgs/msg/Header", stamp=stamp, frame_id="map"),
                objects=objects,
            )
            bag.write(connection, round(t * 1e9), type_store().serialize_cdr(message, TRACKED))
    return path, ("car", "bus", "pedestrian")


MADE = {
    f.__name__: f
    for f in (argoverse2, interaction, ind, highd, commonroad, nocturne, omega_prime, osi, tracked)
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
    with pytest.raises(InputError, match=r"00_recordingMeta\.csv beside it, which is not there"):
        read_log(path)
    with pytest.raises(InputError, match=r"lacks columns of INTERACTION: agent_type"):
        read_log(path, LogConfig(format="interaction"))


@pytest.mark.parametrize("column", ["position_x", "object_category"])
def test_a_repeated_column_is_named(tmp_path, column):
    path, _ = argoverse2(tmp_path)
    table = parquet.read_table(path)
    parquet.write_table(table.append_column(column, table.column(column)), path)
    with pytest.raises(
        InputError, match=rf"scenario_s1\.parquet has more than one column '{column}'"
    ):
        read_log(path)


def test_who_is_of_no_known_type_is_counted_and_some_can_be_left_out(tmp_path):
    folder, _ = interaction(tmp_path)
    tracks_file = folder / "vehicle_tracks_000.csv"
    tracks_file.write_text(
        tracks_file.read_text()
        + "98,1,100,tram,0,0,0,1,0,30,2.5\n99,1,100,hovercraft,0,0,0,1,0,30,2.5\n"
    )
    notes = read_log(folder).quality.notes
    assert (
        "left out: 1 × tram" in notes
        and "types that are not known, read by size: 1 × hovercraft" in notes
    )
    cars = read_log(folder, LogConfig(types="car"))
    assert [vehicle.type for vehicle in cars.encounters[0].vehicles] == ["car", "car"]
    assert "left out: 1 × hovercraft, 1 × pedestrian/bicycle, 1 × tram" in cars.quality.notes
    with pytest.raises(
        InputError, match=r"log\.types: there is no type 'cars'; choose of car, van"
    ):
        read_log(folder, LogConfig(types="cars"))


def test_a_type_that_contradicts_its_motion_is_said(tmp_path):
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
        "vehicle 7 is a pedestrian by the log and as fast as 8" in note
        for note in result.quality.notes
    )


def test_two_recordings_are_refused(tmp_path):
    interaction(tmp_path)
    (tmp_path / "vehicle_tracks_001.csv").write_bytes(
        (tmp_path / "vehicle_tracks_000.csv").read_bytes()
    )
    with pytest.raises(InputError, match="give one at a time"):
        read_log(tmp_path)


def test_a_broken_scenario_is_named_with_its_line(tmp_path):
    path, _ = commonroad(tmp_path)
    text = path.read_text()
    for old, new, said in (
        ("<exact>3</exact>", "<exact>three</exact>", "line 1, <exact>: 'three' is no number"),
        ("<point>", "<circle>", "not XML"),
        ('timeStepSize="0.1"', 'timeStepSize="0"', "timeStepSize is 0 s"),
        ("<commonRoad ", "<!DOCTYPE x []><commonRoad ", "document type"),
    ):
        path.write_text(text.replace(old, new, 1))
        with pytest.raises(InputError, match=said):
            read_log(path)


def test_the_parameter_format_offers_every_built_in_format():
    assert set(config.FORMATS) == {"auto", *read.FORMATS.built_in}
    assert read.FORMATS.group == LogConfig.__dataclass_fields__["format"].metadata["group"]


def test_the_unit_of_headings_of_a_scene_is_told_from_its_velocities(tmp_path):
    in_degrees = read_log(nocturne(tmp_path)[0])
    in_radians = read_log(nocturne(tmp_path, float)[0])
    assert any("headings in degrees" in note for note in in_degrees.quality.notes)
    assert any("headings in rad" in note for note in in_radians.quality.notes)
    (one,), (other,) = in_degrees.encounters, in_radians.encounters
    assert np.allclose(one.heading, other.heading, atol=1e-6) and np.allclose(
        one.position, other.position, atol=1e-6
    )


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
            "object 2: .*no list of numbers",
        ),
        (lambda scene: scene.update(objects=[1] * 20), "`objects` is no list of objects"),
    ],
    ids=["key", "length", "numbers", "vehicles"],
)
def test_a_broken_scene_is_named_with_its_object(tmp_path, change, said):
    path, _ = nocturne(tmp_path)
    scene = json.loads(path.read_text())
    change(scene)
    path.write_text(json.dumps(scene))
    with pytest.raises(InputError, match=f"scene.json.*{said}"):
        read_log(path)
    path.write_text(path.read_text()[:-20])
    with pytest.raises(InputError, match=r"scene\.json is no JSON"):
        read_log(path)

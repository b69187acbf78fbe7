# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Small files in the formats of public recordings, written to their definitions."""

import json
import math

import numpy as np
import pandas as pd

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

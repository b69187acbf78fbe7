# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The fields of every message in the order of the wire: tables for `encode` and `decode`.

A field is a number ("f4"), several numbers ("7f8"), a "string", a "time" (or duration) in
nanoseconds, another table, or a sequence: a list with one of these. Neighbouring ROS fields of one
type form one field: `pose` is x, y, z [m] and the quaternion x, y, z, w; `twist` is linear x, y, z
[m/s] and angular x, y, z [rad/s]; covariances have 36 entries. Unused fields are zero or empty.
"""

from typing import Any

Layout = dict[str, Any]

HEADER: Layout = {"stamp": "time", "frame_id": "string"}
POSE, TWIST, COVARIANCE = "7f8", "6f8", "36f8"
KINEMATICS: Layout = {
    "pose": POSE,
    "pose_covariance": COVARIANCE,
    "twist": TWIST,
    "twist_covariance": COVARIANCE,
}

CLOCK: Layout = {"clock": "time"}
STRING: Layout = {"data": "string"}
VELOCITY: Layout = {"twist": TWIST}
VELOCITY_STAMPED = HEADER | VELOCITY
FIX = HEADER | {
    "status": "i1",
    "service": "u2",
    "place": "3f8",
    "covariance": "9f8",
    "covariance_type": "u1",
}
POSES = HEADER | {"poses": [POSE]}
PATH = HEADER | {"poses": [HEADER | {"pose": POSE}]}
POLYGON = HEADER | {"points": ["3f4"]}  # m
ODOMETRY = HEADER | {"child": "string"} | KINEMATICS
TRANSFORMS: Layout = {"transforms": [HEADER | {"child": "string", "pose": POSE}]}
MAP = HEADER | {
    "load_time": "time",
    "resolution": "f4",
    "size": "2u4",
    "origin": POSE,
    "cells": ["i1"],
}  # m/cell; width, height
VALUE: Layout = {"key": "string", "value": "string"}
STATUS: Layout = {
    "level": "u1",
    "name": "string",
    "message": "string",
    "hardware_id": "string",
    "values": [VALUE],
}
DIAGNOSTICS = HEADER | {"statuses": [STATUS]}

POINT: Layout = {
    "transforms": [POSE],
    "velocities": [TWIST],
    "accelerations": [TWIST],
    "time": "time",
}
TRAJECTORY = HEADER | {"names": ["string"], "count": "u4"}  # followed by the points

CLOUD_FIELD: Layout = {"name": "string", "offset": "u4", "datatype": "u1", "count": "u4"}
CLOUD = HEADER | {
    "size": "2u4",
    "fields": [CLOUD_FIELD],
    "is_bigendian": "u1",
    "steps": "2u4",
    "data": ["u1"],
    "is_dense": "u1",
}

IMAGE = HEADER | {"format": "string", "data": ["u1"]}
MARKER = HEADER | {
    "name": "string",
    "id": "i4",
    "kind": "i4",
    "action": "i4",
    "pose": POSE,
    "scale": "3f8",
    "colour": "4f4",
}
MARKER |= {
    "lifetime": "time",
    "frame_locked": "u1",
    "points": ["3f8"],
    "colours": ["4f4"],
    "texture_resource": "string",
}
MARKER |= {
    "texture": IMAGE,
    "uv": ["2f4"],
    "text": "string",
    "mesh_resource": "string",
    "mesh_name": "string",
    "mesh": ["u1"],
}
MARKER |= {"embedded_materials": "u1"}
MARKERS: Layout = {"markers": [MARKER]}

SHAPE: Layout = {"type": "u1", "footprint": ["3f4"], "dimensions": "3f8"}  # m
OBJECT: Layout = {
    "id": "16u1",
    "existence": "f4",
    "classes": [{"label": "u1", "probability": "f4"}],
    **KINEMATICS,
}
OBJECT |= {"acceleration": "6f8", "acceleration_covariance": COVARIANCE}  # linear [m/s²], angular
PREDICTION: Layout = {"poses": [POSE], "step": "time", "confidence": "f4"}
PREDICTED = HEADER | {"objects": [OBJECT | {"paths": [PREDICTION], "shape": SHAPE}]}
TRACKED = HEADER | {
    "objects": [OBJECT | {"orientation": "u1", "is_stationary": "u1", "shape": SHAPE}]
}

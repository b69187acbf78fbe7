# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Scenario → Autoware's perception and localization outputs.

docs/exchange.md has the source of each topic and frame.

PredictedObjects on `/perception/object_recognition/objects` and TrackedObjects on
`/perception/object_recognition/tracking/objects` are in the road's frame. An object's pose is the
centre of its shape, with z half its height; twist and acceleration are in its own frame. Its id is
the first 16 bytes of the SHA-256 of the vehicle's id. Predicted paths have a pose every `STEP_NS`
up to `HORIZON_NS` ahead, or to the end.

Odometry of the ego on `/localization/kinematic_state` is in the road's frame, with the child frame
`base_link`, the centre of the rear axle on the ground. Covariances are 0, because the values are
exact. QoS: reliable, volatile, depth 1.
"""

from collections.abc import Sequence
import hashlib
from typing import Any

import numpy as np

from msg_conventions.cdr import encode
from msg_conventions.layouts import PREDICTED, TRACKED
from msg_conventions.poses import encode_odometry, pose_rows
from scenario_gen.numerics import Floats
from scenario_gen.types import height, Quality, rear_axle, Scenario, shifted, Vehicle

OBJECTS, TRACKS = (
    "/perception/object_recognition/objects",
    "/perception/object_recognition/tracking/objects",
)
EGO, BASE_LINK = "/localization/kinematic_state", "base_link"
QUALITY = Quality(depth=1, transient_local=False)
STEP_NS, HORIZON_NS = 500_000_000, 10_000_000_000


def uuid_of(vehicle: Vehicle) -> bytes:
    """Return the 16 bytes that stand for a vehicle in every message."""
    return hashlib.sha256(vehicle.id.encode()).digest()[:16]


class AutowareEncoder:
    """Encodes a scenario's instants, one after the other."""

    def __init__(self, scenario: Scenario) -> None:
        """Compute the vehicles' states (N, T, 6) for `encode_predicted_objects`."""
        self.scenario = scenario
        self.time_ns = np.rint(scenario.time * 1e9).astype(np.int64)
        rate = np.zeros_like(scenario.heading)
        for n, (first, last) in enumerate(scenario.present.tolist()):
            steps = slice(first, last + 1)
            rate[n, steps] = np.gradient(scenario.heading[n, steps], scenario.time[steps])
        motion = (scenario.heading, scenario.speed, scenario.acceleration, rate)
        self.states = np.concatenate((scenario.position, np.stack(motion, axis=-1)), axis=-1)

    def present_at(self, k: int) -> list[int]:
        """Return the vehicles that are present at instant `k`."""
        return [
            n
            for n, (first, last) in enumerate(self.scenario.present.tolist())
            if first <= k <= last
        ]

    def predicted_objects(self, k: int, stamp_ns: int) -> bytes:
        """Return instant `k` as PredictedObjects."""
        present = self.present_at(k)
        vehicles = [self.scenario.vehicles[n] for n in present]
        paths = [self.states[n, self._horizon(n, k), :3] for n in present]
        states = self.states[present, k]
        frame_id = self.scenario.frame_id
        return encode_predicted_objects(vehicles, states, paths, frame_id, stamp_ns)

    def tracked_objects(self, k: int, stamp_ns: int) -> bytes:
        """Return instant `k` as TrackedObjects."""
        objects = [
            _object(self.scenario.vehicles[n], self.states[n, k])
            # TrackedObjectKinematics.AVAILABLE
            | {"orientation": 2, "is_stationary": self.scenario.speed[n, k] == 0.0}
            for n in self.present_at(k)
        ]
        return encode(TRACKED, stamp=stamp_ns, frame_id=self.scenario.frame_id, objects=objects)

    def odometry(self, k: int, stamp_ns: int) -> bytes:
        """Return the first vehicle at instant `k` as the ego's Odometry."""
        return encode_kinematic_state(
            self.scenario.vehicles[0], self.states[0, k], self.scenario.frame_id, stamp_ns
        )

    def _horizon(self, n: int, k: int) -> list[int]:
        """Return the instants of the predicted path from `k` on while the vehicle is present."""
        last = int(self.scenario.present[n, 1])
        start = self.time_ns[k]
        end = min(self.time_ns[last], start + HORIZON_NS)
        times = np.arange(start, end + 1, STEP_NS)
        index: list[int] = np.minimum(np.searchsorted(self.time_ns, times), last).tolist()
        return index


def encode_predicted_objects(
    vehicles: Sequence[Vehicle],
    states: Floats,
    paths: Sequence[Floats],
    frame_id: str,
    stamp_ns: int,
) -> bytes:
    """Return vehicles as PredictedObjects.

    Args:
        vehicles: N of them.
        states: (N, 6) x, y [m], yaw [rad], speed [m/s], acceleration [m/s²], yaw rate [rad/s].
        paths: of each the poses (K, 3) x, y [m], yaw [rad] every `STEP_NS` from now on.
        frame_id: of the road.
        stamp_ns: now.
    """
    objects = [
        _object(vehicle, state)
        | {"paths": [{"poses": _shape_poses(vehicle, path), "step": STEP_NS, "confidence": 1.0}]}
        for vehicle, state, path in zip(vehicles, states, paths, strict=True)
    ]
    return encode(PREDICTED, stamp=stamp_ns, frame_id=frame_id, objects=objects)


def encode_kinematic_state(vehicle: Vehicle, state: Floats, frame_id: str, stamp_ns: int) -> bytes:
    """Return the ego as Odometry.

    `state` (6,) x, y [m], yaw [rad], speed [m/s], acceleration [m/s²], yaw rate [rad/s].
    """
    axle = shifted(state[:2], state[2], -rear_axle(vehicle))
    return encode_odometry(
        np.array([*axle, *state[2:4]]), float(state[5]), BASE_LINK, frame_id, stamp_ns
    )


def _object(vehicle: Vehicle, state: Floats) -> dict[str, Any]:
    """Return the fields of a vehicle in both messages.

    `state` (6,) as in `encode_kinematic_state`.
    """
    _, _, _, speed, acceleration, rate = state.tolist()
    return {
        "id": np.frombuffer(uuid_of(vehicle), dtype=np.uint8),
        "existence": 1.0,
        "classes": [{"label": vehicle.kind.autoware, "probability": 1.0}],
        "pose": _shape_poses(vehicle, state[None, :3]),
        "twist": (speed, 0.0, 0.0, 0.0, 0.0, rate),
        "acceleration": (acceleration, 0.0, 0.0, 0.0, 0.0, 0.0),
        "shape": {
            "type": 0,  # Shape.BOUNDING_BOX
            "dimensions": (vehicle.length, vehicle.width, height(vehicle)),
        },
    }


def _shape_poses(vehicle: Vehicle, poses: Floats) -> Floats:
    """Return the wire rows (K, 7) of a vehicle's shape at poses (K, 3) x, y [m], yaw [rad]."""
    rows = pose_rows(poses)
    rows[:, 2] = height(vehicle) / 2.0
    return rows

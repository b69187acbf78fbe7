# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The ego slot ⇄ `ego/start`, `ego/goal` (nav_msgs/Odometry) and `ego/witness` (trajectory.py).

Start and goal belong to the last request whose `scenarios/info` names the vehicle as its `ego.id`.
Frame: the road's. Stamp: the template's, also for the goal. Odometry: `child_frame_id` is
`vehicle_<id>`, `pose.pose` the centre of the footprint with z = 0 and the yaw as a quaternion,
`twist.twist.linear.x` the speed along the heading [m/s]. All else is 0. QoS: reliable,
transient_local, depth 1.

`ego/witness` has one message per scenario, before the scenario: a trajectory of the ego on the
scenario's clock, which proves the scenario valid. `ego.witness` in `scenarios/info` is the SHA-256
of the message. QoS as for `scenarios`.
"""

from collections.abc import Iterator

import numpy as np

from msg_conventions.poses import encode_odometry
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats
from scenario_gen.types import EgoSlot, token

WITNESS = "ego/witness"


def encode_state(state: Floats, child_frame_id: str, frame_id: str, stamp_ns: int) -> bytes:
    """Return the state (4,) x [m], y [m], yaw [rad], speed [m/s] as CDR bytes.

    Raises:
        InputError: a value is not finite.
    """
    if not np.isfinite(state).all():
        raise InputError("a state with a value that is not finite cannot be sent")
    return encode_odometry(state, 0.0, child_frame_id, frame_id, stamp_ns)


def ego_messages(slot: EgoSlot, frame_id: str, stamp_ns: int) -> Iterator[tuple[str, bytes]]:
    """Yield topic and CDR bytes of the ego's start and goal."""
    child = f"vehicle_{token(slot.vehicle.id)}"
    for topic, state in (("ego/start", slot.start), ("ego/goal", slot.goal)):
        yield topic, encode_state(state, child, frame_id, stamp_ns)

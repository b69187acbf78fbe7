# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Samples of vehicles in bags of others: NavSatFix, TwistStamped and Odometry, decoded by rosbags, of either byte order."""

from dataclasses import dataclass
import math
from typing import Any

import numpy as np
from rosbags.typesys import get_typestore, Stores

from msg_conventions import ego, topics, trajectory
from msg_conventions.streams import speed_of
from msg_conventions.tracks import decode_tracks
from msg_conventions.yaw import yaw
from scenario_gen.base.errors import guarded
from scenario_gen.numerics import exact

__all__ = ["FIX", "ODOMETRY", "STORES", "TRACKS", "TWIST", "Sample", "decode_sample", "decode_tracks"]

FIX, TWIST, ODOMETRY, TRACKS = topics.FIX_TYPE, topics.TWIST_TYPE, ego.STATE_TYPE, trajectory.TYPE
STORES = get_typestore(Stores.ROS2_JAZZY)  # the types are standard, so bags without type definitions read as well


@dataclass(frozen=True)
class Sample:
    """What one message says.

    Attributes:
        stamp_ns: of its header, 0 if that bears none.
        position: latitude and longitude [degrees], or x and y [m]; NaN where there is no fix, None of a TwistStamped.
        heading: rad; NaN if it is not said.
        speed: m/s; None if it is not said.
    """

    stamp_ns: int
    position: tuple[float, float] | None = None
    heading: float = math.nan
    speed: float | None = None


def decode_sample(data: bytes, kind: str, what: str) -> Sample:
    """Return what a message of type FIX, TWIST or ODOMETRY says.

    Raises:
        InputError: naming `what`, it is damaged.
    """
    with guarded(f"{what}: not a {kind}"):
        message: Any = STORES.deserialize_cdr(data, kind)
    stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
    if kind == FIX:
        known = message.status.status >= 0
        return Sample(stamp, (message.latitude, message.longitude) if known else (math.nan, math.nan))
    if kind == TWIST:
        return Sample(stamp, speed=speed_of(message.twist.linear.x, message.twist.linear.y))
    pose, linear = message.pose.pose, message.twist.twist.linear  # the speed is in the body frame
    turn = pose.orientation
    heading = float(yaw(np.array([turn.x, turn.y, turn.z, turn.w])))
    return Sample(stamp, (pose.position.x, pose.position.y), heading, exact.hypot(linear.x, linear.y))

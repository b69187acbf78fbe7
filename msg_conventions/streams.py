# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A vehicle's state ⇄ `vehicle_<id>/fix` (NavSatFix), `vehicle_<id>/speed` (TwistStamped).

Stamp: the sample's, on the template's clock. Frame: `vehicle_<id>`. Speed: linear.x, m/s, of the
body frame.
QoS: reliable, volatile, depth 1000.
"""

import math

import numpy as np

from msg_conventions.cdr import decode, encode
from msg_conventions.layouts import FIX, VELOCITY_STAMPED

FIX_CODE = 0  # NavSatStatus.STATUS_FIX


def encode_fix(latitude: float, longitude: float, stamp_ns: int, frame_id: str) -> bytes:
    """Return a NavSatFix of degrees as CDR bytes."""
    place = (latitude, longitude, 0.0)
    gps = 1  # NavSatStatus.SERVICE_GPS
    return encode(
        FIX, stamp=stamp_ns, frame_id=frame_id, status=FIX_CODE, service=gps, place=place
    )


def encode_speed(speed: float, stamp_ns: int, frame_id: str) -> bytes:
    """Return a TwistStamped of m/s along the vehicle as CDR bytes."""
    return encode(
        VELOCITY_STAMPED, stamp=stamp_ns, frame_id=frame_id, twist=(speed, 0.0, 0.0, 0.0, 0.0, 0.0)
    )


def decode_fix(data: bytes, source: str = "fix") -> tuple[int, float, float]:
    """Return stamp [ns], latitude and longitude [degrees] of a NavSatFix.

    They are NaN without a fix (status below 0).

    Raises:
        InputError: the message is damaged.
    """
    message = decode(FIX, data, source)
    if message.status < FIX_CODE:
        return message.stamp, math.nan, math.nan
    latitude, longitude, _ = message.place.tolist()
    return message.stamp, latitude, longitude


def decode_speed(data: bytes, source: str = "speed") -> tuple[int, float]:
    """Return stamp [ns] and speed [m/s] of a TwistStamped.

    Raises:
        InputError: the message is damaged.
    """
    message = decode(VELOCITY_STAMPED, data, source)
    return message.stamp, speed_of(*message.twist[:2].tolist())


def speed_of(x: float, y: float) -> float:
    """Return the speed [m/s] of a twist.

    Linear.x in the body frame, or the length of the horizontal vector.
    """
    return x if y == 0.0 else np.hypot(x, y)

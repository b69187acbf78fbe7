# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One vehicle's state at one instant ⇄ `vehicle_<id>/fix` (NavSatFix) and `vehicle_<id>/speed` (TwistStamped).

Stamp: the sample's, on the template's clock. Frame: `vehicle_<id>`. Speed: linear.x, m/s, of the body frame.
QoS: reliable, volatile, depth 1000.
"""

import math

import numpy as np

from msg_conventions.cdr import CdrReader, CdrWriter

FIXED, GPS, COVARIANCE_UNKNOWN = 0, 1, 0  # of NavSatStatus and NavSatFix


def encode_fix(latitude: float, longitude: float, stamp_ns: int, frame_id: str) -> bytes:
    """Return a NavSatFix of degrees as CDR bytes."""
    writer = CdrWriter().header(stamp_ns, frame_id).pack("b", FIXED).pack("H", GPS)
    return writer.pack("d", latitude, longitude, 0.0, *[0.0] * 9).pack("B", COVARIANCE_UNKNOWN).finish()


def encode_speed(speed: float, stamp_ns: int, frame_id: str) -> bytes:
    """Return a TwistStamped of m/s along the vehicle as CDR bytes."""
    return CdrWriter().header(stamp_ns, frame_id).pack("d", speed, *[0.0] * 5).finish()


def decode_fix(data: bytes, what: str = "fix") -> tuple[int, float, float]:
    """Return stamp [ns], latitude and longitude [degrees] of a NavSatFix; NaN where there is no fix (status below 0).

    Raises:
        InputError: the message is damaged.
    """
    reader = CdrReader(data, what)
    stamp_ns, _ = reader.header()
    status = reader.one("b")
    reader.one("H")  # service
    latitude, longitude, _altitude = reader.floats(3).tolist()
    return (stamp_ns, latitude, longitude) if status >= FIXED else (stamp_ns, math.nan, math.nan)


def decode_speed(data: bytes, what: str = "speed") -> tuple[int, float]:
    """Return stamp [ns] and speed [m/s] of a TwistStamped.

    Raises:
        InputError: the message is damaged.
    """
    reader = CdrReader(data, what)
    stamp_ns, _ = reader.header()
    return stamp_ns, speed_of(*reader.floats(2).tolist())


def speed_of(x: float, y: float) -> float:
    """Return the speed [m/s] of a twist: linear.x of the body frame, or the length of the horizontal vector."""
    return x if y == 0.0 else np.hypot(x, y)

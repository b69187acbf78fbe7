# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The local frame of a log: metres east and north of an origin, from latitude and longitude (WGS84).

The plane touches the ellipsoid at the origin; distances from the origin are measured along the ground, as in the azimuthal
equidistant projection, which this agrees with to 0.1 mm within 10 km and 2 mm within 50 km (tested against PROJ).
PROJ itself calls the C library's functions, whose last bit depends on the CPU.
"""

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats
from scenario_gen.types import Encounter

SEMI_MAJOR, FLATTENING = 6378137.0, 1.0 / 298.257223563  # WGS84
ECCENTRICITY2 = FLATTENING * (2.0 - FLATTENING)
_RADIANS = np.pi / 180.0
_STEPS = 8  # of the inverse: each brings the error down by 1e-3 or more within 10 km


def local_frame(latitude: Floats, longitude: Floats, origin: tuple[float, float]) -> Floats:
    """Return metres east and north (..., 2) of the origin.

    Args:
        latitude: degrees, any shape.
        longitude: degrees, of the same shape.
        origin: latitude and longitude in degrees.
    """
    sin_lat, cos_lat = np.sin(latitude * _RADIANS), np.cos(latitude * _RADIANS)
    turned = (longitude - origin[1]) * _RADIANS
    sin0, cos0 = np.sin(origin[0] * _RADIANS), np.cos(origin[0] * _RADIANS)
    normal = SEMI_MAJOR / np.sqrt(1.0 - ECCENTRICITY2 * np.square(sin_lat))
    normal0 = SEMI_MAJOR / np.sqrt(1.0 - ECCENTRICITY2 * np.square(sin0))
    # From the earth's centre: outwards in the origin's meridian, east of it, and up along the axis.
    out = normal * cos_lat * np.cos(turned) - normal0 * cos0
    east = normal * cos_lat * np.sin(turned)
    up = (1.0 - ECCENTRICITY2) * (normal * sin_lat - normal0 * sin0)
    north = cos0 * up - sin0 * out
    # A chord's shadow on the plane is shorter than the arc: R sin(s / R) instead of s.
    meridian = normal0 * (1.0 - ECCENTRICITY2) / (1.0 - ECCENTRICITY2 * np.square(sin0))
    share = (np.square(east) / normal0 + np.square(north) / meridian) / np.where(
        (east == 0.0) & (north == 0.0), 1.0, np.square(east) + np.square(north)
    )  # 1 / R in this direction (Euler)
    bend = (np.square(east) + np.square(north)) * np.square(share)
    longer = 1.0 + bend * (1.0 / 6.0 + bend * (3.0 / 40.0 + bend * (15.0 / 336.0)))
    return np.stack([east * longer, north * longer], axis=-1)


def geodetic(position: Floats, origin: tuple[float, float]) -> tuple[Floats, Floats]:
    """Return latitude and longitude in degrees of positions (..., 2), the inverse of `local_frame` to 1e-9 m within 10 km."""
    sin0, cos0 = np.sin(origin[0] * _RADIANS), np.cos(origin[0] * _RADIANS)
    normal0 = SEMI_MAJOR / np.sqrt(1.0 - ECCENTRICITY2 * np.square(sin0))
    meridian = normal0 * (1.0 - ECCENTRICITY2) / (1.0 - ECCENTRICITY2 * np.square(sin0))
    latitude = np.full(position.shape[:-1], origin[0])
    longitude = np.full(position.shape[:-1], origin[1])
    for _ in range(_STEPS):
        off = position - local_frame(latitude, longitude, origin)
        latitude = latitude + off[..., 1] / (meridian * _RADIANS)
        longitude = longitude + off[..., 0] / (normal0 * max(cos0, 1e-9) * _RADIANS)
    return latitude, longitude


def latitude_longitude(encounter: Encounter) -> Floats:
    """Return latitude and longitude (N, T, 2) [degrees] of an encounter's positions.

    Raises:
        InputError: its log came in metres, so it has no place on the globe.
    """
    if encounter.origin is None:
        raise InputError(f"encounter {encounter.name!r} came in metres without an origin; it cannot be streamed as NavSatFix")
    return np.stack(geodetic(encounter.position, encounter.origin), axis=-1)

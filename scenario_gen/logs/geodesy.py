# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Local frames: metres east and north of an origin, from degrees, in PROJ's azimuthal equidistant projection (WGS 84).

Distances and directions from the origin are exact; between two points r from it the scale is right to (r / 6371 km)² / 6.
pyproj takes a tenth of a second to load, so it is loaded where degrees are read.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats, Ints, wrap_angle
from scenario_gen.types import Encounter

EARTH_RADIUS_M = 6_371_000.0  # mean radius
SITE_M = 10_000.0  # places nearer to each other than this are of one site, and so are those that a chain of such places joins
OWN_FRAME_M = 1000.0  # from the middle of its site at which an encounter has a frame of its own
LEVER_M = 100.0  # ahead of a vehicle, a point that tells how its heading turns from frame to frame


def azimuthal(origin: tuple[float, float]) -> Any:
    """Return the `pyproj.Proj` of the local frame about latitude and longitude in degrees."""
    import pyproj

    return pyproj.Proj(proj="aeqd", lat_0=origin[0], lon_0=origin[1], ellps="WGS84")


def utm(origin: tuple[float, float]) -> tuple[Any, str]:
    """Return the `pyproj.Proj` of UTM in the zone of latitude and longitude in degrees, and the zone's name."""
    import pyproj

    latitude, longitude = origin
    norway = 56.0 <= latitude < 64.0 and 3.0 <= longitude < 12.0  # its zone is wider
    zone = 32 if norway else int((longitude + 180.0) // 6.0) % 60 + 1
    half = "south" if latitude < 0.0 else "north"
    return pyproj.Proj(
        proj="utm", zone=zone, south=latitude < 0.0, ellps="WGS84"
    ), f"UTM zone {zone} {half}"


def local_frame(latitude: Floats, longitude: Floats, origin: tuple[float, float]) -> Floats:
    """Return metres east and north (..., 2) of the origin.

    Args:
        latitude: degrees, any shape.
        longitude: degrees, of the same shape.
        origin: latitude and longitude in degrees.
    """
    return np.stack(azimuthal(origin)(longitude, latitude), axis=-1)


def geodetic(position: Floats, origin: tuple[float, float]) -> tuple[Floats, Floats]:
    """Return latitude and longitude in degrees of positions (..., 2) [m], the inverse of `local_frame`."""
    longitude, latitude = azimuthal(origin)(position[..., 0], position[..., 1], inverse=True)
    return latitude, longitude


def metres_per_degree(origin: tuple[float, float]) -> tuple[float, float]:
    """Return the metres of a degree of latitude and of longitude at a place, from geodesics of 0.001 degree."""
    import pyproj

    globe, (latitude, longitude), part = pyproj.Geod(ellps="WGS84"), origin, 1e-3
    north = globe.inv(longitude, latitude - part / 2.0, longitude, latitude + part / 2.0)[2]
    east = globe.inv(longitude - part / 2.0, latitude, longitude + part / 2.0, latitude)[2]
    return north / part, east / part


def middle_of(degrees: Floats, left_out: float = 0.0, digits: int = 7) -> tuple[float, float]:
    """Return the middle of latitudes and longitudes (F, 2) [degrees], also where they lie on both sides of the 180th meridian.

    Args:
        degrees: of places less than half the globe apart.
        left_out: per cent of the places at either end that do not count, for a few may be wrong.
        digits: to which it is rounded.
    """
    turned = np.column_stack([degrees[:, 0], _wrapped(degrees[:, 1] - degrees[0, 1])])
    latitude, longitude = np.percentile(turned, [left_out, 100.0 - left_out], axis=0).mean(axis=0)
    return round(float(latitude), digits), round(
        float(_wrapped(longitude + degrees[0, 1])), digits
    )


def _wrapped(longitude: Any) -> Any:
    return (longitude + 180.0) % 360.0 - 180.0


def on_sphere(degrees: Floats) -> Floats:
    """Return places (F, 3) [m] about the middle of a spherical earth, of latitudes and longitudes (F, 2) [degrees]."""
    latitude, longitude = np.radians(degrees).T
    around = np.cos(latitude)
    return EARTH_RADIUS_M * np.column_stack(
        [around * np.cos(longitude), around * np.sin(longitude), np.sin(latitude)]
    )


def sites_of(degrees: Floats) -> Ints:
    """Return the number (F,) of the site of each place (F, 2) [degrees]; sites are `SITE_M` apart or more."""
    place = np.floor(on_sphere(degrees) / SITE_M)
    _, first, cell_of = np.unique(
        place @ (4096.0**2, 4096.0, 1.0), return_index=True, return_inverse=True
    )
    cells = place[first]
    i, j = cKDTree(cells).query_pairs(1.0, p=np.inf, output_type="ndarray").T
    _, site = connected_components(
        coo_array((np.ones(len(i), dtype=bool), (i, j)), shape=(len(cells), len(cells))),
        directed=False,
    )
    return np.asarray(site, dtype=np.int64)[cell_of]


def about_its_middle(encounter: Encounter) -> Encounter:
    """Return an encounter in the frame about its own middle, if that is farther than `OWN_FRAME_M` from its frame's origin."""
    if (
        encounter.origin is None
        or not np.hypot(*encounter.position.reshape(-1, 2).T).max() > OWN_FRAME_M
    ):
        return encounter
    origin = middle_of(latitude_longitude(encounter).reshape(-1, 2), digits=5)
    position, heading = reprojected(
        encounter.position, encounter.heading, encounter.origin, azimuthal(origin)
    )
    return replace(encounter, position=position, heading=heading, origin=origin)


def reprojected(
    position: Floats, heading: Floats, origin: tuple[float, float], into: Any
) -> tuple[Floats, Floats]:
    """Return positions (..., 2) [m] and headings (...) [rad] of the local frame about an origin in another projection.

    Args:
        position: metres east and north of the origin.
        heading: counter-clockwise from east.
        origin: latitude and longitude in degrees.
        into: a `pyproj.Proj`.
    """
    ahead = position + LEVER_M * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    there, ahead = (
        np.stack(into(*geodetic(places, origin)[::-1]), axis=-1) for places in (position, ahead)
    )
    course = np.arctan2(*np.moveaxis(ahead - there, -1, 0)[::-1])
    return there, heading + wrap_angle(course - heading)


def latitude_longitude(encounter: Encounter) -> Floats:
    """Return latitude and longitude (N, T, 2) [degrees] of an encounter's positions.

    Raises:
        InputError: its log came in metres, so it has no place on the globe.
    """
    if encounter.origin is None:
        raise InputError(
            f"encounter {encounter.name!r} came in metres without an origin; it cannot be streamed as NavSatFix"
        )
    return np.stack(geodetic(encounter.position, encounter.origin), axis=-1)

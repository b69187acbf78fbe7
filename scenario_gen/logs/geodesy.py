# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Local frames: metres east and north of an origin, in PROJ's azimuthal equidistant projection.

Distances and directions from the origin are exact; between two points at a distance r from it, the
scale error is (r / 6371 km)² / 6. The ellipsoid is WGS 84. pyproj takes a tenth of a second to
load, so it is loaded when degrees are read.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats, Ints, unit, wrap_angle
from scenario_gen.types import Encounter

EARTH_RADIUS_M = 6_371_000.0
"""Mean radius."""

_SITE_M = 10_000.0  # nearer places, and chains of such places, have one site
_OWN_FRAME_M = 1000.0  # from the origin of its site, an encounter has its own frame
_LEVER_M = 100.0  # ahead of a vehicle, a point that shows how its heading changes between frames


def azimuthal(origin: tuple[float, float]) -> Any:
    """Return the `pyproj.Proj` of the local frame about latitude and longitude in degrees."""
    import pyproj

    return pyproj.Proj(proj="aeqd", lat_0=origin[0], lon_0=origin[1], ellps="WGS84")


def utm(origin: tuple[float, float]) -> tuple[Any, str]:
    """Return the `pyproj.Proj` of UTM in the zone of a place [degrees], and the zone's name."""
    import pyproj

    latitude, longitude = origin
    norway = 56.0 <= latitude < 64.0 and 3.0 <= longitude < 12.0  # its zone is wider
    zone = 32 if norway else int((longitude + 180.0) // 6.0) % 60 + 1
    half = "south" if latitude < 0.0 else "north"
    projection = pyproj.Proj(proj="utm", zone=zone, south=latitude < 0.0, ellps="WGS84")
    return projection, f"UTM zone {zone} {half}"


def local_frame(latitude: Floats, longitude: Floats, origin: tuple[float, float]) -> Floats:
    """Return metres east and north (..., 2) of the origin.

    Args:
        latitude: degrees, any shape.
        longitude: degrees, of the same shape.
        origin: latitude and longitude in degrees.
    """
    return np.stack(azimuthal(origin)(longitude, latitude), axis=-1)


def geodetic(position: Floats, origin: tuple[float, float]) -> tuple[Floats, Floats]:
    """Return latitude and longitude [degrees] of positions (..., 2) [m], as to `local_frame`."""
    longitude, latitude = azimuthal(origin)(position[..., 0], position[..., 1], inverse=True)
    return latitude, longitude


def metres_per_degree(origin: tuple[float, float]) -> tuple[float, float]:
    """Return the metres of a degree of latitude and of longitude at a place, by geodesics."""
    import pyproj

    globe = pyproj.Geod(ellps="WGS84")
    latitude, longitude = origin
    step = 1e-3  # degrees
    north = globe.inv(longitude, latitude - step / 2.0, longitude, latitude + step / 2.0)[2]
    east = globe.inv(longitude - step / 2.0, latitude, longitude + step / 2.0, latitude)[2]
    return north / step, east / step


def middle_of(degrees: Floats, left_out: float = 0.0, digits: int = 7) -> tuple[float, float]:
    """Return the middle of latitudes and longitudes (F, 2) [degrees], also at the 180th meridian.

    Args:
        degrees: of places less than half the globe apart.
        left_out: percentage of the places ignored at either end, since a few may be wrong.
        digits: of the result.
    """
    turned = np.column_stack([degrees[:, 0], _wrapped(degrees[:, 1] - degrees[0, 1])])
    latitude, longitude = np.percentile(turned, [left_out, 100.0 - left_out], axis=0).mean(axis=0)
    longitude = _wrapped(longitude + degrees[0, 1])
    return round(float(latitude), digits), round(float(longitude), digits)


def _wrapped(longitude: Any) -> Any:
    return (longitude + 180.0) % 360.0 - 180.0


def on_sphere(degrees: Floats) -> Floats:
    """Return places (F, 3) [m] on a spherical earth of coordinates (F, 2) [degrees]."""
    latitude, longitude = np.radians(degrees).T
    parallel = np.cos(latitude)
    return EARTH_RADIUS_M * np.column_stack(
        [parallel * np.cos(longitude), parallel * np.sin(longitude), np.sin(latitude)]
    )


def sites_of(degrees: Floats) -> Ints:
    """Return the number (F,) of the site of each place (F, 2) [degrees]; sites are 10 km apart."""
    place = np.floor(on_sphere(degrees) / _SITE_M)
    _, first, cell_of = np.unique(
        place @ (4096.0**2, 4096.0, 1.0), return_index=True, return_inverse=True
    )
    cells = place[first]
    i, j = cKDTree(cells).query_pairs(1.0, p=np.inf, output_type="ndarray").T
    is_neighbour = coo_array((np.ones(len(i), dtype=bool), (i, j)), shape=(len(cells), len(cells)))
    _, site = connected_components(is_neighbour, directed=False)
    return np.asarray(site, dtype=np.int64)[cell_of]


def in_own_frame(encounter: Encounter) -> Encounter:
    """Return an encounter in the frame about its middle, if it is far from its frame's origin."""
    distance = np.hypot(*encounter.position.reshape(-1, 2).T)
    if encounter.origin is None or not distance.max() > _OWN_FRAME_M:
        return encounter
    origin = middle_of(latitude_longitude(encounter).reshape(-1, 2), digits=5)
    position, heading = reprojected(
        encounter.position, encounter.heading, encounter.origin, azimuthal(origin)
    )
    return replace(encounter, position=position, heading=heading, origin=origin)


def reprojected(
    position: Floats, heading: Floats, origin: tuple[float, float], into: Any
) -> tuple[Floats, Floats]:
    """Return positions (..., 2) [m] and headings (...) [rad] in another projection.

    Args:
        position: metres east and north of the origin.
        heading: counter-clockwise from east.
        origin: latitude and longitude in degrees.
        into: a `pyproj.Proj`.
    """

    def project(places: Floats) -> Floats:
        latitude, longitude = geodetic(places, origin)
        return np.stack(into(longitude, latitude), axis=-1)

    projected = project(position)
    lever = project(position + _LEVER_M * unit(heading)) - projected
    course = np.arctan2(lever[..., 1], lever[..., 0])
    return projected, heading + wrap_angle(course - heading)


def latitude_longitude(encounter: Encounter) -> Floats:
    """Return latitude and longitude (N, T, 2) [degrees] of an encounter's positions.

    Raises:
        InputError: its log has metres, so its place on the globe is unknown.
    """
    if encounter.origin is None:
        raise InputError(
            f"encounter {encounter.name!r} has positions in metres without an origin, so it has "
            "no latitudes and longitudes"
        )
    return np.stack(geodetic(encounter.position, encounter.origin), axis=-1)


def parse_origin(text: str, parameter: str = "origin") -> tuple[float, float]:
    """Return latitude and longitude [degrees] of a text `latitude,longitude`.

    Raises:
        InputError: it does not have that form, or is not on the globe; names the parameter.
    """
    try:
        latitude, longitude = (float(part) for part in text.split(","))
    except ValueError as error:
        raise InputError(
            f"parameter {parameter} is {text!r}; write latitude,longitude in degrees"
        ) from error
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        raise InputError(f"parameter {parameter} is {text!r}; that is not a place on Earth")
    return latitude, longitude

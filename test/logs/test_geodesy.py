# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Logs in latitude and longitude, wherever on the globe and however far apart: each encounter is right about its own middle."""

import numpy as np
import pandas as pd
import pyproj
import pytest
from support.log_builders import save

from scenario_gen.logs import LogConfig, read_log
from scenario_gen.logs.geodesy import (
    geodetic,
    latitude_longitude,
    local_frame,
    metres_per_degree,
    middle_of,
    sites_of,
    utm,
)

GLOBE = pyproj.Geod(ellps="WGS84")


def crossing(origin, number=0, begin=0.0):
    """Two cars at a junction: one drives east, the other north and then left, to the west; rows of a table, and metres."""
    time = np.arange(0.0, 12.0, 0.1)
    east = np.column_stack([10.0 * (time - 6.0), 0.0 * time])
    turn = np.clip((time - 6.0) * 0.6, 0.0, np.pi / 2.0)
    left = 12.0 * np.column_stack([np.cos(turn) - 1.0, np.sin(turn)])
    left[:, 1] += 7.2 * np.minimum(time - 6.0, 0.0)
    left[:, 0] -= 7.2 * np.maximum(time - 6.0 - np.pi / 1.2, 0.0)
    frames = []
    for k, way in enumerate((east, left)):
        longitude, latitude, _ = GLOBE.fwd(
            np.full(len(way), origin[1]),
            np.full(len(way), origin[0]),
            np.degrees(np.arctan2(*way.T)),
            np.hypot(*way.T),
        )
        frames.append(
            pd.DataFrame(
                {
                    "utc_s": begin + time,
                    "vehicle_id": f"v{number}{k}",
                    "lat": latitude,
                    "lon": longitude,
                }
            )
        )
    return pd.concat(frames), np.stack([east, left])


def assert_right(encounter, metres, within=0.25):
    """Its shape is what was driven: distances between any two positions, turns to the same side, speeds and headings that fit."""
    places = encounter.position.reshape(-1, 2)
    wanted = metres[:, : encounter.position.shape[1]].reshape(-1, 2)
    off = (places - places.mean(axis=0)) - (wanted - wanted.mean(axis=0))
    assert np.abs(off).max() < within
    assert encounter.heading[1, -1] - encounter.heading[1, 0] == pytest.approx(
        np.pi / 2.0, abs=0.05
    )
    assert np.median(encounter.speed, axis=1) == pytest.approx([10.0, 7.2], rel=0.01)


@pytest.mark.parametrize(
    "origin",
    [(-16.8, 179.9999), (-16.8, -180.0), (64.0, 180.0), (42.3, -83.7), (0.0, 0.001), (51.5, 0.0)],
)
def test_junction_is_right_wherever_it_lies(tmp_path, origin):
    rows, metres = crossing(origin)
    (encounter,) = read_log(save(rows, tmp_path)).encounters
    assert_right(encounter, metres)


def test_sites_far_apart_are_each_right(tmp_path):
    sites = [
        (42.3, -83.7),
        (48.1, 11.6),
        (-16.8, 180.0),
        (42.3, -83.65),
    ]  # 6,700 km, the other side, and 4 km
    made = [crossing(origin, number, 3.0 * number) for number, origin in enumerate(sites)]
    found = read_log(
        save(pd.concat([rows for rows, _ in made]), tmp_path), LogConfig(max_vehicles=2)
    )
    assert len(found.encounters) == len(sites)
    for encounter, origin, (_, metres) in zip(found.encounters, sites, made, strict=True):
        assert_right(encounter, metres)
        degrees = latitude_longitude(encounter).reshape(-1, 2)
        away = GLOBE.inv(*np.broadcast_arrays(origin[1], origin[0], degrees[:, 1], degrees[:, 0]))[
            2
        ]
        assert away.max() < 100.0 and np.hypot(*encounter.position.reshape(-1, 2).T).max() < 4000.0


def test_given_origin_counts_for_all(tmp_path):
    rows, metres = crossing((42.3, -83.7))
    near = read_log(save(rows, tmp_path), LogConfig(origin="42.31,-83.7"))
    assert near.encounters[0].origin == (42.31, -83.7)
    assert_right(near.encounters[0], metres)


def test_id_at_two_sites_is_two(tmp_path):
    (here, metres), (there, _) = crossing((42.3, -83.7)), crossing((48.1, 11.6), begin=30.0)
    found = read_log(save(pd.concat([here, there]), tmp_path)).encounters
    assert [[vehicle.id for vehicle in one.vehicles] for one in found] == [["v00", "v01"]] * 2
    for encounter in found:
        assert_right(encounter, metres)


def test_chain_of_places_is_one_site():
    along = np.column_stack([np.full(100, 50.0), np.linspace(-181.0, -170.0, 100)])
    assert set(sites_of(along)) == {0}
    assert len(set(sites_of(np.vstack([along, along + 1.0])))) == 2
    assert middle_of(along) == (50.0, -175.5)
    assert middle_of(np.array([[1.0, 179.0], [1.0, -179.0]])) == (1.0, -180.0)


def test_there_and_back():
    wanted = np.random.default_rng(0).uniform(-5e4, 5e4, (50, 2))
    for origin in ((42.3, -83.7), (65.0, 179.9999)):
        assert local_frame(*geodetic(wanted, origin), origin) == pytest.approx(wanted, abs=1e-6)
        north, east = metres_per_degree(origin)
        found = local_frame(
            np.array([origin[0] + 0.001, origin[0]]),
            np.array([origin[1], origin[1] + 0.001]),
            origin,
        )
        assert found == pytest.approx(
            np.array([[0.0, 0.001 * north], [0.001 * east, 0.0]]), abs=0.01
        )


@pytest.mark.parametrize(
    ("place", "zone"),
    [
        ((48.1, 11.5), "32 north"), ((60.4, 5.3), "32 north"), ((55.9, 5.3), "31 north"),
        ((64.1, 5.3), "31 north"), ((60.4, 12.1), "33 north"), ((-33.9, 151.2), "56 south"),
        ((0.0, -180.0), "1 north"), ((10.0, 179.9), "60 north"), ((42.3, -83.7), "17 north"),
    ],
)  # fmt: skip
def test_utm_zone_is_that_of_place(place, zone):
    """In its own zone a place is within 3.5° of the central meridian, at 500 km east; Norway's is wider."""
    projection, name = utm(place)
    assert name == f"UTM zone {zone}"
    east, _ = projection(place[1], place[0])
    assert abs(east - 500_000.0) < 400_000.0
    assert projection(place[1], place[0]) == pytest.approx(
        pyproj.Proj(f"EPSG:{327 if 'south' in zone else 326}{zone.split()[0]:>02}")(
            place[1], place[0]
        ),
        abs=1e-3,
    )

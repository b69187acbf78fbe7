# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The local frame against PROJ."""

import numpy as np
import pyproj
import pytest

from scenario_gen.logs.geodesy import geodetic, local_frame


@pytest.mark.parametrize("origin", [(42.3, -83.7), (0.0, 10.0), (-33.0, 151.0), (65.0, 179.9999)])
@pytest.mark.parametrize(("far", "most"), [(1e3, 2e-8), (1e4, 1e-4), (5e4, 2e-3)])
def test_it_is_the_azimuthal_equidistant_projection(origin, far, most):
    wanted = np.random.default_rng(0).uniform(-far, far, (500, 2)) / np.sqrt(2.0)
    proj = pyproj.Proj(proj="aeqd", lat_0=origin[0], lon_0=origin[1], ellps="WGS84")
    longitude, latitude = proj(wanted[:, 0], wanted[:, 1], inverse=True)
    found = local_frame(latitude, longitude, origin)
    assert np.abs(found - wanted).max() <= most
    again = local_frame(*geodetic(found, origin), origin)
    assert np.abs(again - found).max() <= 1e-8


def test_the_origin_is_zero():
    assert local_frame(np.array([42.3]), np.array([-83.7]), (42.3, -83.7)).tolist() == [[0.0, 0.0]]

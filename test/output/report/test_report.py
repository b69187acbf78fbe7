# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The report's page as text and data; how it behaves in a browser is in test_evaluation_browser.py."""

from base64 import b64decode

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest
import shapely
from support.evaluation_worlds import report_case

from benchmarks._feature_matrix import feature_matrix
from scenario_gen.output.report.data import case_data, MATRIX_SIZE_CELLS, pack, road_data
from scenario_gen.output.report.page import render, ReportInput
from scenario_gen.roads import build_road
from scenario_gen.types import Road


@pytest.fixture(scope="module")
def page():
    cases = [report_case(), report_case(4, "a <script>alert(1)</script> name")]
    return render(
        ReportInput(cases, "Title & more", ("12 rows dropped",), {"log": "demo.mcap", "seed": "7"})
    )


@given(arrays(np.float64, (5, 3, 4), elements=st.floats(-1000, 1000)))
def test_packing_loses_little(values):
    packed = pack(values)
    whole = np.frombuffer(b64decode(packed["data"]), "<u2").reshape(packed["shape"])
    found = np.array(packed["low"]) + np.array(packed["step"]) * whole
    extent = np.ptp(values.reshape(-1, 4), axis=0)
    assert (np.abs(found - values) <= extent / 60000 + 1e-6).all()


def test_matrices_are_the_mean_feature():
    case = report_case(3)
    entry = case_data(case, 50)["features"][0]
    found = (
        np.frombuffer(b64decode(entry["position"]["with"]), np.uint8).reshape(
            MATRIX_SIZE_CELLS, MATRIX_SIZE_CELLS
        )
        / 255
    )
    motions = [scenario.with_samples(MATRIX_SIZE_CELLS) for scenario in case.generated.scenarios]
    np.testing.assert_allclose(
        found, np.mean([feature_matrix(*m.position) for m in motions], axis=0), atol=0.003
    )


def test_road_outline_has_no_cell_steps():
    size = 0.2
    row, column = np.indices((200, 300))
    slanted = np.abs(row - 60 - 0.3 * column) < 20  # cells along a slanted street
    slanted[90:110, 140:160] = False  # an island
    road = Road("r", slanted, size, np.array([5.0, -3.0]), np.zeros((0, 3)), np.zeros((0, 3)))
    drawn = road_data(road)["rings"]
    rings = [shapely.Polygon(np.reshape(ring, (-1, 2))) for ring in drawn]
    area = rings[0].difference(shapely.union_all(rings[1:]))
    assert area.area == pytest.approx(slanted.sum() * size**2, rel=0.02)
    assert len(rings) == 2 and sum(len(ring) for ring in drawn) < 60
    curve = build_road("curve")
    drawn = shapely.Polygon(np.reshape(road_data(curve)["rings"][0], (-1, 2)))
    for lane in curve.lanes.lanes:
        assert drawn.buffer(0.03).covers(shapely.LineString(lane.right))
        assert drawn.exterior.distance(shapely.Point(lane.right[60])) < 0.2

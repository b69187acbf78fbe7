# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The report's page as text and data; how it behaves in a browser is in test_evaluation_browser.py."""

from base64 import b64decode
from dataclasses import replace
import io
import json
import math
import re

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest
from rich.console import Console
import shapely
from support.evaluation_worlds import report_case

from scenario_gen.bags.recordings.read import read_recording
from scenario_gen.method.evaluation import coverage_of, feature_matrix
from scenario_gen.output.report.data import case_data, MATRIX_SIZE_CELLS, pack, road_data
from scenario_gen.output.report.page import render, ReportInput
from scenario_gen.output.report.summary import summary
from scenario_gen.output.results import write_results
from scenario_gen.roads import build_road
from scenario_gen.types import formatted, Interval, Road
from scenario_gen.types.fit import Loss


@pytest.fixture(scope="module")
def page():
    cases = [report_case(), report_case(4, "a <script>alert(1)</script> name")]
    return render(
        ReportInput(cases, "Title & more", ("12 rows dropped",), {"log": "demo.mcap", "seed": "7"})
    )


@given(arrays(np.float64, (5, 3, 4), elements=st.floats(-1000, 1000)))
def test_packing_loses_less_than_a_sixty_thousandth(values):
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


def test_a_road_is_drawn_without_the_steps_of_its_cells():
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


def test_what_the_fitting_lost_and_how_far_a_route_is_from_it_are_said(tmp_path):
    case = report_case(3)
    lost = Loss(
        "conflict",
        ("west", "south"),
        "vehicles west and south have crossing paths in the template only",
    )
    fitted = tuple(replace(one, turned=(0.1, 0.35)) for one in case.fit.fitted)
    routes = (
        replace(case.routes[0], joined=3, searched=0, farthest=0.04),
        replace(case.routes[1], joined=2, searched=1, farthest=2.25),
    )
    case = replace(case, fit=replace(case.fit, losses=(lost,), fitted=fitted), routes=routes)
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(summary([case], verbose=True))
    write_results(tmp_path, [case], title="", quality=(), provenance={})
    figures = json.loads((tmp_path / "evaluation.json").read_text())["cases"][0]
    for text in (console.export_text(), (tmp_path / "report.html").read_text(encoding="utf-8")):
        assert (
            lost.message in text
            and "vehicle south: its route passes 2.2 m from its fitted path" in text
        )
        assert (
            "5 legs joined at once, 1 searched for, at most 2.25 m from the fitted paths" in text
        )
    assert "6°, 20°" in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert figures["fit"]["lost"] == [
        {"kind": "conflict", "vehicles": ["west", "south"], "said": lost.message}
    ]
    assert figures["fit"]["vehicles"]["west"]["turned_on_road_deg"] == 20.1
    assert figures["routes"]["south"]["farthest_from_fit_m"] == 2.25
    read = read_recording(tmp_path / "bag").namespaces[""]
    assert read.fit[0].losses == (lost,) and [*map(str, read.fit[0].notes)] == [
        *map(str, case.fit.notes)
    ]  # a remark about a route is not a note
    assert [route.figures() for route in read.fit[1]] == [route.figures() for route in routes]


def test_the_verdict_says_how_critical_the_set_is_and_a_cap_is_no_measurement():
    case = report_case()
    case = replace(case, covered=coverage_of(case.encounter, case.generated.scenarios))
    metrics = tuple(
        replace(metric, cap=1000.0 if metric.id == "min_ttc" else None)
        for metric in case.evaluation.metrics
    )
    uncapped = replace(case, figures=replace(case.evaluation, metrics=metrics))
    least = min(filter(math.isfinite, case.coverage.spreads["ttc"].values), default=math.inf)
    assert math.isfinite(least) and f"minimum time to collision {least:.1f} s" in render(
        ReportInput([uncapped])
    )
    low = tuple(
        replace(metric, cap=least / 2 if metric.id == "min_ttc" else None)
        for metric in case.evaluation.metrics
    )
    page = render(ReportInput([replace(case, figures=replace(case.evaluation, metrics=low))]))
    assert f"time to collision: none below {least / 2:g} s" in page
    assert formatted(Interval(10.0, 10.0, 10.0), "s", cap=10.0) == "none below 10 s"
    assert formatted(Interval(9.9, 9.8, 10.0), "s", cap=10.0) == "9.9 [9.8, 10]"


def test_the_record_is_turned_as_it_lies_on_the_road():
    case = report_case(2)
    angle = 0.7
    turned = tuple(
        replace(one, anchors=np.add(one.anchors, [0.0, 0.0, angle])) for one in case.fit.fitted
    )
    before, after = (
        json.loads(re.search(r'"turn":([-\d.]+)', render(ReportInput([made]))).group(1))
        for made in (case, replace(case, fit=replace(case.fit, fitted=turned)))
    )
    assert (after - before - angle + math.pi) % (2 * math.pi) - math.pi == pytest.approx(
        0.0, abs=2e-3
    )

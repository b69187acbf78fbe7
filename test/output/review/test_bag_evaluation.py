# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A bag evaluated from its messages alone gives the figures of the scenarios that were put into it."""

from base64 import b64decode
from collections import Counter
from dataclasses import replace
from functools import cache, partial
import io

import numpy as np
from PIL import Image
import pytest
from support.bag_examples import copied, skipped
from support.browser_tab import DESKTOP, PHONE, Tab
from support.evaluation_worlds import report_case

from msg_conventions.diagnostics import decode_diagnostics, encode_diagnostics, of_template
from msg_conventions.topics import topic_entry
from scenario_gen.bags.recordings.read import read_recording
from scenario_gen.bags.recordings.write import write_recording
from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.bags.storage.writer import atomic_bag
from scenario_gen.base.errors import InputError
from scenario_gen.base.road_users import Dynamics
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.method.chain import Chain
from scenario_gen.method.evaluation import evaluate_scenarios, EvaluationConfig
from scenario_gen.method.segmentation import segment
from scenario_gen.method.validity import Limits
from scenario_gen.output.report.page import render, ReportInput, write_report
from scenario_gen.output.review.evaluation import evaluate_bag
from scenario_gen.pipeline import PipelineConfig
from scenario_gen.roads import build_road
from scenario_gen.situation import Situation
from scenario_gen.types.scenario import Cause, ScenarioSet

QUICK = PipelineConfig(evaluation=EvaluationConfig(resamples=50))


def results(bag, config=QUICK):
    """The measured scenarios of each namespace."""
    return [each.result for each in evaluate_bag(bag, config)]


@cache
def real_run():
    """The synthetic merging case on a straight road."""
    (encounter,) = read_log([bundled("c")]).encounters
    config = PipelineConfig()
    road = build_road("straight", encounter, config.road)
    return Chain(
        Situation.of(encounter),
        segment(encounter, config.segmentation, 7),
        road,
        config,
        count=3,
        seed=7,
    ).run()


def test_the_figures_survive_the_bag(tmp_path):
    cases = [report_case(6), report_case(4, "second")]
    bag = write_recording(tmp_path / "run", {"/case_1": cases[0], "/case_2": cases[1]})
    found = [result.evaluation for result in results(bag)]
    assert [evaluation.encounter for evaluation in found] == ["crossing", "second"]
    for evaluation, case in zip(found, cases, strict=True):
        assert evaluation.changepoints == 2
        for key in ("e_position", "e_speed", "js_speed", "min_distance", "pet", "diversity"):
            expected = case.evaluation.value("with changepoints", key)
            assert evaluation.value("scenarios", key) == pytest.approx(
                expected, rel=1e-6, abs=1e-9
            ), key
        assert 0.0 <= evaluation.value("scenarios", "acceptance") <= 1.0


def test_the_intervals_survive_it_too_where_candidates_were_refused(tmp_path):
    """Which scenarios mirror each other follows from their indices, not from their places in the bag."""
    case = report_case(6)
    numbered = [
        replace(s, index=k)
        for s, k in zip(case.generated.scenarios, (1, 2, 5, 8, 9, 3), strict=True)
    ]
    case = replace(case, generated=replace(case.generated, scenarios=tuple(numbered)))
    (found,) = (one.evaluation for one in results(write_recording(tmp_path / "run", case)))
    measure = partial(
        evaluate_scenarios,
        case.encounter,
        changepoints=len(case.segmentation.changepoints),
        config=QUICK.evaluation,
    )
    direct = measure(numbered)
    (row,), (expected,) = (
        [row for row in e.rows if row.name == "scenarios"] for e in (found, direct)
    )
    places = [replace(scenario, index=k) for k, scenario in enumerate(numbered)]
    (other,) = measure(places).rows[1:]
    for key in ("e_position", "e_speed", "diversity"):
        assert row.values[key].low == pytest.approx(expected.values[key].low, rel=1e-6), key
        assert row.values[key].high == pytest.approx(expected.values[key].high, rel=1e-6), key
        assert row.values[key].low != pytest.approx(other.values[key].low, rel=1e-3), key


def test_a_bag_without_scenarios_is_refused(tmp_path):
    case = report_case(2)
    empty = replace(case, generated=ScenarioSet(0, (), 0))
    with pytest.raises(InputError, match="nothing to evaluate"):
        results(write_recording(tmp_path / "run", empty))
    with pytest.raises(InputError, match="does not exist"):
        results(tmp_path / "missing")


def only(bag, folder, topics):
    """Copy the messages of these topics to another bag, as somebody else might have recorded it."""
    return copied(
        bag, folder, lambda message: message.data if message.topic.strip("/") in topics else None
    )


def test_a_bag_becomes_a_page_with_all_its_scenarios_valid_or_not(tmp_path):
    bag = write_recording(tmp_path / "run", report_case(5))
    (case,) = results(bag, replace(QUICK, limits=Limits(car=Dynamics(max_speed=9.0))))
    assert case.valid == 0 and case.published == 0 and len(case.generated.scenarios) == 5
    page = render(ReportInput([case]))
    assert "<b>0</b> of 5 requested scenarios" in page and ">0 / 5</td>" in page


def test_the_page_of_our_own_bag_shows_the_template_as_that_of_the_run(tmp_path):
    """Probabilities and sentences of the segmenter, fit and routes are in the bag, so they are on its page."""
    run = real_run()
    (case,) = results(write_recording(tmp_path / "run", run))
    assert case.fit is not None and [*map(str, case.fit.notes)] == [*map(str, run.fit.notes)]
    for found, known in zip(case.fit.fitted, run.fit.fitted, strict=True):
        assert found.manoeuvre == known.manoeuvre and found.scale == known.scale
        for key in ("anchors", "moved", "stands"):
            assert np.array_equal(getattr(found, key), getattr(known, key)), key
    for found, known in zip(case.routes, run.routes, strict=True):
        assert np.array_equal(found.points, known.points) and np.array_equal(
            found.anchor, known.anchor
        )
    assert case.segmentation.descriptions == run.segmentation.descriptions
    assert np.array_equal(case.segmentation.labels, run.segmentation.labels)
    assert np.allclose(
        case.segmentation.changepoint_probability,
        run.segmentation.changepoint_probability,
        atol=1e-6,
    )
    assert case.road.name == run.road.name
    page = render(ReportInput([case]))
    assert "<h2>Fit and routes</h2>" in page and run.segmentation.descriptions[0] in page


def test_that_page_in_a_browser(browser, tmp_path):
    """With fit and without, it loads without errors or requests, draws the routes and is no wider than the screen."""
    bag = write_recording(tmp_path / "run", real_run())
    bare = only(bag, tmp_path / "bare", ("tracks", "scenarios"))
    page = tmp_path / "report.html"
    write_report(page, ReportInput([*results(bag), *results(bare)]))
    for size in (DESKTOP, PHONE):
        tab = Tab(browser, page, size)
        routes = tab.page.locator('[data-case="0"] [data-role="routes"]')
        pixels = Image.open(
            io.BytesIO(b64decode(routes.evaluate("c => c.toDataURL()").partition(",")[2]))
        )
        assert len(pixels.getcolors(1_000_000)) > 10
        for case in (0, 1):
            tab.page.locator(f'[data-show="{case}"] button').click()
            assert tab.page.evaluate("document.documentElement.scrollWidth") <= size["width"]
        assert tab.troubles == [] and tab.asked() == [page.as_uri()]


def test_what_nodes_say_on_one_topic_is_told_apart_by_their_namespaces(tmp_path):
    run = real_run()
    bag = write_recording(tmp_path / "run", {"/here": run})
    with atomic_bag(tmp_path / "recorded") as copy:
        for message in read_messages(bag):
            topic = message.topic.replace("/here/diagnostics", "/diagnostics")
            kind, quality = topic_entry(topic)
            copy.add_topic(topic, kind, quality)
            if topic != "/diagnostics":
                copy.write(topic, message.data, message.stamp_ns)
                continue
            stamp, statuses = decode_diagnostics(message.data)
            for namespace, note in (("/here", None), ("/there", "of another suite")):
                said = [
                    replace(
                        s,
                        name=namespace + s.name,
                        values=s.values if note is None else dict.fromkeys(s.values, note),
                    )
                    for s in statuses
                ]
                for later in (1, 2):  # every second, with the time of the message
                    now = stamp + later * 10**9
                    copy.write(
                        topic, encode_diagnostics([of_template(s, stamp) for s in said], now), now
                    )
    (case,) = results(tmp_path / "recorded")
    assert case.fit is not None and [*map(str, case.fit.notes)] == [*map(str, run.fit.notes)]
    assert case.segmentation.descriptions == run.segmentation.descriptions


def test_the_bag_says_how_its_scenarios_were_made_and_what_was_refused(tmp_path):
    first = replace(real_run(), provenance={"log c": "sha256 12", "sampling.sigma": "1.0"})
    refused = replace(first.generated, candidates=5, refused=Counter({Cause.OVERLAP: 2}))
    second = replace(first, seed=8, generated=refused, provenance={"sampling.sigma": "1.0"})
    bag = write_recording(tmp_path / "run", {"/one": first, "/two": second})
    assert read_recording(bag).provenance == {
        "log c": "sha256 12",
        "sampling.sigma": "1.0",
        "seed": "7 | 8",
    }
    cases = results(bag)
    assert "by its own summary request 1 published 3 of 3 from 3 candidates" in map(
        str, cases[0].generated.adaptations
    )
    told = "by its own summary request 1 published 3 of 3 from 5 candidates, refused: overlap 2"
    assert told in map(str, cases[1].generated.adaptations) and told in render(ReportInput(cases))


def test_what_a_bag_does_not_hold_is_left_out_and_said(tmp_path):
    bag = only(
        write_recording(tmp_path / "run", report_case(5)),
        tmp_path / "bare",
        ("tracks", "scenarios"),
    )
    (found,) = evaluate_bag(bag, QUICK)
    case = found.result
    assert case.road is None and case.evaluation.changepoints == 0
    assert skipped(found)["off_road: no road is known"] == 5
    page = render(ReportInput([case]))
    assert "not checked in 5 scenarios: off_road: no road is known" in page
    assert '"road":null,' in page

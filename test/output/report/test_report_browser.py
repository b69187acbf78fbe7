# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The report in headless Chromium: no errors, no requests, it plays, scrubs and switches; nothing is wider than a phone."""

from base64 import b64decode
from dataclasses import replace
import io

from PIL import Image
import pytest
from support.browser_tab import DESKTOP, PHONE, Tab
from support.evaluation_worlds import ego_case, report_case

from scenario_gen.logs import read_log
from scenario_gen.method.evaluation import coverage_of
from scenario_gen.output.report.page import ReportInput, write_report


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_report(
        path,
        ReportInput(
            [report_case(6), report_case(4, "a_name_without_any_space_" * 4)],
            provenance={"log": "a" * 64},
        ),
    )
    return path


class Report(Tab):
    """The report, its parts found by their roles."""

    def part(self, role, case=0):
        return self.page.locator(f'[data-case="{case}"] [data-role="{role}"]')

    def time(self, case=0):
        return float(self.part("clock", case).inner_text().split("/")[0])

    def wait(self, condition):
        """Wait until something holds; half a minute is enough for a busy machine."""
        for _ in range(600):
            if condition():
                return
            self.page.wait_for_timeout(50)
        raise AssertionError("waited for half a minute")

    def picture(self, role, case=0):
        """The canvas as text: two pictures are equal if and only if their texts are."""
        return self.part(role, case).evaluate("canvas => canvas.toDataURL()")


@pytest.fixture
def tab(browser, report):
    tab = Report(browser, report, DESKTOP)
    yield tab
    tab.page.close()


def test_it_loads_without_errors_or_requests(tab, report):
    tab.page.wait_for_timeout(300)
    assert tab.troubles == []
    assert tab.asked() == [report.as_uri()]
    assert (
        tab.page.locator('[data-case="0"] .plot').count() == 10
    )  # shown scenario, recording, generated set, motion, six matrices
    for role in ("stage", "template-map", "routes", "samples-with"):
        pixels = Image.open(io.BytesIO(b64decode(tab.picture(role).partition(",")[2])))
        assert len(pixels.getcolors(1_000_000)) > 10, role


def test_link_opens_one_scenario(tab, report):
    tab.page.goto(f"{report.as_uri()}#case=2&scenario=2")
    assert tab.part("sample", 1).input_value() == "2"
    assert tab.page.locator('[data-case="0"]').is_hidden()
    tab.part("next", 1).click()
    assert tab.page.url.endswith("#case=2&scenario=3")
    tab.page.goto(f"{report.as_uri()}#case=9&scenario=nothing")
    assert tab.page.locator('[data-case="0"]').is_visible() and tab.troubles == []


def test_film_plays_pauses_and_stops(tab):
    meeting = tab.time()
    assert 0.5 < meeting < 12.0, "the first picture shows where the vehicles meet"
    tab.part("play").click()
    tab.wait(lambda: 0.2 < tab.time() < meeting)
    tab.part("play").click()
    paused = tab.time()
    tab.page.wait_for_timeout(200)
    assert tab.time() == paused
    tab.part("pace").select_option("4")
    tab.part("scrub").fill("970")
    tab.part("play").click()
    tab.wait(lambda: tab.time() == 12.0)
    tab.wait(lambda: tab.part("play").get_attribute("aria-label") == "play")


def test_scrubbing_moves_the_cars(tab):
    before = tab.picture("stage")
    tab.part("scrub").fill("500")
    assert tab.time() == 6.0
    assert tab.picture("stage") != before
    assert (
        tab.part("primitive").inner_text() == "segment 2 of 3: west drives on, south drives slowly"
    )
    assert "10.0 m/s" in tab.part("readout").inner_text()


def test_samples_and_sets_can_be_chosen(tab):
    assert tab.part("sample").locator("option").count() == 6
    before = tab.picture("stage")
    tab.part("next").click()
    assert tab.part("sample").evaluate("s => s.selectedIndex") == 1
    assert tab.picture("stage") != before
    tab.part("previous").click()
    tab.part("previous").click()
    assert tab.part("sample").evaluate("s => s.selectedIndex") == 5
    tab.part("arm").select_option("replay")
    assert tab.part("sample").locator("option").count() == 1
    alone = tab.picture("stage")
    tab.part("arm").select_option("with")
    assert tab.picture("stage") != alone
    crowd = tab.picture("stage")
    tab.part("ghosts").uncheck()
    assert tab.picture("stage") != crowd
    far = tab.picture("stage")
    tab.part("follow").check()
    assert tab.picture("stage") != far
    assert tab.troubles == []


def test_speed_chart_follows_the_film(tab):
    place = tab.part("speeds-now")
    cursor = place.locator(".cursor")
    before = cursor.get_attribute("x1")
    place.click(position={"x": 48 + 0.5 * (place.bounding_box()["width"] - 58), "y": 60})
    duration = float(tab.part("clock").inner_text().split("/")[1].removesuffix("s"))
    assert abs(tab.time() - duration / 2) < 0.2 and cursor.get_attribute("x1") != before
    drawn = place.inner_html()
    tab.part("next").click()
    assert place.inner_html() != drawn


def test_list_is_sorted_filtered_and_paged(browser, tmp_path):
    case = report_case(60)
    case = replace(case, covered=coverage_of(case.encounter, case.generated.scenarios))
    write_report(tmp_path / "report.html", ReportInput([case]))
    tab = Report(browser, tmp_path / "report.html", DESKTOP)
    drawn, lines = tab.part("drawn"), tab.part("list").locator("tr")
    assert drawn.inner_text() == "Listed and drawn: 1 to 50 of 60 scenarios."
    many = tab.picture("samples-with")
    tab.part("later").click()
    assert drawn.inner_text() == "Listed and drawn: 51 to 60 of 60 scenarios."
    assert lines.count() == 10 and tab.picture("samples-with") != many
    gaps = case.coverage.spreads["gap"].values
    tab.part("figure").select_option(label="minimum gap [m]")
    bound = round(sorted(gaps)[4] + 1e-3, 3)
    tab.part("high").fill(str(bound))
    count = sum(gap <= bound for gap in gaps)
    assert f"of {count} matching scenarios, out of 60" in drawn.inner_text()
    tab.part("list-head").get_by_role("button", name="minimum gap").click()
    lines.first.get_by_role("button").click()
    nearest = case.coverage.index[gaps.index(min(gaps))]
    assert tab.page.url.endswith(f"scenario={nearest}")
    assert lines.first.get_attribute("aria-current") == "true"
    tab.part("high").fill("-1")
    assert drawn.inner_text() == "No scenario matches." and tab.troubles == []
    tab.page.close()


def test_the_keyboard_drives_it(tab):
    tab.page.keyboard.press("ArrowRight")
    assert tab.part("sample").evaluate("s => s.selectedIndex") == 1
    before = tab.time()
    tab.page.keyboard.press("Space")
    tab.wait(lambda: tab.time() != before)
    tab.page.keyboard.press("Space")
    paused = tab.time()
    tab.page.wait_for_timeout(200)
    assert tab.time() == paused


def test_a_phone_shows_all_of_it(browser, report):
    tab = Report(browser, report, PHONE)
    tab.page.wait_for_timeout(300)
    assert tab.troubles == []
    wide = "all => all.filter(e => e.getBoundingClientRect().right > innerWidth + 1).map(e => e.outerHTML.slice(0, 90))"
    for case in (0, 1):
        tab.page.locator(f'[data-show="{case}"] button').click()
        tab.page.wait_for_timeout(100)
        assert tab.page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
        assert (
            tab.page.locator("section:not([hidden])")
            .locator("canvas, .chart svg, button, select")
            .evaluate_all(wide)
            == []
        )
    tab.page.set_viewport_size({"width": 800, "height": 600})  # turned
    tab.wait(
        lambda: abs(tab.part("stage", 1).evaluate("c => c.width / c.clientWidth") - 1.0) < 0.02
    )
    tab.page.close()


def test_ego_is_drawn_as_its_witness(browser, tmp_path):
    """The vehicle that is left out has a dashed outline and line of its own; nothing else breaks, with one vehicle left."""
    path = tmp_path / "ego.html"
    write_report(path, ReportInput([ego_case(4)]))
    tab = Report(browser, path, DESKTOP)
    tab.page.wait_for_timeout(300)
    assert tab.troubles == []
    assert (
        "Vehicle west is left out for a planner under test"
        in tab.page.locator("main").inner_text()
    )
    before = tab.picture("stage")
    tab.part("play").click()
    tab.wait(lambda: tab.picture("stage") != before)
    assert tab.troubles == []
    tab.page.close()


def test_scenario_is_downloaded(browser, tmp_path):
    write_report(tmp_path / "report.html", ReportInput([report_case(3)]))
    tab = Report(browser, tmp_path / "report.html", DESKTOP)
    tab.page.evaluate(
        "() => { const made = URL.createObjectURL; URL.createObjectURL = (blob) => made.call(URL, (window.given = blob)); }"
    )
    tab.part("next").click()
    with tab.page.expect_download() as csv:
        tab.part("csv").click()
    assert csv.value.suggested_filename == "scenario_1.csv"
    (tmp_path / "scenario_1.csv").write_text(tab.page.evaluate("given.text()"))
    (encounter,) = read_log(str(tmp_path / "scenario_1.csv")).encounters  # our own reader takes it
    assert {vehicle.id for vehicle in encounter.vehicles} == {
        "west",
        "south",
    } and encounter.duration == pytest.approx(12.0, abs=0.5)
    with tab.page.expect_download() as png:
        tab.part("png").click()
    assert png.value.suggested_filename == "scenario_1.png"
    drawn = tab.page.evaluate("given.arrayBuffer().then((bytes) => [...new Uint8Array(bytes)])")
    assert Image.open(io.BytesIO(bytes(drawn))).size[0] > 400
    assert tab.troubles == []
    tab.page.close()


@pytest.mark.parametrize(
    ("scheme", "size"), [("dark", PHONE), pytest.param("light", DESKTOP, marks=pytest.mark.long)]
)
def test_axe_finds_nothing_wrong(browser, report, scheme, size):
    axe = pytest.importorskip(
        "axe_playwright_python.sync_playwright", reason="axe-playwright-python is not installed"
    )
    context = browser.new_context(
        bypass_csp=True, color_scheme=scheme, viewport=size
    )  # axe runs in the page
    page = context.new_page()
    page.goto(report.as_uri())
    page.wait_for_timeout(200)
    found = axe.Axe().run(page).response["violations"]
    context.close()
    assert not [(one["id"], one["impact"], one["nodes"][0]["html"][:200]) for one in found]

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The page of the paper's figures in Chromium: no errors, no requests, all figures drawn, nothing wider than a phone."""

from browser_tab import DESKTOP, PHONE, Tab
import pytest

from benchmarks._paper_measure import run_case
from benchmarks.paper import write_page
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled

FIGURES = 4

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("reproduce")
    logs = [read_log([bundled(name)]) for name in ("a", "c")]
    cases = [run_case(log.encounters[0], count=4, seed=7) for log in logs]
    long = "a_name_without_any_space_" * 6
    write_page(folder, cases, quality=[f"{long} is a line of quality"], provenance={"log": "a" * 64, long: "a value"})
    return folder / "paper.html"


@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_it_loads_whole_and_asks_for_nothing(browser, page, size):
    tab = Tab(browser, page, size)
    figures = tab.page.locator(".js-plotly-plot")
    assert figures.count() == 2 * FIGURES
    for k in range(2 * FIGURES):
        figure = figures.nth(k)
        figure.scroll_into_view_if_needed()
        assert figure.is_visible() and figure.bounding_box()["height"] > 200
        assert figure.locator("svg.main-svg .trace, svg.main-svg image").count() > 3  # curves, or heat maps
    assert tab.page.evaluate("document.documentElement.scrollWidth") <= size["width"]
    assert tab.troubles == []
    assert tab.asked() == [page.as_uri()]
    tab.page.close()


def test_what_is_wider_than_a_phone_scrolls_in_its_own_frame(browser, page):
    """Four panels side by side stay legible; all else fits."""
    tab = Tab(browser, page, PHONE)
    wide = """all => all.filter(e => !e.closest(".figure") && e.getBoundingClientRect().right > innerWidth + 1)
        .map(e => e.outerHTML.slice(0, 90))"""
    assert tab.page.locator("body *").evaluate_all(wide) == []
    frame = tab.page.locator(".figure").first
    assert frame.evaluate("e => e.getBoundingClientRect().right <= innerWidth && e.scrollWidth > e.clientWidth")
    frame.evaluate("e => e.scrollLeft = 200")
    assert frame.evaluate("e => e.scrollLeft") == 200
    tab.page.close()

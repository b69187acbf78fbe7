# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The page of drives in a browser: a table that sorts, the figures of the drive beside it, the keyboard, a phone."""

import pytest
from support.bag_examples import hand_made_run
from support.browser_tab import DESKTOP, PHONE, Tab

from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.results import drawings, Drives
from scenario_gen.closed_loop.trials import run_trials, trials_of
from scenario_gen.output.report.html import render_page

PLANNER = "scenario_gen.closed_loop.planners:ConstantSpeed"


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    config, run = ClosedLoopConfig(), hand_made_run()
    trials = trials_of(run, run.encounter.vehicles[0].id)
    file = tmp_path_factory.mktemp("page") / "drives.html"
    file.write_text(Drives(run_trials(trials, PLANNER, config), PLANNER, config, trials).page())
    return file


def test_drives_are_sorted_chosen_and_played(browser, file):
    tab = Tab(browser, file, DESKTOP)
    column = "n => [...document.querySelectorAll('.drives tbody tr')].map(row => parseFloat(row.cells[n].textContent))"
    head = tab.page.get_by_role("button", name="gap [m]")
    head.click()
    gaps = tab.page.evaluate(column, 3)
    assert len(gaps) > 2 and gaps == sorted(gaps)
    head.click()
    assert tab.page.evaluate(column, 3) == gaps[::-1]
    row = tab.page.locator(".drives tbody tr").last
    row.click()
    assert row.get_attribute("aria-current") == "true"
    assert tab.page.locator("#figures dt").all_inner_texts()[1:3] == ["gap [m]", "minimum PET [s]"]
    assert (
        tab.page.locator("#figures dd").nth(1).inner_text()
        == row.locator("td").nth(3).inner_text()
    )
    tab.page.locator("h1").click()
    scrolled = tab.page.evaluate("scrollY")
    tab.page.keyboard.press("Space")
    assert tab.page.locator("#play").inner_text() == "❚❚", "it plays"
    assert tab.page.evaluate("scrollY") == scrolled
    assert tab.troubles == []
    assert tab.asked() == [file.as_uri()]
    tab.page.close()


def test_a_phone_shows_all_of_it(browser, file):
    tab = Tab(browser, file, PHONE)
    assert tab.page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    tab.page.close()


def test_search_page_without_failure_works(browser, tmp_path):
    words = {
        "planner": PLANNER,
        "title": "a on straight",
        "ego": "2",
        "objective": "at_fault",
        "sentences": ["no failure in 60 drives"],
    }
    scripts = ("scene.js", "drives.js", "tables.js")
    page = render_page(
        "search.html.j2", scripts, drawings([], [], []), **words, kinds={}, rows=[], parameters={}
    )
    file = tmp_path / "search.html"
    file.write_text(page)
    tab = Tab(browser, file, DESKTOP)
    assert tab.troubles == []
    assert "a failure is a collision that is its fault" in tab.page.locator("header").inner_text()
    tab.page.close()

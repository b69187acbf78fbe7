# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a hostile log or bag writes into its names runs nothing: pages have no script but ours and say each name as it is."""

from base64 import b64encode
from dataclasses import replace
from hashlib import sha256
from html.parser import HTMLParser
import re

import pytest
from support.browser_tab import DESKTOP, Tab
from support.evaluation_worlds import report_case

from scenario_gen.output.report.page import ReportInput, write_report
from scenario_gen.types import Note, NoteKind

RUNS = "top.ran=1"
HOSTILE = (
    f"</script><script>{RUNS}</script>",
    f'</script><img src=x onerror="{RUNS}">',
    f'"><svg onload="{RUNS}">',
    f"' onmouseover='{RUNS}' autofocus onfocus='{RUNS}' x='",
    f"</style></title></textarea><iframe srcdoc='<script>{RUNS}</script>'>",
    f'<a href="javascript:{RUNS}">press</a>',
    "{{7*7}}{% raw %}${7*7}%{x}<%= 7*7 %>",
    "\u202egnp.txt\u2066<b>\x1b[31m\x07",
    "<!--<script>",
    "\u2028alert(1)\u2029]]>",
)


class Elements(HTMLParser):
    """What a browser would make of the page's text: its scripts, its policy, its attributes."""

    def __init__(self, text):
        super().__init__()
        self.scripts, self.attributes, self.tags, self._kind = [], [], [], None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        if tag == "meta" and ("http-equiv", "Content-Security-Policy") in attrs:
            self.policy = dict(attrs)["content"]
        if tag == "script":
            self._kind = dict(attrs).get("type", "")
            self.scripts.append([self._kind, ""])

    def handle_endtag(self, tag):
        self._kind = None if tag == "script" else self._kind

    def handle_data(self, data):
        if self._kind is not None:
            self.scripts[-1][1] += data


def hostile_case(names):
    """The case of the report with hostile names wherever a log or a bag has its say."""
    case = report_case(4, name=names[0])
    ids = names[1:3]
    notes = tuple(Note.of(NoteKind.TEXT, text=name) for name in names)

    def renamed(vehicles):
        return tuple(
            replace(vehicle, id=known) for vehicle, known in zip(vehicles, ids, strict=True)
        )

    def made(group):
        return replace(
            group,
            scenarios=tuple(
                replace(s, vehicles=renamed(s.vehicles), frame_id=names[0])
                for s in group.scenarios
            ),
            adaptations=notes,
        )

    segmentation = replace(case.segmentation, descriptions=names[:3])
    return replace(
        case,
        encounter=replace(case.encounter, vehicles=renamed(case.encounter.vehicles)),
        segmentation=segmentation,
        road=replace(case.road, name=names[3]),
        fit=replace(
            case.fit,
            vehicles=renamed(case.fit.vehicles),
            fitted=tuple(replace(f, manoeuvre=names[4]) for f in case.fit.fitted),
            notes=notes,
        ),
        generated=made(case.generated),
        figures=replace(
            case.evaluation,
            vehicles=ids,
            rows=tuple(replace(row, notes=(*row.notes, *notes)) for row in case.evaluation.rows),
        ),
        replay=replace(case.replay, vehicles=renamed(case.replay.vehicles)),
    )


def hostile_report():
    return ReportInput(
        [hostile_case(HOSTILE), hostile_case(HOSTILE[3:])],
        HOSTILE[0],
        HOSTILE,
        {name: name for name in HOSTILE},
    )


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hostile")
    write_report(folder / "report.html", hostile_report())
    return folder / "report.html"


def test_policy_allows_only_our_scripts(page):
    found = Elements(page.read_text(encoding="utf-8"))
    ours = [text for kind, text in found.scripts if not kind]
    (data,) = (text for kind, text in found.scripts if kind == "application/json")
    assert "<" not in data
    allowed = re.search(r"script-src ([^;]*)", found.policy).group(1).split()
    assert allowed == [
        f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'" for text in ours
    ]
    assert "unsafe-eval" not in found.policy and "default-src 'none'" in found.policy
    assert not [key for key, _ in found.attributes if key.startswith("on")], (
        "no event handler stands in the page"
    )
    assert not {"img", "svg", "iframe", "a", "object", "embed", "base", "form"} & set(found.tags)


class Watched(Tab):
    """A tab that also keeps what the policy had to stop, and every dialog."""

    def __init__(self, browser, file, size):
        self.dialogs = []
        super().__init__(browser, file, size)

    def ran(self):
        return self.page.evaluate("'ran' in window") or bool(self.dialogs)


def test_hostile_names_run_nothing(browser, page):
    tab = Watched(browser, page, DESKTOP)
    tab.page.on("dialog", lambda dialog: (tab.dialogs.append(dialog.message), dialog.dismiss()))
    tab.page.wait_for_timeout(300)
    for case in (0, 1):
        tab.page.locator(f'[data-show="{case}"] button').click()
        part = tab.page.locator(f'[data-case="{case}"]')
        assert part.locator(".plot").count() > 3
        part.locator('[data-role="scrub"]').fill("500")
        for chart in part.locator(".plot").all()[:3]:
            chart.hover(force=True)  # its title shows names and sentences
            tab.page.wait_for_timeout(60)
    assert HOSTILE[1] in tab.page.locator('[data-case="0"] [data-role="readout"]').inner_text()
    assert tab.page.title() == HOSTILE[0]
    assert HOSTILE[6] in tab.page.locator("body").inner_text(), "it is said as it is"
    assert tab.troubles == [], "no error, and nothing that the policy had to stop"
    assert not tab.ran()
    assert tab.asked() == [page.as_uri()]
    tab.page.close()


def test_injected_script_is_not_run(browser, page, tmp_path):
    """Were escaping forgotten somewhere, the policy would stop what comes in: a script, a handler, an address, eval."""
    text = page.read_text(encoding="utf-8")
    inside = (
        "".join(HOSTILE[:6])
        + f'<img src="data:," onerror="{RUNS}"><button id="b" onclick="{RUNS}">b</button>'
    )
    page = tmp_path / "broken.html"
    page.write_text(text.replace("<main>", f"<main>{inside}", 1), encoding="utf-8")
    tab = Watched(browser, page, DESKTOP)
    tab.page.on("dialog", lambda dialog: (tab.dialogs.append(dialog.message), dialog.dismiss()))
    tab.page.locator("#b").dispatch_event("click")
    tab.page.wait_for_timeout(200)
    assert not tab.ran()
    assert any("Content Security Policy" in trouble for trouble in tab.troubles)
    tab.page.close()

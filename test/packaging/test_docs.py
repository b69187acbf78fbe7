# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What the pages name is there: files, links, public names, targets of make."""

import re

import pytest
from support.source_files import ROOT

import scenario_gen

PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "examples" / "README.md",
    ROOT / "benchmarks" / "README.md",
    *sorted((ROOT / "docs").glob("*.md")),
]


def anchors(page):
    """Return the anchors of a page's headings, as Markdown makes them."""
    titles = re.findall(r"^#+ (.+)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_of_a_page_lead_somewhere(page):
    text = page.read_text()
    named = {
        name
        for name in re.findall(r"`((?:scenario_gen|test|docs|examples|config)/[\w./]+)`", text)
        if "*" not in name
    }
    assert not [name for name in named if not (ROOT / name).exists()]
    links = {link.partition("#")[0] for link in re.findall(r"\]\((?!https?:)([^)]+)\)", text)} - {
        ""
    }
    assert not [link for link in links if not (page.parent / link).exists()]
    places = re.findall(r"\]\((?!https?:)([^)#]*)#([^)]+)\)", text)
    assert not [
        (link, anchor)
        for link, anchor in places
        if anchor not in anchors(page.parent / link if link else page)
    ]
    targets = set(re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert set(re.findall(r"`make ([a-z]+)", text)) <= targets


def test_contributing_names_existing_functions():
    rows = re.findall(
        r"^\|.*\| `(scenario_gen/[\w/]+\.py)` \| (`.*?`) \|$",
        (ROOT / "CONTRIBUTING.md").read_text(),
        re.MULTILINE,
    )
    names = [(file, name) for file, cell in rows for name in re.findall(r"(\w+)`", cell)]
    assert len(names) > 30
    assert not [
        (file, name)
        for file, name in names
        if not re.search(rf"(?:def|class) {name}\b", (ROOT / file).read_text())
    ]


def test_every_page_is_on_the_site():
    site = (ROOT / "docs" / "index.md").read_text().split()
    pages = {path.stem for path in (ROOT / "docs").glob("*.md")}
    assert pages - {"index"} <= set(site) and not pages & {"search", "genindex"}, (
        "Sphinx writes pages of these names itself"
    )


def test_the_version_is_the_same_everywhere():
    assert f"<version>{scenario_gen.__version__}</version>" in (ROOT / "package.xml").read_text()
    assert f"\nversion: {scenario_gen.__version__}\n" in (ROOT / "CITATION.cff").read_text()
    assert (
        re.search(r"^(\d+\.\d+\.\d+)\n-----$", (ROOT / "CHANGELOG.rst").read_text(), re.MULTILINE)[
            1
        ]
        == scenario_gen.__version__
    )

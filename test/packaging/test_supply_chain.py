# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What we depend on: bounds, locks, licences."""

import csv
import re
import tomllib
import xml.etree.ElementTree as ET

from licences import COPYLEFT, locked, REQUIREMENTS, run_time, TABLE
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from support.source_files import ROOT


def test_run_time_bounds_meet_the_lock():
    pins = locked()
    for wanted in run_time():
        assert [one.operator for one in wanted.specifier] == [">="], wanted
        assert wanted.specifier.contains(pins[canonicalize_name(wanted.name)]), wanted


def test_each_bound_stands_in_one_place():
    """Elsewhere a list may name what it needs beside pyproject.toml, and no file repeats a package."""
    bounded = {wanted.name for wanted in run_time()}
    assert len(run_time()) == len(bounded)
    for path in REQUIREMENTS.glob("*.in"):
        if not path.stem.startswith("judges"):  # environments of their own
            lines = path.read_text().splitlines()
            names = {Requirement(line).name for line in lines if line and line[0] != "#"}
            assert not names & bounded, path.name
    declared = [entry.text for entry in ET.parse(ROOT / "package.xml").iter("exec_depend")]
    assert len(declared) == len(set(declared))


def test_all_extras_are_in_all():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    included = {"scenario_gen"}
    for listed in (
        project["optional-dependencies"]["all"],
        *project["optional-dependencies"].values(),
    ):
        included |= {extra for text in listed for extra in Requirement(text).extras}
    assert set(project["optional-dependencies"]) <= included | {"ros", "test"}


def test_locks_pin_one_version():
    """They are installed one after the other; what a sourced Jazzy has itself is apart."""
    assert not {name: versions for name, versions in locked().items() if "," in versions}
    for name in ("core", "run", "extras", "test"):
        assert not re.findall(r"^ros-", (REQUIREMENTS / f"{name}.lock").read_text(), re.MULTILINE)


def test_locks_have_hashes():
    for path in REQUIREMENTS.glob("*.lock"):
        pinned = re.findall(r"^\S+==.*$", text := path.read_text(), re.MULTILINE)
        assert pinned and all(line.endswith("\\") for line in pinned), (
            f"{path.name}: each pin is followed by its hashes"
        )
        assert "://" not in text, path.name


def test_locked_packages_have_licences():
    with TABLE.open(newline="") as file:
        rows = list(csv.reader(file))[1:]
    assert {name: version for name, version, *_ in rows} == locked(), "make licences"
    assert not [name for name, _, stated, _ in rows if stated.strip() in ("", "unknown")]
    assert not [
        name for name, _, stated, need in rows if need == "run time" and COPYLEFT.search(stated)
    ]

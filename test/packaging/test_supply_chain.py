# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What we depend on: bounds, licences, and an audit that never says yes without having looked."""

import csv
import json
import re
import subprocess
import sys

from audit import CLEAN, judge, NOT_MADE, VULNERABLE
from licences import COPYLEFT, extras, installed, licence, locked, LOCKS, needed_at_run_time, REQUIREMENTS, run_time, TABLE
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
import pytest
from source_files import ROOT

EVERY_LOCK = sorted(path.name for path in REQUIREMENTS.glob("*.lock"))


@pytest.mark.parametrize("wanted", run_time(), ids=str)
def test_what_is_needed_at_run_time_has_a_lower_bound_that_the_lock_meets(wanted):
    assert [one.operator for one in wanted.specifier] == [">="]
    versions = locked()[canonicalize_name(wanted.name)].split(", ")
    assert all(wanted.specifier.contains(version) for version in versions)


def test_setup_py_asks_for_the_same(tmp_path):
    setup = (ROOT / "setup.py").read_text()
    assert 'python_requires=">=3.11,<3.14"' in setup
    assert all(f'needed("{name}.in")' in setup for name in ("core", "run", "extras", "ros"))
    out = subprocess.run([sys.executable, "setup.py", "--quiet", "egg_info", "--egg-base", tmp_path], cwd=ROOT, check=False)
    assert out.returncode == 0
    asked = {"core": set()}
    for line in (tmp_path / "scenario_gen.egg-info" / "requires.txt").read_text().split():
        if line.startswith("["):
            asked[line.strip("[]")] = names = set()
        else:
            (names if len(asked) > 1 else asked["core"]).add(Requirement(line).name)
    listed = {name: {one.name for one in wanted} for name, wanted in extras().items()}
    everything = set().union(*listed.values()) - listed["core"]
    apart = {"ompl", "gymnasium", "matplotlib", "betterosi", "fsspec", "s3fs", "aiohttp"}
    assert asked["core"] == listed["core"] and asked["all"] == everything == asked["corpus"] | apart
    assert asked["cli"] == everything - listed["corpus"] - apart
    assert asked["ros"] - everything == {"ros-jazzy-rclpy", "ros-jazzy-common-interfaces"}


def pins(name):
    """What a lock pins, with the versions."""
    return set(re.findall(r"^([^\s;]+)==([^\s;]+)", (REQUIREMENTS / f"{name}.lock").read_text(), re.MULTILINE))


def test_what_a_sourced_jazzy_has_itself_is_locked_apart():
    """`make` installs ros.lock and ros-test.lock only where no Jazzy is sourced."""
    for name in ("core", "run", "extras", "test"):
        assert not [package for package, _ in pins(name) if package.startswith("ros-")]
    assert "ros-rclpy" in dict(pins("ros")) and "numpy" in dict(pins("core"))


def test_what_two_locks_pin_has_one_version_in_both():
    """They are installed one after the other into one environment."""
    versions = {}
    for lock in LOCKS:
        for package in {package for package, _ in pins(lock.stem)}:
            versions.setdefault(package, set()).add(frozenset(version for name, version in pins(lock.stem) if name == package))
    assert not [package for package, found in versions.items() if len(found) > 1]


@pytest.mark.parametrize("name", EVERY_LOCK)
def test_a_lock_has_hashes_and_names_no_place(name):
    text = (REQUIREMENTS / name).read_text()
    pinned = re.findall(r"^\S+==.*$", text, re.MULTILINE)
    assert pinned and all(line.endswith("\\") for line in pinned), "each pin is followed by its hashes"
    assert "://" not in text


def test_every_locked_package_is_listed_with_its_licence():
    with TABLE.open(newline="") as file:
        rows = list(csv.reader(file))[1:]
    assert {name: version for name, version, *_ in rows} == locked(), "make licences"
    assert not [name for name, _, stated, _ in rows if stated.strip() in ("", "unknown")]
    assert not [name for name, _, stated, need in rows if need == "run time" and COPYLEFT.search(stated)]


def test_nothing_that_is_needed_at_run_time_is_under_the_gpl():
    known = installed()
    for name in needed_at_run_time(known):
        stated = licence(name, known[name])
        assert stated and not COPYLEFT.search(stated), f"{name}: {stated or 'no licence stated'}"


def audited(*packages):
    return json.dumps({"dependencies": list(packages), "fixes": []})


FINE = {"name": "a", "version": "1", "vulns": []}
SKIPPED = {"name": "b", "skip_reason": "Dependency not found and could not be audited: b (1)"}
KNOWN = {"name": "c", "version": "2", "vulns": [{"id": "CVE-1", "fix_versions": ["3"]}]}


@pytest.mark.parametrize(
    ("code", "out", "err", "expected", "said"),
    [
        (0, audited(FINE), "", CLEAN, "1 packages, none with a known vulnerability"),
        (1, audited(FINE, KNOWN), "", VULNERABLE, "c 2: CVE-1"),
        (0, audited(FINE, SKIPPED), "", NOT_MADE, "1 of 2 packages were skipped"),
        (1, audited(KNOWN, SKIPPED), "", NOT_MADE, "skipped"),
        (0, audited(), "", NOT_MADE, "it lists none"),
        (1, "", "Traceback\nProxyError: refused", NOT_MADE, "pip-audit ended with 1 (ProxyError: refused)"),
        (0, "[]", "", NOT_MADE, "it said nothing"),
        (1, audited(FINE), "", VULNERABLE, "0 known"),
    ],
)
def test_an_audit_that_did_not_look_is_no_success(code, out, err, expected, said):
    found, sentence = judge("core.lock", code, out, err)
    assert found == expected and said in sentence and len(sentence) <= 500

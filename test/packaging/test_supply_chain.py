# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What we depend on: bounds, locks, licences."""

import csv
import re
import subprocess
import sys

from licences import COPYLEFT, extras, locked, REQUIREMENTS, run_time, TABLE
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from support.source_files import ROOT


def test_what_is_needed_at_run_time_has_a_lower_bound_that_the_lock_meets():
    pins = locked()
    for wanted in run_time():
        assert [one.operator for one in wanted.specifier] == [">="], wanted
        assert wanted.specifier.contains(pins[canonicalize_name(wanted.name)]), wanted


def test_setup_py_asks_for_the_same(tmp_path):
    setup = (ROOT / "setup.py").read_text()
    assert 'python_requires=">=3.11,<3.14"' in setup
    assert all(f'needed("{name}.in")' in setup for name in ("core", "run", "extras", "ros"))
    out = subprocess.run(
        [sys.executable, "setup.py", "--quiet", "egg_info", "--egg-base", tmp_path],
        cwd=ROOT,
        check=False,
    )
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
    assert (
        asked["core"] == listed["core"] and asked["all"] == everything == asked["corpus"] | apart
    )
    assert asked["cli"] == everything - listed["corpus"] - apart
    assert asked["ros"] - everything == {"ros-jazzy-rclpy", "ros-jazzy-common-interfaces"}


def test_what_locks_pin_has_one_version_in_all_of_them_and_for_every_python():
    """They are installed one after the other; what a sourced Jazzy has itself is apart."""
    assert not {name: versions for name, versions in locked().items() if "," in versions}
    for name in ("core", "run", "extras", "test"):
        assert not re.findall(r"^ros-", (REQUIREMENTS / f"{name}.lock").read_text(), re.MULTILINE)


def test_locks_have_hashes_and_name_no_place():
    for path in REQUIREMENTS.glob("*.lock"):
        pinned = re.findall(r"^\S+==.*$", text := path.read_text(), re.MULTILINE)
        assert pinned and all(line.endswith("\\") for line in pinned), (
            f"{path.name}: each pin is followed by its hashes"
        )
        assert "://" not in text, path.name


def test_every_locked_package_is_listed_with_its_licence():
    with TABLE.open(newline="") as file:
        rows = list(csv.reader(file))[1:]
    assert {name: version for name, version, *_ in rows} == locked(), "make licences"
    assert not [name for name, _, stated, _ in rows if stated.strip() in ("", "unknown")]
    assert not [
        name for name, _, stated, need in rows if need == "run time" and COPYLEFT.search(stated)
    ]

# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What colcon and pip install: the files they need say the same things."""

import importlib
import os
from pathlib import Path
import re
import subprocess
import sys
import xml.etree.ElementTree as ET

import pytest
from source_files import ROOT


def test_package_xml_agrees_with_setup_py():
    package = ET.parse(ROOT / "package.xml").getroot()
    setup = (ROOT / "setup.py").read_text()
    assert package.get("format") == "3"
    assert package.findtext("name") == "scenario_gen"
    assert f'version="{package.findtext("version")}"' in setup
    assert package.findtext("license") == "Apache-2.0"
    assert package.findtext("export/build_type") == "ament_python"
    assert (ROOT / "resource" / "scenario_gen").is_file()
    assert "Apache License" in (ROOT / "LICENSE").read_text()


def test_every_ros_package_that_is_imported_is_declared():
    declared = {entry.text for entry in ET.parse(ROOT / "package.xml").getroot().findall("exec_depend")}
    imported = set()
    for path in [*(ROOT / "scenario_gen").rglob("*.py"), *(ROOT / "msg_conventions").rglob("*.py")]:
        imported |= set(re.findall(r"^\s*from (\w+)\.(?:msg|srv) import", path.read_text(), re.MULTILINE))
    assert imported <= declared, imported - declared


def test_every_executable_exists(tmp_path):
    subprocess.run(
        [sys.executable, "setup.py", "--quiet", "egg_info", "--egg-base", str(tmp_path)],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    lines = (tmp_path / "scenario_gen.egg-info" / "entry_points.txt").read_text().splitlines()
    scripts = dict(line.split(" = ") for line in lines if " = " in line)
    assert {"scenario-gen", "segmenter", "planner", "gp_sampler", "road_server", "log_player", "evaluator", "recorder"} <= set(
        scripts
    )
    for name, target in scripts.items():
        module, _, function = target.partition(":")
        assert callable(getattr(importlib.import_module(module), function)), name
        if module.endswith(".start"):
            assert (ROOT / "scenario_gen" / "nodes" / f"{name}.py").is_file()


def test_script_directories_suit_ros2_run():
    text = (ROOT / "setup.cfg").read_text()
    assert "[develop]\nscript_dir=$base/lib/scenario_gen" in text
    assert "[install]\ninstall_scripts=$base/lib/scenario_gen" in text


@pytest.fixture(scope="module")
def colcon(tmp_path_factory):
    """What runs a verb of colcon on this package, with everything that it writes in one folder outside of it."""
    base = tmp_path_factory.mktemp("workspace")

    def run(verb, *options):
        command = [Path(sys.executable).with_name("colcon"), "--log-base", base / "log", verb, *options]
        return subprocess.run(command, cwd=base, capture_output=True, text=True, check=False)

    places = ("--base-paths", ROOT, "--build-base", base / "build", "--install-base", base / "install")
    built = run("build", *places)
    assert built.returncode == 0, built.stderr
    return base, places, run


def test_colcon_builds_what_ros2_run_needs(colcon):
    """A real colcon build: executables in lib/, the ament index entry, and an executable that runs from there."""
    base, _, _ = colcon
    prefix = base / "install" / "scenario_gen"
    names = "segmenter planner gp_sampler road_server log_player evaluator recorder player suite scenario-gen"
    nodes = set(names.split())
    assert nodes <= {path.name for path in (prefix / "lib" / "scenario_gen").iterdir()}
    assert (prefix / "share" / "ament_index" / "resource_index" / "packages" / "scenario_gen").is_file()
    for file in ("package.xml", "config/default.yaml", "launch/suite.launch.py"):
        assert (prefix / "share" / "scenario_gen" / file).is_file()
    (packages,) = prefix.glob("lib/python3*/site-packages")
    assert (packages / "scenario_gen" / "resources" / "synthetic_a").is_dir()
    assert (packages / "scenario_gen" / "nodes" / "loopback.xml").is_file()
    ran = subprocess.run(
        [sys.executable, prefix / "lib" / "scenario_gen" / "scenario-gen", "parameters"],
        cwd=base,
        env=os.environ | {"PYTHONPATH": str(packages)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0 and "sampling.lateral_sigma" in ran.stdout, ran.stderr


def test_colcon_test_runs_pytest_and_reports(colcon):
    """A real colcon test, of what is quick: `colcon test` itself runs the whole suite, this test among it."""
    base, places, run = colcon
    quick = [f"test/{name}.py" for name in ("packaging/test_copyright", "packaging/test_xmllint", "test_architecture")]
    tested = run("test", *places, "--return-code-on-test-failure", "--pytest-args", *quick)
    assert tested.returncode == 0, tested.stdout + tested.stderr
    result = run("test-result", "--test-result-base", base / "build", "--all")
    assert result.returncode == 0
    found = re.search(r"Summary: (\d+) tests, 0 errors, 0 failures, (\d+) skipped", result.stdout)
    assert found is not None and int(found[1]) > 100, result.stdout

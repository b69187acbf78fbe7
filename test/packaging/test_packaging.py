"""What colcon and pip install: the files they need say the same things."""

import importlib
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


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


def test_colcon_builds_what_ros2_run_needs(tmp_path):
    """A real colcon build: executables in lib/, the ament index entry, and an executable that runs from there."""
    command = [Path(sys.executable).with_name("colcon"), "--log-base", tmp_path / "log", "build", "--base-paths", ROOT]
    command += ["--build-base", tmp_path / "build", "--install-base", tmp_path / "install"]
    built = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    prefix = tmp_path / "install" / "scenario_gen"
    nodes = {"segmenter", "planner", "gp_sampler", "road_server", "log_player", "evaluator", "recorder", "player", "scenario-gen"}
    assert nodes <= {path.name for path in (prefix / "lib" / "scenario_gen").iterdir()}
    assert (prefix / "share" / "ament_index" / "resource_index" / "packages" / "scenario_gen").is_file()
    for file in ("package.xml", "config/default.yaml", "launch/suite.launch.py"):
        assert (prefix / "share" / "scenario_gen" / file).is_file()
    (packages,) = prefix.glob("lib/python3*/site-packages")
    assert (packages / "scenario_gen" / "resources" / "synthetic_a").is_dir()
    ran = subprocess.run(
        [sys.executable, prefix / "lib" / "scenario_gen" / "scenario-gen", "parameters"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(packages)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0 and "sampling.lateral_sigma" in ran.stdout, ran.stderr

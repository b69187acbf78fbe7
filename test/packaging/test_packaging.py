# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What colcon and pip install: the files they need say the same things."""

import importlib
import os
from pathlib import Path
import re
import subprocess
import sys
import tarfile
import tomllib
import xml.etree.ElementTree as ET

from catkin_pkg.package import parse_package
import pytest
from support.source_files import ROOT

from scenario_gen.ros.node_names import ALL


@pytest.mark.linter
def test_package_xml_is_valid():
    warnings = []
    package = parse_package(ROOT, warnings=warnings)
    assert (package.name, package.package_format, package.get_build_type()) == (
        "scenario_gen",
        3,
        "ament_python",
    )
    assert not warnings


def test_imported_ros_packages_are_declared():
    declared = {
        entry.text for entry in ET.parse(ROOT / "package.xml").getroot().findall("exec_depend")
    }
    imported = set()
    for path in [
        *(ROOT / "scenario_gen").rglob("*.py"),
        *(ROOT / "msg_conventions").rglob("*.py"),
    ]:
        imported |= set(
            re.findall(r"^\s*from (\w+)\.(?:msg|srv) import", path.read_text(), re.MULTILINE)
        )
    assert imported <= declared, imported - declared


@pytest.mark.parametrize("sourced", [False, True])
def test_sourced_jazzy_keeps_its_rclpy(tmp_path, sourced):
    package = tmp_path / "lib" / "rclpy"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    environment = {
        name: value
        for name, value in os.environ.items()
        if name not in ("AMENT_PREFIX_PATH", "MAKEFLAGS")
    }
    if sourced:
        environment |= {
            "AMENT_PREFIX_PATH": f"/none:{tmp_path}",
            "PYTHONPATH": str(package.parent),
        }
    else:  # wheels in an active virtual environment are no Jazzy
        environment |= {"AMENT_PREFIX_PATH": sys.prefix}
    command = ["make", "--dry-run", "--always-make", "install", f"PYTHON={sys.executable}"]
    said = subprocess.run(
        command, cwd=ROOT, env=environment, check=True, capture_output=True, text=True
    ).stdout
    assert "-r requirements/core.lock" in said
    assert ("-r requirements/ros.lock" in said) is not sourced
    assert ("--system-site-packages" in said) is sourced


def test_every_node_has_an_executable():
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    files = {path.stem for path in (ROOT / "scenario_gen" / "ros" / "nodes").glob("[!_]*.py")}
    assert set(scripts) == {"scenario-gen", "suite", *files} and files == set(ALL)
    for name, target in scripts.items():
        module, _, function = target.partition(":")
        assert callable(getattr(importlib.import_module(module), function)), name


def test_colcon_builds_what_ros2_run_needs(tmp_path):
    """A real colcon build: executables in lib/, the ament index entry, and an executable that runs from there."""
    command = [Path(sys.executable).with_name("colcon"), "--log-base", tmp_path / "log", "build"]
    command += ["--base-paths", ROOT, "--build-base", tmp_path / "build"]
    command += ["--install-base", tmp_path / "install"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    prefix = tmp_path / "install" / "scenario_gen"
    names = "segmenter planner gp_sampler road_server log_player evaluator recorder player suite scenario-gen"
    nodes = set(names.split())
    executables = list((prefix / "lib" / "scenario_gen").iterdir())
    assert nodes <= {path.name for path in executables}
    for path in executables:  # `ros2 run` takes what can be executed; the packages are those of the Python that ran colcon
        assert os.access(path, os.X_OK) and path.read_text().startswith(f"#!{sys.executable}\n"), (
            path
        )
    assert (
        prefix / "share" / "ament_index" / "resource_index" / "packages" / "scenario_gen"
    ).is_file()
    share = prefix / "share" / "scenario_gen"
    shared = [
        *ROOT.glob("config/*.*"),
        *ROOT.glob("launch/*.py"),
        *ROOT.glob("examples/*.*"),
        ROOT / "package.xml",
    ]
    assert {str(path.relative_to(ROOT)) for path in shared} <= {
        str(p.relative_to(share)) for p in share.rglob("*")
    }
    (packages,) = prefix.glob("lib/python3*/site-packages")
    assert (packages / "scenario_gen" / "resources" / "synthetic_a").is_dir()
    assert (packages / "scenario_gen" / "resources" / "loopback.xml").is_file()
    assert all(
        (packages / name / "py.typed").is_file() for name in ("scenario_gen", "msg_conventions")
    )
    command = [sys.executable, prefix / "lib" / "scenario_gen" / "scenario-gen", "--help"]
    variables = os.environ | {"PYTHONPATH": str(packages)}
    ran = subprocess.run(
        command, cwd=tmp_path, env=variables, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0 and "generate" in ran.stdout, ran.stderr


def test_source_distribution_is_complete(tmp_path):
    command = [sys.executable, "setup.py", "--quiet", "egg_info", "--egg-base", tmp_path]
    subprocess.run([*command, "sdist", "--dist-dir", tmp_path], cwd=ROOT, check=True)
    (archive,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(archive) as file:
        names = {name.partition("/")[2] for name in file.getnames()}
    assert {"README.md", "CITATION.cff", "SECURITY.md", "pyproject.toml", "package.xml"} <= names
    assert {"docs/index.md", "config/suite.yaml", "launch/suite.launch.py"} <= names

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The C++ example is compiled where a Jazzy with rclcpp is sourced."""

from pathlib import Path
import subprocess

import pytest
from support.skips import NO_LAUNCH

index = pytest.importorskip("ament_index_python.packages", reason=NO_LAUNCH)
SOURCE = Path(__file__).resolve().parents[2] / "examples" / "cpp"


def test_it_compiles(tmp_path):
    try:
        index.get_package_prefix("rclcpp")
    except index.PackageNotFoundError:
        pytest.skip(NO_LAUNCH)
    subprocess.run(["cmake", "-S", SOURCE, "-B", tmp_path], check=True)
    subprocess.run(["cmake", "--build", tmp_path], check=True)
    assert (tmp_path / "scenario_listener").is_file()

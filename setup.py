# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The files that ament expects in share/; the metadata is in pyproject.toml."""

from pathlib import Path

from setuptools import setup

SHARE = "share/scenario_gen"


def files(folder: str, pattern: str = "*.*") -> tuple[str, list[str]]:
    """Return the destination of a folder's files, and their paths."""
    return f"{SHARE}/{folder}", sorted(map(str, Path(folder).glob(pattern)))


setup(
    python_requires=">=3.11,<3.14",  # colcon cannot read it from pyproject.toml
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/scenario_gen"]),
        # `colcon build --symlink-install` runs this file in a folder with only these files.
        (SHARE, ["package.xml", "pyproject.toml", "README.md"]),
        files("config"),
        files("launch", "*.launch.py"),
        files("examples"),
        files("examples/cpp"),
    ],
)

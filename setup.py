# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Build rules for colcon (ament_python) and pip alike; tool settings are in pyproject.toml."""

from itertools import chain
from pathlib import Path

from setuptools import find_packages, setup

NAME = "scenario_gen"
NODES = (
    "segmenter",
    "planner",
    "gp_sampler",
    "road_server",
    "log_player",
    "evaluator",
    "preview",
    "recorder",
    "player",
    "traffic",
    "suite",
)

# ROS itself comes from a Jazzy installation, or from wheels as an extra.


def needed(name: str) -> dict[str, list[str]]:
    """Return what a list of requirements asks for at run time, by the heading above it."""
    found: dict[str, list[str]] = {}
    for line in (
        Path("requirements", name)
        .read_text(encoding="utf-8")
        .partition("# to build")[0]
        .splitlines()
    ):
        if line.startswith("#"):
            heading = line.removeprefix("# ").removeprefix("extra ")
        elif line:
            found.setdefault(heading, []).append(line)
    return found


EXTRAS = needed("run.in") | needed("extras.in")
CORE = needed("core.in")["core"]
EXTRAS["segmentation"] = [
    wanted for wanted in CORE if wanted.startswith(("numpy", "scipy", "numba", "filelock"))
]  # all that it needs of the core
EXTRAS["cli"] += [*EXTRAS["bags"], *EXTRAS["parquet"], *EXTRAS["report"]]
EXTRAS["all"] = [
    *EXTRAS["cli"],
    *EXTRAS["plot"],
    *EXTRAS["planners"],
    *EXTRAS["gym"],
    *EXTRAS["corpus"],
    *EXTRAS["osi"],
    *EXTRAS["stores"],
]
EXTRAS["corpus"] += EXTRAS["cli"]  # whose commands it adds to
EXTRAS["ros"] = [*EXTRAS["all"], *chain.from_iterable(needed("ros.in").values())]

setup(
    name=NAME,
    version="0.6.0",
    description="New multi-vehicle traffic encounters from recorded ones, as a library, as one command and as ROS 2 nodes",
    license="Apache-2.0",
    maintainer="The scenario_gen developers",
    maintainer_email="scenario_gen@users.noreply.github.com",
    python_requires=">=3.11,<3.14",
    packages=find_packages(include=["scenario_gen*", "msg_conventions*"]),
    package_data={
        NAME: [
            "py.typed",
            "*.pyi",
            "resources/*",
            "resources/**/*",
            "output/report/assets/*",
            "corpus/*.sql",
        ],
        "msg_conventions": ["py.typed"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", [str(path) for path in sorted(Path("config").glob("*.*"))]),
        (
            f"share/{NAME}/launch",
            [str(path) for path in sorted(Path("launch").glob("*.launch.py"))],
        ),
        (f"share/{NAME}/examples", [str(path) for path in sorted(Path("examples").glob("*.*"))]),
    ],
    install_requires=CORE,
    extras_require=EXTRAS | {"test": ["pytest"]},  # by which colcon knows how to test
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "scenario-gen = scenario_gen.__main__:main",
            *(f"{node} = scenario_gen.ros.common.start:main" for node in NODES),
        ],
    },
)

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a command loads: libraries that it does not need are not imported, for each costs every start a tenth of a second."""

import json
import subprocess
import sys

import pytest

from scenario_gen import bundled

HEAVY = {
    *("dask", "distributed", "duckdb", "gymnasium", "IPython", "jsonschema", "matplotlib", "ompl", "pandas", "pyarrow"),
    *(
        "plotly.graph_objs",
        "rclpy",
        "scipy.interpolate",
        "scipy.optimize",
        "scipy.signal",
    ),
    *("scipy.stats", "sklearn"),
}
RUN = """
import atexit, json, sys
from scenario_gen.__main__ import main
atexit.register(lambda: json.dump(sorted(sys.modules), sys.stderr))
main()
"""


def loaded(*words):
    """The names of the modules that a command has imported by its end."""
    ran = subprocess.run([sys.executable, "-c", RUN, *map(str, words)], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return set(json.loads(ran.stderr.splitlines()[-1]))


def test_help_loads_no_library_of_numbers():
    assert sorted(loaded("--help") & {*HEAVY, "numba", "numpy", "shapely", "PIL", "rosbags", "clarabel", "yaml"}) == []


@pytest.fixture(scope="module")
def generated(tmp_path_factory):
    out = tmp_path_factory.mktemp("warm") / "out"
    return loaded("generate", bundled("b"), "--road", "four_way", "--count", "2", "--seed", "7", "--out", out)


def test_generate_loads_what_it_uses_alone(generated):
    assert {"numba", "clarabel", "jinja2"} <= generated
    assert sorted(generated & HEAVY) == []

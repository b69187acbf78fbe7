# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The examples that use the library without ROS run, and the notebook shows what it was when it ran."""

import json
from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def test_script_generates_without_ros():
    script = f"runpy.run_path({str(EXAMPLES / 'generate.py')!r}, run_name='__main__')"
    command = f"import runpy, sys; sys.modules['rclpy'] = None; sys.argv = ['generate.py', '--count', '4']; {script}"
    ran = subprocess.run(
        [sys.executable, "-c", command], capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    assert "synthetic_a on t_intersection: 4 of " in ran.stdout
    assert "without vehicle 1: 2; its reference drive is there" in ran.stdout


@pytest.mark.parametrize(("name", "pictures"), [("tour.ipynb", 2), ("segmentation.ipynb", 0)])
def test_the_notebook_was_executed_and_runs(name, pictures, capsys):
    import matplotlib
    from matplotlib import pyplot

    matplotlib.use("agg")
    cells = [
        cell
        for cell in json.loads((EXAMPLES / name).read_text())["cells"]
        if cell["cell_type"] == "code"
    ]
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    namespace = {}
    for cell in cells:
        shown = "".join(
            "".join(output["text"])
            for output in cell["outputs"]
            if output["output_type"] == "stream"
        )
        assert not [output for output in cell["outputs"] if output["output_type"] == "error"]
        exec(compile("".join(cell["source"]), name, "exec"), namespace)
        assert capsys.readouterr().out == shown, "execute the notebook again"
    pyplot.close("all")
    assert (
        sum("image/png" in output.get("data", {}) for cell in cells for output in cell["outputs"])
        == pictures
    )


def test_drive_env_notebook_was_executed(monkeypatch):
    """Learning takes a minute, so it is not repeated; one drive with the policy is."""
    cells = [
        cell
        for cell in json.loads((EXAMPLES / "drive_env.ipynb").read_text())["cells"]
        if cell["cell_type"] == "code"
    ]
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    assert not [
        output for cell in cells for output in cell["outputs"] if output["output_type"] == "error"
    ]
    monkeypatch.chdir(EXAMPLES)
    namespace = {}
    for cell in cells[:2]:
        code = "".join(cell["source"]).replace("count=8", "count=2").replace("count=20", "count=1")
        exec(compile(code, "drive_env.ipynb", "exec"), namespace)
    total, passed = namespace["drive"](namespace["env"], np.zeros(5), 0)
    assert np.isfinite(total) and passed in (True, False)

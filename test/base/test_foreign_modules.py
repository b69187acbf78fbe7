# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Files beside the data are neither run nor obeyed by a command and the processes it starts."""

import os
import subprocess
import sys

import pytest
from support.source_files import ROOT

MODULES = ("multiprocessing", "pickle", "runpy", "numpy", "numba", "rclpy", "scenario_gen")
PROGRAMS = {
    "local processes": """
from scenario_gen.corpus.tasks import spread, Workers
from support.refusing import Counted, write_once
from pathlib import Path
with spread(Workers(2)) as run:
    print(run(write_once, [Counted(str(k), Path("out")) for k in range(2)]))
""",
    "a planner's processes": """
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.trials import trial_runner
with trial_runner("scenario_gen.closed_loop.planners:ConstantSpeed", ClosedLoopConfig(), 2) as run:
    print(list(run([])))
""",
    "compilers of kernels": """
import os
os.environ["NUMBA_CACHE_DIR"] = os.getcwd() + "/kernels"
from scenario_gen.numerics import boxes
from scenario_gen.numerics.compiling import make_ready
from scenario_gen.numerics.kernels import registered
smallest = min(registered(), key=lambda kernel: kernel.size)
make_ready([smallest])
assert smallest.mark.exists()
""",
}


@pytest.mark.parametrize("program", PROGRAMS.values(), ids=PROGRAMS)
def test_the_current_folder_is_not_searched(tmp_path, program):
    data, command = tmp_path / "data", tmp_path / "command.py"
    data.mkdir()
    (data / "out").mkdir()
    for name in MODULES:
        text = f"open({str(tmp_path / 'run')!r}, 'a').write({name!r})\nraise SystemExit(3)\n"
        (data / f"{name}.py").write_text(text)
    command.write_text(f"if __name__ == '__main__':\n    exec({program!r})\n")
    paths = [str(ROOT), str(ROOT / "test"), os.environ.get("PYTHONPATH", "")]
    result = subprocess.run(
        [sys.executable, str(command)],
        cwd=data,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert not (tmp_path / "run").exists(), (tmp_path / "run").read_text()
    assert "Traceback" not in result.stderr, result.stderr

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The walk through the code in CONTRIBUTING.md: a command enters these files in this order, and every function named is there."""

import ast
from pathlib import Path
import re
import subprocess
import sys

from scenario_gen import bundled

ROOT = Path(__file__).resolve().parents[2]
MOST = 12  # files
TRACE = """
import sys
from pathlib import Path

root, out = sys.argv[1], open(sys.argv[2], "w")
sys.argv[1:] = sys.argv[3:]
from scenario_gen.__main__ import main

seen = set()

def entered(frame, event, _):
    code = frame.f_code
    if event == "call" and (code.co_filename, code.co_name) not in seen and code.co_filename.startswith(root):
        seen.add((code.co_filename, code.co_name))
        print(code.co_filename[len(root) + 1 :], code.co_name, file=out, flush=True)

sys.setprofile(entered)
main()
"""
STEP = re.compile(r"^\d+\. `(scenario_gen/[\w/]+\.py)`: `(\w+)`", re.MULTILINE)
NAMED = re.compile(r"`((?:scenario_gen|msg_conventions)/[\w/]+\.py)`: ((?:`\w+`(?:, )?)+)")


def page():
    return (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def test_a_command_enters_the_files_in_the_order_of_the_page(tmp_path):
    steps = STEP.findall(page())
    assert 8 <= len(steps) <= MOST
    trace = tmp_path / "trace.txt"
    command = ["generate", str(bundled("a")), "--road", "t_intersection", "--count", "2", "--out", str(tmp_path / "out")]
    subprocess.run([sys.executable, "-c", TRACE, str(ROOT), str(trace), *command], check=True, capture_output=True)
    entered = [tuple(line.split()) for line in trace.read_text().splitlines()]
    assert [step for step in entered if step in steps] == steps


def test_every_function_that_the_page_names_is_there():
    named = NAMED.findall(page())
    assert len(named) > 20
    for file, functions in named:
        tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
        known = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef)}
        assert set(re.findall(r"\w+", functions)) <= known, file

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The tutorial on ROS 2, as typed: each command ends with what the page shows, and in time."""

import os
from pathlib import Path
import re
import signal
import subprocess
import sys

import pytest
from support.source_files import ROOT

PAGE = (ROOT / "docs" / "tutorial_ros.md").read_text()
LONGEST_S = 180.0


def shown_after(command: str) -> list[str]:
    """Return the lines that the page shows for a command."""
    rest = PAGE.partition(f"{command}\n```\n")[2]
    (first, *_) = re.findall(r"(?:^    .*\n)+", rest, re.MULTILINE)
    return [line.strip() for line in first.splitlines()]


def without_numbers(text: str) -> str:
    """Return the text with each number as 0: which scenarios are made is not the page's matter."""
    return re.sub(r"\d+(\.\d+)?", "0", text)


@pytest.fixture
def run(domain, tmp_path):
    """Type a command in a folder as a fresh clone has it; return what it prints."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": path, "ROS_DOMAIN_ID": str(domain)}
    started = []

    def typed(command: str, until: str = "") -> str:
        process = subprocess.Popen(
            ["bash", "-c", f"exec {command}"],
            cwd=tmp_path,
            env=environment,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        started.append(process)
        lines = []
        while until and until not in "".join(lines):
            line = process.stdout.readline()
            assert line, f"{command} ended without {until!r}:\n{''.join(lines)}"
            lines.append(line)
        if until:
            process.send_signal(signal.SIGINT)
        rest, _ = process.communicate(timeout=LONGEST_S)
        output = "".join(lines) + rest
        fails = process.returncode == 1 and "thresholds not met" in output
        assert process.returncode == 0 or fails, output
        return output

    yield typed
    for process in started:
        process.kill()


@pytest.mark.dds
@pytest.mark.slow
@pytest.mark.timeout(LONGEST_S)
def test_the_tutorial_runs_as_typed(run):
    blocks = re.findall(r"^```sh\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    commands = [line for block in blocks for line in block.splitlines()]
    assert commands.pop(0) == 'export PATH="$PWD/.venv/bin:$PATH"'
    for command in commands:
        shown = shown_after(command)
        assert shown, command
        output = run(command, until=shown[-1] if command.startswith("suite") else "")
        printed = without_numbers(re.sub(r"\[INFO\] \[\S+\] ", "", output))
        missing = [line for line in shown if without_numbers(line) not in printed]
        assert not missing, f"{command} does not print {missing}:\n{output}"

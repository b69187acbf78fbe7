# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What the tests themselves start."""

from pathlib import Path
import subprocess
import sys
import time

import pytest

PROGRAM = """
import node_server
process = node_server.start_nodes("traffic", ROS_DOMAIN_ID="{domain}")
print(process.pid, flush=True)
process.wait()
"""


def runs(pid: int) -> bool:
    """Whether there is such a process, and it has not ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except FileNotFoundError:
        return False


@pytest.mark.dds
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells a process that its parent has ended")
def test_no_node_outlives_tests_that_are_killed(domain):
    program = PROGRAM.format(domain=domain)
    tests = subprocess.Popen([sys.executable, "-c", program], cwd=Path(__file__).parent, stdout=subprocess.PIPE)
    pid = int(tests.stdout.readline())
    assert runs(pid)
    tests.kill()
    tests.communicate()
    deadline = time.monotonic() + 60.0
    while runs(pid):
        assert time.monotonic() < deadline, f"process {pid} has outlived what started it"
        time.sleep(0.05)

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The first start on a machine: kernels are compiled by processes beside the node, which answers, says so, and can be ended."""

import os
from pathlib import Path
import signal
import subprocess
import sys

from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
import pytest

from msg_conventions.diagnostics import decode_diagnostics

pytestmark = pytest.mark.dds


@pytest.fixture
def segmenter(domain, tmp_path):
    """A segmenter with an empty cache."""
    process = subprocess.Popen(
        [sys.executable, "-m", "scenario_gen.ros.plumbing.start", "segmenter"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ | {"ROS_DOMAIN_ID": str(domain), "PYTHONUNBUFFERED": "1", "NUMBA_CACHE_DIR": str(tmp_path)},
    )
    yield process
    process.kill()
    process.communicate()


def _workers(parent: int) -> list[int]:
    """The processes that `parent` has started."""
    return [int(pid) for task in Path(f"/proc/{parent}/task").iterdir() for pid in (task / "children").read_text().split()]


def test_a_node_answers_while_kernels_are_compiled_and_ends_when_asked(segmenter, client):
    client.hear("/diagnostics")
    state = client.call(GetState, "/segmenter/get_state", GetState.Request())
    assert state.current_state.id == State.PRIMARY_STATE_UNCONFIGURED

    def told() -> list[str]:
        statuses = [status for data in list(client.heard["/diagnostics"]) for status in decode_diagnostics(data)[1]]
        return [status.message for status in statuses if status.name == "/segmenter: state" and "kernels: " in status.message]

    client.until(told, "how many kernels are there")
    assert told()[0].startswith("kernels: ") and told()[0].endswith("s; once per machine")
    activate = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_ACTIVATE))
    assert not client.call(ChangeState, "/segmenter/change_state", activate).success  # what cannot be is refused, no more
    configure = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_CONFIGURE))
    waiting = client.call_later(ChangeState, "/segmenter/change_state", configure)
    assert client.call(GetState, "/segmenter/get_state", GetState.Request()).current_state.label == "unconfigured"
    assert not waiting.done()
    client.until(lambda: _workers(segmenter.pid), "the processes that compile")
    workers = _workers(segmenter.pid)
    segmenter.send_signal(signal.SIGINT)
    output, _ = segmenter.communicate(timeout=120.0)
    assert segmenter.returncode == 0 and "Traceback" not in output, output
    assert "kernels: " in output
    client.until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in workers), "the end of those that compiled")


def test_several_processes_compile_once_and_without_a_folder_each_does(tmp_path):
    """Of a module with one kernel, so that it is short."""
    (tmp_path / "kernel_of_a_test.py").write_text(
        "from scenario_gen.numerics.kernels import F, kernel\n@kernel(F)\ndef twice(x):\n    return x + x\n"
    )
    run = (
        "import kernel_of_a_test as module\nfrom scenario_gen.numerics import compiling\nsaid = []\n"
        "compiling.make_ready(lambda *words: said.append(compiling.words(*words)))\nprint(module.twice(2.0), said[-1:])"
    )
    environment = os.environ | {"PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    several = [
        subprocess.Popen([sys.executable, "-c", run], stdout=subprocess.PIPE, text=True, env=environment) for _ in range(2)
    ]
    said = [process.communicate(timeout=300.0)[0] for process in several]
    assert all(text.startswith("4.0 [") for text in said), said
    assert any("once per machine" in text for text in said)
    assert len(list((tmp_path / "cache").rglob("*.nbc"))) == 1
    warm = subprocess.run([sys.executable, "-c", run], capture_output=True, text=True, env=environment, check=True)
    assert warm.stdout == "4.0 []\n"
    nowhere = environment | {"NUMBA_CACHE_DIR": "/proc/nowhere"}
    alone = subprocess.run([sys.executable, "-c", run], capture_output=True, text=True, env=nowhere, check=True)
    assert "at every start: no folder to keep them" in alone.stdout, alone.stdout

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Processes of nodes, forked from one that has loaded the libraries and the kernels, which takes each seconds of CPU otherwise.

`start_nodes` stands for `subprocess.Popen([sys.executable, "-m", "scenario_gen.ros.common.start", …])`. Nothing outlives the
tests. Tests of the start itself (signals while the libraries load, an empty cache, executables) start real executables instead.
"""

import multiprocessing
from multiprocessing import forkserver
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
from unittest import mock

CONTEXT = multiprocessing.get_context("forkserver")
CONTEXT.set_forkserver_preload(["support.loaded_nodes"])
SCRATCH = tempfile.TemporaryDirectory(prefix="nodes_of_tests_")

STAND_INS = str(Path(__file__).resolve().parents[1] / "ros" / "stand_ins")


class Forked:
    """A process of the server, with what the tests use of `subprocess.Popen`; its output goes to a file, `log`."""

    def __init__(self, arguments: list[str], environment: dict[str, str], log: Path | None):
        self.args = arguments
        self.log = log or Path(tempfile.mkstemp(suffix=".log", dir=SCRATCH.name)[1])
        self._process = _process(_become, (arguments, str(Path.cwd()), environment, str(self.log)))
        self._process.start()
        self.pid = self._process.pid

    @property
    def returncode(self) -> int | None:
        return self._process.exitcode

    def wait(self, timeout: float | None = None) -> int:
        self._process.join(timeout)
        if self._process.exitcode is None:
            raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
        return self._process.exitcode

    def poll(self) -> int | None:
        self._process.join(0.0)
        return self._process.exitcode

    def output(self) -> str:
        """What it has written so far."""
        return self.log.read_text()

    def communicate(self, timeout: float | None = None) -> tuple[str, None]:
        """Return all its output, when it has ended."""
        self.wait(timeout)
        return self.output(), None

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


def start_nodes(*arguments: str, log: Path | None = None, **environment: str) -> Forked:
    """Start the executable that is named first; `environment` is added to this process's."""
    return Forked(list(arguments), os.environ | environment, log)


def process(target, args) -> multiprocessing.Process:
    """A process of the server in which `target` finds the environment of now."""
    return _process(_in_environment, (dict(os.environ), target, args))


def _process(target, args) -> multiprocessing.Process:
    """A process of the server, which is started with the path of this one: Python 3.11 does not tell it what to load from."""
    path = os.pathsep.join(place for place in sys.path if place != STAND_INS)
    with mock.patch.dict(os.environ, PYTHONPATH=path):
        forkserver.ensure_running()
    return CONTEXT.Process(target=target, args=args)


def _in_environment(environment: dict[str, str], target, args) -> None:
    os.environ.clear()
    os.environ.update(environment)
    target(*args)


def _become(arguments: list[str], folder: str, environment: dict[str, str], log: str) -> None:
    """Turn this process into what `python -m` would have made of it."""
    from scenario_gen.base.signals import end_with_parent
    from scenario_gen.ros.common import process as node_process
    from scenario_gen.ros.common import start
    from scenario_gen.ros.nodes.recorder import Recorder

    node_process.NODE_END_S = Recorder.END_S = 120.0  # on a busy machine 5 s are few
    end_with_parent()
    descriptor = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)
    assert "support.loaded_nodes" in sys.modules, "the server has loaded nothing"
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})  # as run_suite starts the server
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    if "WITHOUT_TF2" in environment:
        sys.path[:] = [path for path in sys.path if path != STAND_INS]
    sys.argv = arguments[:]
    start.start(arguments[0])

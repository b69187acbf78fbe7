# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Processes of nodes, forked from one that has loaded the libraries and the kernels, which takes each seconds of CPU otherwise.

`start_nodes` stands for `subprocess.Popen([sys.executable, "-m", "scenario_gen.ros.plumbing.start", …])`.
Tests of the start itself (signals while the libraries load, an empty cache, executables) start real executables instead.

Nothing outlives the tests: whatever a process leaves behind ends with it, and all end with the server, which ends with the tests,
however those end (Linux; elsewhere a test that is killed leaves its nodes).
"""

import atexit
from contextlib import suppress
import ctypes
from functools import cache
import json
import os
from pathlib import Path
import select
import signal
import socket
import subprocess
import sys
import threading
import traceback
from typing import NoReturn

PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER = 1, 36  # linux/prctl.h


class Forked:
    """A process of the server, with what the tests use of `subprocess.Popen`; `stdin` and `stdout` are pipes of texts.

    What a node writes to `stderr` comes with `stdout`, or both in a file, `log`.
    """

    def __init__(self, arguments: list[str], environment: dict[str, str], log: Path | None):
        child_in, own_in = os.pipe()
        own_out, child_out = os.pipe()
        if log is not None:
            os.close(child_out)
            child_out = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        self._status, child_status = os.pipe()
        request = json.dumps([arguments, str(Path.cwd()), environment]).encode()
        given = (child_in, child_out, child_status)
        server().sendall(len(request).to_bytes(8, "big"))
        socket.send_fds(server(), [request[:1]], given)
        server().sendall(request[1:])
        for descriptor in given:
            os.close(descriptor)
        self.args = arguments
        self.stdin, self.stdout = os.fdopen(own_in, "w"), os.fdopen(own_out)
        self.returncode: int | None = None
        self.pid = int.from_bytes(os.read(self._status, 8), "big")

    def wait(self, timeout: float | None = None) -> int:
        if self.returncode is None:
            readable, _, _ = select.select([self._status], [], [], timeout)
            if not readable:
                raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
            self.returncode = int.from_bytes(os.read(self._status, 8), "big", signed=True)
            os.close(self._status)
        return self.returncode

    def poll(self) -> int | None:
        try:
            return self.wait(0.0)
        except subprocess.TimeoutExpired:
            return None

    def communicate(self, timeout: float | None = None) -> tuple[str, None]:
        """Return all that is still to be read of its output, when it has ended."""
        self.stdin.close()
        if self.stdout.closed:
            return "", None
        parts: list[str] = []
        reader = threading.Thread(target=lambda: parts.append(self.stdout.read()), daemon=True)
        reader.start()
        reader.join(timeout)
        if reader.is_alive():
            raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
        self.stdout.close()
        self.wait(timeout)
        return "".join(parts), None

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            with suppress(ProcessLookupError):  # it may end in between, as `Popen.send_signal` knows
                os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


def start_nodes(*arguments: str, log: Path | None = None, **environment: str) -> Forked:
    """Start the executable that is named first; `environment` is added to this process's."""
    return Forked(list(arguments), os.environ | environment, log)


@cache
def server() -> socket.socket:
    """Start the server; it ends with this process, or when this process closes its end."""
    ours, its = socket.socketpair()
    process = subprocess.Popen(
        [sys.executable, __file__, str(its.fileno())],
        pass_fds=(its.fileno(),),
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
    )
    its.close()

    def end() -> None:
        ours.close()
        process.wait(60.0)

    atexit.register(end)
    return ours


def _serve(requests: socket.socket) -> None:
    from scenario_gen.ros.plumbing.process import kernels_ready
    from scenario_gen.ros.plumbing.start import node_class, NODES

    kernels_ready(dict.fromkeys(stage for node in NODES for stage in getattr(node_class(node), "STAGES", ())))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a Ctrl-C is for the tests, which end this
    while head := requests.recv(8, socket.MSG_WAITALL):
        first, given, _, _ = socket.recv_fds(requests, 1, 3)
        rest = int.from_bytes(head, "big") - 1
        asked = json.loads(first + requests.recv(rest, socket.MSG_WAITALL))
        if os.fork() == 0:
            requests.close()
            _watch(asked, *given)
        for descriptor in given:
            os.close(descriptor)
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass


def _watch(asked: list, stdin: int, stdout: int, status: int) -> NoReturn:
    """Fork the node, tell its number and, when it has ended, its exit code; end with the server."""
    server_pid = os.getppid()
    signal.signal(signal.SIGTERM, lambda *_: _end_with_children(1))
    _control_process(PR_SET_CHILD_SUBREAPER, 1)  # what a node leaves behind becomes a child of this process
    _control_process(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != server_pid:  # it has ended before it could be noticed
        os._exit(1)
    pid = os.fork()
    if pid == 0:
        _control_process(PR_SET_PDEATHSIG, signal.SIGKILL)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        os.close(status)
        _become(*asked, stdin, stdout)
    os.close(stdin)
    os.close(stdout)
    os.write(status, pid.to_bytes(8, "big"))
    _, code = os.waitpid(pid, 0)
    with suppress(BrokenPipeError):  # the tests have ended
        os.write(status, os.waitstatus_to_exitcode(code).to_bytes(8, "big", signed=True))
    _end_with_children(0)


def _control_process(what: int, value: int) -> None:
    """Call prctl(2), where there is one."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(what, value, 0, 0, 0)


def _end_with_children(code: int) -> NoReturn:
    """Kill the children of this process, and what becomes one by their end, then end."""
    while children := _children():
        for pid in children:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
            with suppress(ChildProcessError):
                os.waitpid(pid, 0)
    os._exit(code)


def _children() -> list[int]:
    """Return the children of this process, where there is a /proc."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # one that has ended meanwhile
            if int(path.read_text().rpartition(")")[2].split()[1]) == os.getpid():
                found.append(int(path.parent.name))
    return found


def _become(arguments: list[str], folder: str, environment: dict[str, str], stdin: int, stdout: int) -> NoReturn:
    """Turn this process into what `python -m` would have made of it."""
    from scenario_gen.ros.plumbing import start

    code = 1
    try:
        for descriptor, own in ((stdin, 0), (stdout, 1), (stdout, 2)):
            os.dup2(descriptor, own)
        os.close(stdin)
        os.close(stdout)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        os.chdir(folder)
        os.environ.clear()
        os.environ.update(environment)
        sys.argv = arguments[:]
        start.start(arguments[0])
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    _serve(socket.socket(fileno=int(sys.argv[1])))

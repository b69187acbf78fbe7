# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The harness sees what it is for: errors, long messages, crashes of native code, hangs, memory; and it goes on where it was."""

import os
import signal
import tempfile
import time

import harness
from harness import fuzz, Target
import pytest

from scenario_gen.base.errors import InputError, ScenarioGenError


def target(run):
    """A target whose second input is the one that breaks it."""
    seeds = [b"sound", b"broken", b"sound too"]
    return Target("reader", lambda _: seeds, lambda data, _: run() if data == b"broken" else None, [longer])


def longer(_rng, data, _seeds):
    return data + b"!"


def refuse():
    raise InputError("log.csv, line 3: no number")


def fail():
    raise KeyError("t_s")


def say_much():
    raise ScenarioGenError("x" * 501)


def crash():
    os.kill(os.getpid(), signal.SIGSEGV)


def hang():
    while True:
        pass


def take():
    return len(b"x" * (harness.MEMORY * 3 // 2))


@pytest.mark.parametrize(
    ("run", "signature"),
    [
        *((refuse, None), (fail, "KeyError @"), (say_much, "LongMessage"), (crash, "signal 11")),
        *((hang, "OverTimeError @"), (take, "Memory")),
    ],
)
def test_what_comes_out_is_seen_and_kept(tmp_path, monkeypatch, run, signature):
    monkeypatch.setattr(harness, "SECONDS", 0.2 if run is hang else 60.0)
    monkeypatch.setattr(harness, "MEMORY", 300 << 20)
    record = fuzz(target(run), tmp_path, executions=10, seconds=600.0)
    assert record.executions == 10
    assert [kind.startswith(str(signature)) for kind in record.failures] == ([True] if signature else [])
    for failure in record.failures.values():
        assert (tmp_path / failure.file).read_bytes() == b"broken"


def test_it_goes_on_where_it_was(tmp_path):
    assert fuzz(target(fail), tmp_path, executions=2, seconds=600.0).executions == 2
    again = fuzz(target(fail), tmp_path, executions=5, seconds=600.0)
    assert again.executions == 5
    assert [failure.count for failure in again.failures.values()] == [1]


def test_what_is_stopped_keeps_what_it_has_done_and_leaves_no_process(tmp_path, monkeypatch):
    """Progress is kept after each child, whose time is short here; a child whose parent is killed ends by itself."""
    monkeypatch.setattr(harness, "SAVED", 0.05)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    pid = os.fork()
    if not pid:
        try:
            endless = Target("reader", lambda _: [], lambda *_: time.sleep(0.005), [longer])
            fuzz(endless, tmp_path / "state", 10**9, 600.0, [b"a"])
        finally:
            os._exit(1)
    while harness.load(tmp_path / "state", "reader").executions < 5:
        time.sleep(0.01)
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    while list(tmp_path.glob("tmp*")):  # the child's, which removes it at its end
        time.sleep(0.01)
    done = harness.load(tmp_path / "state", "reader").executions
    again = fuzz(target(refuse), tmp_path / "state", executions=done + 3, seconds=600.0)
    assert again.executions == done + 3 < 10**5


def test_inputs_are_the_same_every_time():
    once, again = ([harness.damaged(target(refuse), [b"a", b"b"], k) for k in range(20)] for _ in range(2))
    assert once == again

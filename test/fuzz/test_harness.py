# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The harness sees what it is for: errors, long messages, crashes of native code, hangs, memory; and it goes on where it was."""

import os
import signal

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

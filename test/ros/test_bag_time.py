# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The time in a bag while it is played, without DDS."""

import threading
from types import SimpleNamespace

import pytest

from scenario_gen.ros.common import bag_time
from scenario_gen.ros.common.bag_time import BagTime


@pytest.fixture
def clock(monkeypatch):
    """Real time as the test sets it."""
    now = SimpleNamespace(seconds=100.0)
    monkeypatch.setattr(bag_time, "monotonic", lambda: now.seconds)
    return now


def test_time_passes_at_its_rate(clock):
    rate = [2.0]
    time = BagTime(lambda: rate[0])
    time.begin()
    clock.seconds += 9.0
    assert time.shown() == 0.0, "it begins paused"
    time.pause(False)
    assert time.wait(0.0)
    clock.seconds += 1.0
    assert time.wait(2.0) and time.shown() == 2.0
    rate[0] = 4.0
    clock.seconds += 0.25
    assert time.wait(3.0) and time.shown() == 3.0
    clock.seconds += 60.0  # a subscriber that hangs: the messages after it are not hurried
    assert time.wait(3.5)
    waited = threading.Event()
    thread = threading.Thread(target=lambda: time.wait(15.0) and waited.set(), daemon=True)
    thread.start()
    assert not waited.wait(0.05)
    clock.seconds += 3.0
    assert waited.wait(10.0)


def test_lateness_is_caught_up_with(clock):
    time = BagTime(lambda: 20.0)
    time.begin()
    time.pause(False)
    clock.seconds += 0.6  # a slow machine
    assert all(time.wait(due) for due in (0.0, 4.0, 11.5))
    assert time.shown() == 11.5


def test_the_end_wakes_the_waiting_thread(clock):
    time = BagTime(lambda: 1.0)
    time.begin()
    waiting = threading.Timer(0.05, time.end)
    waiting.start()
    assert not time.wait(8.0) and time.ended

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The time in a bag while it is played, and the services of rosbag2's player, without DDS."""

import sys
import threading
from types import ModuleType, SimpleNamespace

import pytest

from scenario_gen.ros.common import bag_time
from scenario_gen.ros.common.bag_time import BagTime
from scenario_gen.ros.common.player_services import offer_player_services


@pytest.fixture
def clock(monkeypatch):
    """Real time as the test sets it."""
    now = SimpleNamespace(seconds=100.0)
    monkeypatch.setattr(bag_time, "monotonic", lambda: now.seconds)
    return now


def test_the_time_passes_at_its_rate_up_to_the_next_message(clock):
    rate = [2.0]
    time = BagTime(lambda: rate[0])
    assert time.begin(5.0) == 5.0
    clock.seconds += 9.0
    assert time.shown() == 5.0, "it begins paused"
    time.pause(False)
    assert time.wait(5.0)
    clock.seconds += 1.0
    assert time.wait(7.0) and time.shown() == 7.0
    rate[0] = 4.0
    clock.seconds += 0.25
    assert time.wait(8.0) and time.shown() == 8.0
    clock.seconds += 60.0  # a subscriber that hangs: the messages after it are not hurried
    assert time.wait(8.5)
    waited = threading.Event()
    thread = threading.Thread(target=lambda: time.wait(20.0) and waited.set(), daemon=True)
    thread.start()
    assert not waited.wait(0.05)
    clock.seconds += 3.0
    assert waited.wait(10.0)


def test_a_step_a_seek_and_the_end_wake_the_waiting_thread(clock):
    time = BagTime(lambda: 1.0)
    time.begin(0.0)
    time.step()
    assert time.wait(0.0), "a paused player waits for its step also at the first message"
    time.step()
    assert time.wait(3.0) and time.shown() == 3.0
    time.seek(7.0)
    assert time.round_over and not time.wait(4.0)
    assert time.begin(0.0) == 7.0 and not time.round_over
    time.end()
    assert not time.wait(8.0)


def test_the_services_have_the_types_of_rosbag2_where_they_are_installed(monkeypatch):
    names = ["Pause", "Resume", "TogglePaused", "PlayNext", "Seek", "SetRate", "GetRate"]
    srv = ModuleType("rosbag2_interfaces.srv")
    for name in [*names, "IsPaused"]:
        setattr(srv, name, name)
    monkeypatch.setitem(sys.modules, "rosbag2_interfaces", ModuleType("rosbag2_interfaces"))
    monkeypatch.setitem(sys.modules, "rosbag2_interfaces.srv", srv)
    offered, sought, values = {}, [], {"rate": 1.0}

    def set_parameters(parameters):
        values.update((parameter.name, parameter.value) for parameter in parameters)
        return [SimpleNamespace(successful=True)]

    node = SimpleNamespace(
        create_service=lambda kind, name, answer, **_: offered.update({name: (kind, answer)}),
        set_parameters=set_parameters,
        get_parameter=lambda name: SimpleNamespace(value=values[name]),
        get_logger=lambda: SimpleNamespace(warning=lambda _: None),
    )
    offer_player_services(node, BagTime(lambda: 1.0), sought.append)

    def call(name, response="success", **request):
        answer = SimpleNamespace(**{response: None})
        return getattr(offered[f"~/{name}"][1](SimpleNamespace(**request), answer), response)

    assert offered["~/toggle_paused"][0] == "TogglePaused"
    assert call("is_paused", "paused") is True
    assert call("play_next") is True
    assert call("seek", time=SimpleNamespace(sec=2, nanosec=5)) is True
    assert sought == [2_000_000_005]
    assert call("set_rate", rate=3.0) is True and call("get_rate", "rate") == 3.0
    call("resume")
    assert call("is_paused", "paused") is False and call("play_next") is False

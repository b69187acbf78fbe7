# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A lifecycle manager sees a node that ends or dies. The package `bond` is not among the wheels: its message is a stand-in."""

import sys
from types import ModuleType, SimpleNamespace

import pytest


class Status(SimpleNamespace):
    """As bond/msg/Status."""

    def __init__(self, **fields):
        super().__init__(header=SimpleNamespace(stamp=None), **fields)


class Node:
    """A node that runs its timer when it is told to."""

    context = SimpleNamespace(ok=lambda: True)

    def __init__(self):
        self.sent, self.timers = [], []

    def get_name(self):
        return "planner"

    def get_clock(self):
        return SimpleNamespace(now=lambda: SimpleNamespace(to_msg=lambda: "now"))

    def create_publisher(self, kind, topic, depth):
        assert (kind, topic) == (Status, "bond")
        return SimpleNamespace(publish=self.sent.append)

    def create_subscription(self, kind, topic, callback, depth):
        assert (kind, topic) == (Status, "bond")
        self.hear = callback

    def create_timer(self, period, callback, clock):
        assert period < 4.0, "nav2's bond_timeout"
        self.timers.append(callback)
        return callback

    def destroy_timer(self, timer):
        self.timers.remove(timer)

    def beat(self):
        for timer in list(self.timers):
            timer()


@pytest.fixture
def bonded(monkeypatch):
    from scenario_gen.ros.common.bond import Bond

    module = ModuleType("bond.msg")
    module.Status = Status
    monkeypatch.setitem(sys.modules, "bond", ModuleType("bond"))
    monkeypatch.setitem(sys.modules, "bond.msg", module)
    node = Node()
    return node, Bond(node)


def test_heartbeats_from_activation_to_deactivation(bonded):
    node, bond = bonded
    node.beat()
    assert not node.sent
    bond.start()
    node.beat()
    node.beat()
    bond.stop()
    bond.stop()
    node.beat()
    assert [(status.id, status.active) for status in node.sent] == [
        ("planner", True),
        ("planner", True),
        ("planner", False),
    ]
    assert len({status.instance_id for status in node.sent}) == 1


def test_bond_ends_with_the_manager(bonded):
    node, bond = bonded
    bond.start()
    node.beat()
    node.hear(Status(id="segmenter", instance_id="manager", active=False))
    node.hear(Status(id="planner", instance_id="manager", active=True))
    node.hear(Status(id="planner", instance_id=node.sent[0].instance_id, active=False))
    assert node.timers, "messages of others, of a living manager and its own"
    node.hear(Status(id="planner", instance_id="manager", active=False))
    node.beat()
    assert [status.active for status in node.sent] == [True, False]

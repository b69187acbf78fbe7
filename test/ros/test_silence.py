# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Real nodes in this process: what is published when they are stopped in the midst of work, and how much they keep."""

from collections.abc import Iterator
import threading
import time

import pytest
from support.suite_processes import Client, RESOURCES

from msg_conventions.scenario_info import encode_info, RequestSummary, ScenarioEntry
from msg_conventions.tracks import encode_tracks
from scenario_gen.base.errors import RefusedError
from scenario_gen.base.worker import MAX_WAITING_COUNT, Worker
from scenario_gen.logs import read_log

pytestmark = pytest.mark.dds
OUTPUTS = ("/changepoints", "/posterior")


@pytest.fixture
def ros(domain: int) -> Iterator[None]:
    """ROS in this process."""
    import rclpy

    rclpy.init(domain_id=domain)
    yield
    rclpy.shutdown()


class Gate:
    """Stands before the segmenter's work, which then does not listen to anybody."""

    def __init__(self, work):
        self.reached, self.opened = threading.Event(), threading.Event()
        self._work = work

    def __call__(self, *arguments):
        self.reached.set()
        assert self.opened.wait(180.0)
        return self._work(*arguments)


def spun(node, condition) -> None:
    """Spin a node until something is so."""
    import rclpy

    deadline = time.monotonic() + 180.0
    while not condition():
        assert time.monotonic() < deadline
        rclpy.spin_once(node, timeout_sec=0.02)


@pytest.mark.parametrize(
    ("cleaned", "fails"), [(False, False), (True, True)], ids=["deactivate", "cleanup"]
)
def test_late_work_is_not_published(ros, client: Client, monkeypatch, cleaned, fails):
    """And a node that is active again publishes what is done then."""
    from scenario_gen.ros.nodes import segmenter

    def broken(*_):
        raise ValueError("too late")

    work = segmenter.segment
    gate = Gate(broken if fails else work)
    monkeypatch.setattr(segmenter, "segment", gate)
    node = segmenter.Segmenter()
    client.hear(*OUTPUTS, "/diagnostics")
    try:
        node.trigger_configure()
        node.trigger_activate()
        (encounter,) = read_log(RESOURCES / "synthetic_c").encounters
        node.received("tracks", encode_tracks(encounter))
        assert gate.reached.wait(180.0)
        (worker,) = (t for t in threading.enumerate() if t.name.startswith("worker of segmenter"))
        node.trigger_deactivate()
        if cleaned:
            node.trigger_cleanup()
        client.until(
            lambda: client.node.count_publishers("/changepoints") == (0 if cleaned else 1),
            "what is offered",
        )
        gate.opened.set()
        worker.join(180.0)
        assert not worker.is_alive()
        spun(node, lambda: _said(client).endswith("unconfigured" if cleaned else "inactive"))
        names = {s.name for s in client.statuses()}
        assert names == {"/segmenter: state"}, (
            "of its work a node says nothing when it is not active"
        )
        assert not any(client.heard[topic] for topic in OUTPUTS)
        if cleaned:
            node.trigger_configure()
        monkeypatch.setattr(segmenter, "segment", work)
        node.trigger_activate()
        node.received("tracks", encode_tracks(encounter))
        assert len(client.wait("/changepoints")) == 1
    finally:
        gate.opened.set()
        node.destroy_node()


def test_evaluator_gives_up_lost_requests(ros, client: Client):
    from scenario_gen.ros.nodes.evaluator import Evaluator, MAX_REQUEST_COUNT

    node = Evaluator()
    client.hear("/diagnostics")
    try:
        node.trigger_configure()
        node.trigger_activate()
        spun(node, lambda: _said(client).endswith("active"))
        for k in range(MAX_REQUEST_COUNT + 1):
            entry = ScenarioEntry(0, {}, str(k), 0, 0, f"{k:064x}")
            node.received("scenarios/info", encode_info(entry))
            closing = RequestSummary(0, {}, str(k), 0, 1, 1, 1)
            node.received("scenarios/info", encode_info(closing))
        spun(
            node,
            lambda: (
                "request 0: 0 of 1 scenarios are there, 1 are missing; it is not evaluated"
                in _said(client)
            ),
        )
    finally:
        node.destroy_node()


def _said(client: Client) -> str:
    return "\n".join(s.message for s in client.statuses())


def test_newest_of_many_jobs_is_answered():
    failures: list[BaseException] = []
    worker = Worker(lambda _, error: failures.append(error))
    started, gate, answers = threading.Event(), threading.Event(), []
    worker.submit("long", lambda _: (started.set(), gate.wait(180.0)))
    assert started.wait(180.0)
    for k in range(MAX_WAITING_COUNT + 1):
        worker.submit(f"request {k}", lambda cancelled, k=k: answers.append((k, cancelled())))
    assert answers == [(MAX_WAITING_COUNT, True)]
    (error,) = failures
    assert isinstance(error, RefusedError) and "1000 jobs wait already" in str(error)
    gate.set()
    worker.close(180.0)
    assert len(answers) == MAX_WAITING_COUNT + 1

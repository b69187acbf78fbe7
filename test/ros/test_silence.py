# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Real nodes in this process: what is published when they are stopped in the midst of work, and how much they keep."""

from collections.abc import Iterator
import threading

import pytest
from suite_processes import Client, RESOURCES

from msg_conventions.diagnostics import decode_diagnostics, encode_diagnostics, Level, Status
from msg_conventions.scenarios import digest
from msg_conventions.tracks import encode_tracks
from scenario_gen.base.errors import RefusedError
from scenario_gen.base.worker import MOST_WAITING, Worker
from scenario_gen.logs import read_log

pytestmark = pytest.mark.dds
OUTPUTS = ("/changepoints", "/posterior", "/rosout")


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
        assert self.opened.wait(120.0)
        return self._work(*arguments)


@pytest.mark.parametrize("cleaned", [False, True], ids=["deactivate", "cleanup"])
@pytest.mark.parametrize("fails", [False, True], ids=["result", "error"])
def test_what_is_done_too_late_is_not_published(ros, client: Client, monkeypatch, cleaned, fails):
    from scenario_gen.ros.nodes import segmenter

    def broken(*_):
        raise ValueError("too late")

    gate = Gate(broken if fails else segmenter.segment)
    monkeypatch.setattr(segmenter, "segment", gate)
    node = segmenter.Segmenter()
    topics = [topic for topic in OUTPUTS if topic != "/rosout"]
    client.hear(*topics, "/diagnostics")
    try:
        node.trigger_configure()
        node.trigger_activate()
        (encounter,) = read_log(RESOURCES / "synthetic_c").encounters
        before = set(threading.enumerate())
        node.received("tracks", encode_tracks(encounter))
        assert gate.reached.wait(60.0)
        (worker,) = (t for t in before if t.name.startswith("worker of segmenter"))
        node.trigger_deactivate()
        if cleaned:
            node.trigger_cleanup()
        publishers = sorted(publisher.topic_name for publisher in node.publishers)
        client.until(lambda: client.node.count_publishers("/changepoints") == (0 if cleaned else 1), "what is offered")
        gate.opened.set()
        worker.join(120.0)
        assert not worker.is_alive()
        assert sorted(publisher.topic_name for publisher in node.publishers) == publishers
        assert ("/changepoints" in publishers) is not cleaned
        if not cleaned:  # a message on each topic, by its publisher, is the first and only one
            for publisher in node.publishers:
                if publisher.topic_name in topics:
                    publisher.publish(b"\x00\x01\x00\x00")
            client.until(lambda: all(client.heard[topic] for topic in topics), "what was published last")
            assert all(client.heard[topic] == [b"\x00\x01\x00\x00"] for topic in topics)
    finally:
        gate.opened.set()
        node.destroy_node()
    if cleaned:
        assert not any(client.heard[topic] for topic in topics)
    last = "unconfigured" if cleaned else "inactive"
    client.until(lambda: _said(client).endswith(last), f"the state {last}")
    assert "too late" not in _said(client)
    names = {s.name for data in list(client.heard["/diagnostics"]) for s in decode_diagnostics(data)[1]}
    assert names == {"/segmenter: state"}, "of its work a node says nothing when it is not active"


def test_a_node_that_is_active_again_says_nothing_of_what_was_left_behind(ros, client: Client, monkeypatch):
    from scenario_gen.ros.nodes import segmenter

    gate = Gate(segmenter.segment)
    monkeypatch.setattr(segmenter, "segment", gate)
    node = segmenter.Segmenter()
    client.hear("/changepoints")
    try:
        node.trigger_configure()
        node.trigger_activate()
        (encounter,) = read_log(RESOURCES / "synthetic_c").encounters
        data = encode_tracks(encounter)
        node.received("tracks", data)
        assert gate.reached.wait(60.0)
        left = [t for t in threading.enumerate() if t.name.startswith("worker of segmenter")]
        node.trigger_deactivate()
        node.trigger_activate()
        gate.opened.set()
        left[0].join(120.0)
        assert not client.heard["/changepoints"]
        node.received("tracks", data)
        client.wait("/changepoints")
        assert len(client.heard["/changepoints"]) == 1
    finally:
        gate.opened.set()
        node.destroy_node()


def test_the_evaluator_gives_up_requests_whose_scenarios_never_come_and_says_so(ros, client: Client):
    from scenario_gen.ros.nodes.evaluator import Evaluator

    node = Evaluator()
    client.hear("/diagnostics")
    try:
        node.trigger_configure()
        client.until(lambda: client.node.count_publishers("/diagnostics") > 0, "the evaluator")
        node.trigger_activate()
        wait, many = node.config.wait, 300
        for k in range(many):
            entry = {"request": str(k), "index": "0", "seed": "0", "sha256": f"{k:064x}"}
            node.received("scenarios/info", encode_diagnostics([Status("scenario", Level.OK, "", entry)], 0))
            closing = {"request": str(k), "published": "1", "requested": "1"}
            node.received("scenarios/info", encode_diagnostics([Status("request", Level.OK, "", closing)], 0))
        accounts = node._requests.open
        assert len(accounts) == wait
        node.diagnostics._tick()  # a second has gone by
        for k in range(2 * node.config.measured):  # of one request that is never closed
            data = f"{k}".encode()
            entry = {"request": "endless", "index": str(k), "seed": "0", "sha256": digest(data)}
            node.received("scenarios", data)
            node.received("scenarios/info", encode_diagnostics([Status("scenario", Level.OK, "", entry)], 0))
        assert accounts["endless"].came == 2 * node.config.measured
        assert len(accounts["endless"].kept) == node.config.measured
        last = f"request {many - wait - 1}: 0 of 1 scenarios are there, 1 are missing; it is not evaluated"
        client.until(lambda: last in _said(client), "the warning")
    finally:
        node.destroy_node()


def _said(client: Client) -> str:
    statuses = [s for data in list(client.heard["/diagnostics"]) for s in decode_diagnostics(data)[1]]
    return "\n".join(words for s in statuses for words in (*(v for k, v in s.values.items() if k.startswith("also.")), s.message))


def test_of_too_many_jobs_the_newest_is_answered_at_once():
    failures: list[BaseException] = []
    worker = Worker(lambda _, error: failures.append(error))
    started, gate, answers = threading.Event(), threading.Event(), []
    worker.submit("long", lambda _: (started.set(), gate.wait(60.0)))
    assert started.wait(60.0)
    for k in range(MOST_WAITING + 1):
        worker.submit(f"request {k}", lambda cancelled, k=k: answers.append((k, cancelled())))
    assert answers == [(MOST_WAITING, True)]
    (error,) = failures
    assert isinstance(error, RefusedError) and "1000 jobs wait already" in str(error)
    gate.set()
    worker.close(60.0)
    assert len(answers) == MOST_WAITING + 1

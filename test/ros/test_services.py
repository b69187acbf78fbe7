# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Answers that DDS drops are sent again: the server's are best effort, so those of reliable callers can never be matched."""

from functools import partial
import warnings

import pytest

pytestmark = pytest.mark.dds


class Server:
    """A node that answers, in this process; it is spun by whoever waits."""

    def __init__(self, domain: int):
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from std_srvs.srv import Trigger

        from scenario_gen.ros.plumbing.process import ResponseRetry

        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node("server", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        service = self.node.create_service(Trigger, "~/go", lambda _, response: response, qos_profile=_quality(reliable=False))
        self.attempts = 0
        self.to_drop = 0
        service.send_response = partial(self._attempt, service.send_response)
        ResponseRetry(self.node)

    def _attempt(self, send, response, header):
        self.attempts += 1
        if self.attempts <= self.to_drop:
            warnings.warn("failed to send response (timeout): as rclpy says it", RuntimeWarning, stacklevel=1)
        else:
            send(response, header)

    def spun_until(self, condition) -> bool:
        self.executor.spin_once(0.02)
        return condition()

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def server(domain):
    made = Server(domain)
    yield made
    made.close()


def _quality(reliable: bool):
    from rclpy.qos import QoSProfile, ReliabilityPolicy

    return QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT)


def _caller(client, reliable: bool):
    from std_srvs.srv import Trigger

    caller = client.node.create_client(Trigger, "/server/go", qos_profile=_quality(reliable))
    return caller, partial(caller.call_async, Trigger.Request())


def test_a_caller_that_is_matched_late_gets_its_answer(server, client):
    caller, ask = _caller(client, reliable=False)
    client.until(lambda: server.spun_until(caller.service_is_ready), "the service")
    server.to_drop = 3
    answer = ask()
    client.until(lambda: server.spun_until(answer.done), "the answer")
    assert server.attempts == 4


def test_a_caller_that_is_never_matched_is_given_up_and_others_are_served_meanwhile(server, client, monkeypatch):
    from scenario_gen.ros.plumbing import process

    now, said = [0.0], []
    monkeypatch.setattr(process, "monotonic", lambda: now[0])
    monkeypatch.setattr(server.node.get_logger(), "warning", said.append)
    _, ask_unheard = _caller(client, reliable=True)
    for _ in range(3000):  # requests go unheard until the server is known, and this caller cannot see when that is
        ask_unheard()
        if server.spun_until(lambda: server.attempts > 0):
            break
    caller, ask = _caller(client, reliable=False)
    client.until(lambda: server.spun_until(caller.service_is_ready), "the service")
    answer = ask()
    client.until(lambda: server.spun_until(answer.done), "the other's answer")
    before = server.attempts
    client.until(lambda: server.spun_until(lambda: server.attempts > before + 2), "more attempts")
    assert not said
    now[0] = process.PATIENCE
    client.until(lambda: server.spun_until(lambda: bool(said)), "the end of patience")
    assert "its answer is dropped" in said[0]

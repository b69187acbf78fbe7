# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a node says of itself on /diagnostics: all of it every second, what changes sooner, and no longer than it is so."""

from collections.abc import Iterator
import time

import pytest
from support.suite_processes import Client

from msg_conventions.diagnostics import decode_diagnostics, Level, Status
from scenario_gen.ros.common.diagnostics import (
    family,
    MIN_SHOWN_S,
)

pytestmark = pytest.mark.dds
NODE = "/reporter"


class Reporter:
    """A node that has something to say, spun in this process by whoever waits; and what is heard of it."""

    def __init__(self, domain: int, client: Client):
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        from scenario_gen.ros.common.diagnostics import NodeDiagnostics

        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node(NODE[1:], context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.client = client
        client.hear("/diagnostics")
        self.diagnostics = NodeDiagnostics(self.node)
        self.until(self.heard, "its first words")

    def heard(self) -> list[tuple[int, dict[str, Status]]]:
        """Stamps and statuses by subject, of every message."""
        decoded = [decode_diagnostics(data) for data in list(self.client.heard["/diagnostics"])]
        return [
            (stamp, {status.name.partition(": ")[2]: status for status in every})
            for stamp, every in decoded
        ]

    def newest(self) -> dict[str, Status]:
        return self.heard()[-1][1]

    def until(self, condition, what: str) -> None:
        self.client.until(lambda: self.executor.spin_once(0.02) or condition(), what)

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def reporter(domain: int, client: Client) -> Iterator[Reporter]:
    made = Reporter(domain, client)
    yield made
    made.close()


def test_everything_is_published_each_second(reporter: Reporter):
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.qos import QoSPresetProfiles

    before, aggregated = time.time_ns(), []
    quality = QoSPresetProfiles.SYSTEM_DEFAULT.value  # diagnostic_aggregator's
    reporter.client.node.create_subscription(
        DiagnosticArray, "/diagnostics", aggregated.append, quality
    )
    reporter.diagnostics.status(
        Level.OK, "a road", "road", {"cells": "7"}, 5_000_000_006, log=False
    )
    reporter.diagnostics.status(Level.WARN, "moved", "fit of 1", {}, log=False)
    reporter.until(lambda: {"road", "fit of 1"} <= set(reporter.newest()), "both at once")
    count = len(reporter.heard())
    reporter.until(lambda: len(reporter.heard()) >= count + 2, "two more messages")
    for stamp, statuses in reporter.heard()[count:]:
        assert before <= stamp <= time.time_ns()
        assert statuses["road"].values == {"cells": "7", "template_stamp": "5.000000006"}
        assert "template_stamp" not in statuses["fit of 1"].values
        assert {status.name.partition(":")[0] for status in statuses.values()} == {NODE}
    reporter.until(lambda: aggregated, "what an aggregator hears")
    assert all(message.header.stamp.sec > 0 for message in aggregated), (
        "it warns of messages without a stamp"
    )


def test_resolved_status_returns_to_ok(reporter: Reporter):
    reported = time.time_ns()
    reporter.diagnostics.failed("tracks", ValueError("no quaternion"))
    reporter.diagnostics.resolve("tracks")
    reporter.until(lambda: "tracks" in reporter.newest(), "the error")
    reporter.until(lambda: reporter.newest()["tracks"].level is Level.OK, "its end")
    over = next(
        stamp
        for stamp, statuses in reporter.heard()
        if "tracks" in statuses and statuses["tracks"].level is Level.OK
    )
    assert over - reported >= 0.99e9 * MIN_SHOWN_S, "whoever looks once a second sees it"
    assert reporter.newest()["tracks"].message == "over: ValueError: no quaternion"
    reporter.diagnostics.failed("plan 7", ValueError("once"))
    reporter.diagnostics.failed("plan 8", ValueError("again"))
    reporter.until(
        lambda: reporter.newest().get("plan", Status("", Level.OK, "")).values.get("times") == "2",
        "the second one",
    )
    assert reporter.newest()["plan"].values == {"error": "ValueError", "job": "8", "times": "2"}
    reporter.diagnostics.status(Level.OK, "planned", "plan", {}, log=False)
    reporter.until(lambda: reporter.newest()["plan"].message == "planned", "good news, at once")


def test_report_replaces_the_one_before(reporter: Reporter):
    reporter.diagnostics.report(
        *(Status(f"{NODE}: fit{of}", Level.OK, "") for of in ("", " of 1", " of 2")), stamp_ns=1
    )
    reporter.diagnostics.report(Status(f"{NODE}: segmentation", Level.OK, ""))
    reporter.diagnostics.report(
        *(Status(f"{NODE}: fit{of}", Level.OK, "") for of in ("", " of 3")), stamp_ns=2
    )
    reporter.until(
        lambda: set(reporter.newest()) == {"fit", "fit of 3", "segmentation"},
        "the newer report alone",
    )
    reporter.diagnostics.enable(False)
    reporter.diagnostics.state("inactive")
    reporter.diagnostics.status(Level.OK, "too late", "fit", {}, log=False)
    reporter.until(lambda: set(reporter.newest()) == {"state"}, "nothing but the state")


def test_status_storm_is_bounded(reporter: Reporter):
    count = len(reporter.heard())
    for k in range(200):
        reporter.diagnostics.status(Level.ERROR, f"finding {k}", "tracks", {}, log=False)
        reporter.diagnostics.status(Level.OK, "", f"thing_{k}", {}, log=False)
    reporter.until(lambda: "tracks" in reporter.newest(), "the finding")
    assert len(reporter.heard()) - count < 25
    found = reporter.newest()
    assert (
        found["tracks"].message.startswith(f"finding {k}; finding {k - 1}; ")
        and found["tracks"].values["times"] == "200"
    )


def test_statuses_have_bounds_and_families(reporter: Reporter):
    reporter.diagnostics.status(Level.WARN, "\x1b" * 10_000, "x", {}, log=False)
    reporter.until(lambda: "x" in reporter.newest(), "the status")
    message = reporter.newest()["x"].message
    assert len(message) < 9_000 and "\x1b" not in message
    assert family("/a/planner: fit of 7") == family("/a/planner: fit") == "/a/planner: fit"

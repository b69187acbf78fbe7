# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a node says of itself on /diagnostics: all of it every second, what changes sooner, and no longer than it is so."""

from types import SimpleNamespace

import pytest

from msg_conventions.diagnostics import decode_diagnostics, Level, Status
from scenario_gen.ros.common import diagnostics
from scenario_gen.ros.common.diagnostics import (
    family,
    FULL_PERIOD_STEPS,
    MIN_SHOWN_S,
    NodeDiagnostics,
    TICK_S,
)

NODE = "/reporter"
STAMP_NS = 5_000_000_006


class Reporter(NodeDiagnostics):
    """The statuses of a node without DDS, and the messages that it has published; its time passes by steps."""

    def __init__(self, monkeypatch):
        self.now_s, self.messages = 1000.0, []
        clock = SimpleNamespace(
            now=lambda: SimpleNamespace(nanoseconds=round(self.now_s * 1_000_000_000))
        )
        logger = SimpleNamespace(error=lambda _: None)
        node = SimpleNamespace(
            context=SimpleNamespace(ok=lambda: True),
            get_clock=lambda: clock,
            get_fully_qualified_name=lambda: NODE,
            get_logger=lambda: logger,
        )
        monkeypatch.setattr(diagnostics, "monotonic", lambda: self.now_s)
        monkeypatch.setattr(diagnostics, "create_publisher", lambda *_: None)
        monkeypatch.setattr(diagnostics, "create_steady_timer", lambda *_: None)
        monkeypatch.setattr(
            diagnostics, "publish", lambda _node, _publisher, data: self.messages.append(data)
        )
        super().__init__(node)

    def pass_time(self, steps: int = 1) -> dict[str, Status]:
        """Let steps of time pass; return the newest statuses by their subjects."""
        for _ in range(steps):
            self.now_s += TICK_S
            self._tick()
        return {s.name.partition(": ")[2]: s for s in decode_diagnostics(self.messages[-1])[1]}


@pytest.fixture
def reporter(monkeypatch) -> Reporter:
    return Reporter(monkeypatch)


def test_everything_is_published_each_second(reporter):
    reporter.status(Level.OK, "a road", "road", {"cells": "7"}, STAMP_NS, log=False)
    reporter.status(Level.WARN, "moved", "fit of 1", {}, log=False)
    statuses = reporter.pass_time()
    assert statuses["road"].values == {"cells": "7", "template_stamp": "5.000000006"}
    assert "template_stamp" not in statuses["fit of 1"].values
    count = len(reporter.messages)
    assert reporter.pass_time(2 * FULL_PERIOD_STEPS) == statuses
    assert len(reporter.messages) == count + 2
    stamps = [decode_diagnostics(data)[0] for data in reporter.messages]
    assert stamps[-1] - stamps[-2] == 1_000_000_000


def test_resolved_status_returns_to_ok(reporter):
    reporter.failed("tracks", ValueError("no quaternion"))
    reporter.resolve("tracks")
    before = reporter.pass_time(round(MIN_SHOWN_S / TICK_S) - 1)
    assert before["tracks"].level is Level.ERROR, "whoever looks once a second sees it"
    over = reporter.pass_time(FULL_PERIOD_STEPS)["tracks"]
    assert (over.level, over.message) == (Level.OK, "over: ValueError: no quaternion")
    reporter.failed("plan 7", ValueError("once"))
    reporter.failed("plan 8", ValueError("again"))
    values = reporter.pass_time()["plan"].values
    assert values == {"error": "ValueError", "job": "8", "times": "2"}
    reporter.status(Level.OK, "planned", "plan", {}, log=False)
    assert reporter.pass_time()["plan"].message == "planned", "good news, at once"


def test_report_replaces_the_one_before(reporter):
    reporter.report(
        *(Status(f"{NODE}: fit{of}", Level.OK, "") for of in ("", " of 1", " of 2")), stamp_ns=1
    )
    reporter.report(Status(f"{NODE}: segmentation", Level.OK, ""))
    reporter.report(
        *(Status(f"{NODE}: fit{of}", Level.OK, "") for of in ("", " of 3")), stamp_ns=2
    )
    assert set(reporter.pass_time()) == {"fit", "fit of 3", "segmentation"}
    reporter.enable(False)
    reporter.state("inactive")
    reporter.status(Level.OK, "too late", "fit", {}, log=False)
    assert set(reporter.pass_time()) == {"state"}


def test_statuses_have_bounds_and_families(reporter):
    for k in range(200):
        reporter.status(Level.ERROR, f"finding {k}", "tracks", {}, log=False)
        reporter.status(Level.OK, "", f"thing_{k}", {}, log=False)
    reporter.status(Level.WARN, "\x1b" * 10_000, "x", {}, log=False)
    statuses = reporter.pass_time()
    assert len(reporter.messages) == 1
    assert statuses["tracks"].message.startswith("finding 199; finding 198; ")
    assert statuses["tracks"].values["times"] == "200"
    assert len(statuses["x"].message) < 9_000 and "\x1b" not in statuses["x"].message
    assert family("/a/planner: fit of 7") == family("/a/planner: fit") == "/a/planner: fit"

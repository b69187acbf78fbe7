# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Nodes that are killed and started again resume their place, and the others go on as if nothing had been."""

import os
import signal

import pytest
from support.suite_processes import Processes, RESOURCES

from msg_conventions.diagnostics import decode_diagnostics
from msg_conventions.scenario_info import RequestSummary

pytestmark = [pytest.mark.dds, pytest.mark.slow, pytest.mark.long]
NODES = {
    "log_player": ["-p", f"log_path:={RESOURCES / 'synthetic_c'}"],
    "road_server": ["-p", "road_name:=straight", "-p", "wait_for_tracks:=true"],
    "segmenter": [],
    "planner": [],
    "gp_sampler": ["-p", "count:=3", "-p", "seed:=7"],
    "evaluator": [],
}


def test_killed_nodes_resume(tmp_path, domain, client):
    def processes(name, nodes):
        (tmp_path / name).mkdir()
        return Processes(
            tmp_path / name,
            domain,
            {node: NODES[node] for node in nodes},
            apart=("segmenter", "planner", "gp_sampler"),
        )

    client.hear(
        "/scenarios", "/scenarios/info", "/changepoints", "/fit", "/vehicle_1/route", "/report"
    )
    suites = [processes("first", NODES)]
    try:
        first = list(client.wait("/scenarios", 3))
        client.wait("/scenarios/info", 4)
        client.wait("/report")
        for node in ("segmenter", "planner"):
            os.kill(suites[0].pids[node], signal.SIGKILL)
        suites.append(processes("second", ("segmenter", "planner")))
        for topic in (
            "/changepoints",
            "/fit",
            "/vehicle_1/route",
        ):  # the latched inputs came again
            assert len(set(client.wait(topic, 2))) == 1, topic
        # the sampler, which lives, heard the same inputs again and made nothing of them: this is its second request
        result = client.generate(count=1, seed=9)
        assert result.successful and result.reason.startswith("request 2: 1 of 1"), result.reason
        other = client.wait("/scenarios", 4)[3]

        os.kill(suites[0].pids["gp_sampler"], signal.SIGKILL)
        suites.append(processes("third", ("gp_sampler",)))
        assert client.wait("/scenarios", 7) == [*first, other, *first], (
            "the same set again, for late joiners"
        )
        client.wait("/scenarios/info", 4 + 2 + 4)
        closed = [info for info in client.infos() if isinstance(info, RequestSummary)]
        assert [summary.request for summary in closed] == ["1", "2", "1"]
        reports = client.wait("/report", 3)  # the evaluator's, which lives
        rows = [{row.name: row.values for row in decode_diagnostics(data)[1]} for data in reports]
        assert [row["/evaluator: with changepoints"]["samples"] for row in rows] == ["3", "1", "3"]
    finally:
        codes = [suite.end() for suite in suites]
    killed = dict.fromkeys(("segmenter", "planner", "gp_sampler"), -signal.SIGKILL)
    assert codes == [
        dict.fromkeys(NODES, 0) | killed,
        {"segmenter": 0, "planner": 0},
        {"gp_sampler": 0},
    ]

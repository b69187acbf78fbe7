# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A healthy suite with traffic, as the launch files start them, warns of nothing: neither on the terminal nor on /diagnostics."""

from collections import Counter
from itertools import chain

import pytest
from support.launching import launched, words
from support.node_server import start_nodes
from support.suite_processes import RESOURCES

from msg_conventions.diagnostics import decode_diagnostics, Level
from scenario_gen.ros.node_names import SUITE

SCENARIOS = 3


@pytest.mark.dds
def test_a_healthy_suite_is_quiet(domain, client, tmp_path):
    """Without tf2_msgs, which a small installation does not have."""
    client.hear("/diagnostics", "/report")
    where = {"ROS_DOMAIN_ID": str(domain), "ROS_LOG_DIR": str(tmp_path), "WITHOUT_TF2": "1"}
    suite = launched(
        log=str(RESOURCES / "synthetic_c"),
        road="straight",
        count=str(SCENARIOS),
        bag=str(tmp_path / "bag"),
    )
    nodes = [*suite, *launched("drive.launch.py")]
    processes = {
        node.executable: start_nodes(node.executable, *words(node), **where) for node in nodes
    }
    try:
        client.wait("/report")
        begun = len(client.heard["/diagnostics"])

        def all_have_reported() -> bool:
            """Several times since then: they look for other publishers each second."""
            reporting = (
                {status.node.removeprefix("/") for status in decode_diagnostics(data)[1]}
                for data in client.heard["/diagnostics"][begun:]
            )
            nodes = Counter(chain.from_iterable(reporting))
            return all(nodes[node] >= 4 for node in (*SUITE, "traffic"))

        client.until(all_have_reported, "the statuses of all nodes")
        statuses = client.statuses()
        assert {status.node.removeprefix("/") for status in statuses} == {*SUITE, "traffic"}
        findings = {str(status) for status in statuses if status.level is not Level.OK}
        lines = [
            line
            for process in processes.values()
            for line in process.output().splitlines()
            if "[INFO]" not in line
        ]
        assert (findings, lines) == (set(), [])
    finally:
        for process in processes.values():
            process.kill()

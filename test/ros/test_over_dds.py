# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The nodes as the launch files start them, in processes of their own, over DDS; without tf2_msgs, as in a small installation."""

from collections import Counter
from itertools import chain
import math
import signal
from types import SimpleNamespace

import pytest
from support.launching import launched, words
from support.node_server import start_nodes
from support.suite_processes import Client, RESOURCES

from msg_conventions.diagnostics import decode_diagnostics, Level
from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.ros.node_names import SUITE

pytestmark = pytest.mark.dds
NODES = (*SUITE, "traffic")
LATCHED = ("/map", "/tracks", "/changepoints", "/posterior", "/fit", "/vehicle_1/route", "/report")


@pytest.fixture(scope="module")
def suite(tmp_path_factory, domain):
    """All nodes, at work on one log, and a client from the start; ended as Ctrl-C does, and then looked at."""
    folder, client = tmp_path_factory.mktemp("suite"), Client(domain)
    client.hear("/diagnostics", "/scenarios", "/scenarios/info", "/report")
    where = {"ROS_DOMAIN_ID": str(domain), "ROS_LOG_DIR": str(folder), "WITHOUT_TF2": "1"}
    arguments = {"log": RESOURCES / "synthetic_c", "road": "straight", "count": 4}
    arguments["bag"] = folder / "bag"
    nodes = launched(**{name: str(value) for name, value in arguments.items()})
    processes = {
        node.executable: start_nodes(
            node.executable, *words(node), RCUTILS_COLORIZED_OUTPUT="0", **where
        )
        for node in (*nodes, *launched("drive.launch.py"))
    }
    yield SimpleNamespace(bag=folder / "bag", client=client, processes=processes)
    for process in processes.values():
        process.kill()
    client.close()


def test_a_late_joiner_gets_everything(suite, domain):
    suite.client.wait("/scenarios/info", 5)
    late = Client(domain, "late")
    try:
        late.hear(*LATCHED, "/scenarios")
        for topic in LATCHED:
            late.wait(topic)
        assert late.wait("/scenarios", 4) == suite.client.wait("/scenarios", 4)
        rows = {s.name: s.values for s in decode_diagnostics(late.heard["/report"][0])[1]}
        assert math.isfinite(float(rows["/evaluator: with changepoints"]["e_position"]))
    finally:
        late.close()


def test_a_healthy_suite_is_quiet(suite):
    """Neither warnings on /diagnostics nor lines in the logs."""
    client = suite.client
    client.wait("/report")
    begun = len(client.heard["/diagnostics"])

    def all_have_reported() -> bool:
        """Several times since then: they look for other publishers each second."""
        reporting = (
            {status.node.removeprefix("/") for status in decode_diagnostics(data)[1]}
            for data in client.heard["/diagnostics"][begun:]
        )
        counts = Counter(chain.from_iterable(reporting))
        return all(counts[node] >= 4 for node in NODES)

    client.until(all_have_reported, "the statuses of all nodes")
    statuses = client.statuses()
    assert {status.node.removeprefix("/") for status in statuses} == set(NODES)
    findings = {str(status) for status in statuses if status.level is not Level.OK}
    logs = (process.output().splitlines() for process in suite.processes.values())
    lines = [line for line in chain.from_iterable(logs) if "[INFO]" not in line]
    assert (findings, lines) == (set(), [])


def test_ctrl_c_leaves_a_whole_bag(suite):
    for process in suite.processes.values():
        process.send_signal(signal.SIGINT)
    codes = {node: process.wait(180.0) for node, process in suite.processes.items()}
    assert codes == dict.fromkeys(NODES, 0)
    logs = {node: process.output() for node, process in suite.processes.items()}
    for log in logs.values():
        assert "Traceback" not in log, log
        assert log.count("parameters: ") == 1
    assert "[gp_sampler]: parameters: count=4\n" in logs["gp_sampler"]
    assert "[planner]: parameters: all have their defaults\n" in logs["planner"]
    recorded = {message.topic for message in read_messages(suite.bag)}
    assert {*LATCHED, "/scenarios", "/scenarios/info"} - {"/posterior", "/report"} <= recorded

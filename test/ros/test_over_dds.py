# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The nodes in processes of their own, over DDS."""

import math

import pytest
from support.suite_processes import Client, whole_chain

from msg_conventions.diagnostics import decode_diagnostics
from scenario_gen.bags.storage.bag import read_messages

pytestmark = pytest.mark.dds
CHAIN = (
    "log_player",
    "segmenter",
    "planner",
    "gp_sampler",
    "road_server",
    "evaluator",
    "recorder",
)


LATCHED = ("/map", "/tracks", "/changepoints", "/posterior", "/fit", "/vehicle_1/route", "/report")


@pytest.fixture(scope="module")
def suite(tmp_path_factory, domain):
    """All nodes, at work on one log; ended as Ctrl-C does, and then looked at."""
    yield from whole_chain(tmp_path_factory.mktemp("suite"), domain, CHAIN, count=4, apart=CHAIN)


def test_a_late_joiner_gets_everything(suite, client):
    client.hear("/scenarios", "/scenarios/info")
    client.wait("/scenarios/info", 5)
    late = Client(client.context.get_domain_id())
    try:
        late.hear(*LATCHED, "/scenarios")
        for topic in LATCHED:
            late.wait(topic)
        assert late.wait("/scenarios", 4) == client.wait("/scenarios", 4)
        rows = {s.name: s.values for s in decode_diagnostics(late.heard["/report"][0])[1]}
        assert math.isfinite(float(rows["/evaluator: with changepoints"]["e_position"]))
    finally:
        late.close()


def test_ctrl_c_leaves_a_whole_bag(suite):
    codes = suite.end()
    assert codes == dict.fromkeys(CHAIN, 0)
    for node in CHAIN:
        assert "Traceback" not in suite.log(node), suite.log(node)
        assert suite.log(node).count("parameters: ") == 1
    assert "[gp_sampler]: parameters: count=4, seed=7\n" in suite.log("gp_sampler")
    assert "[planner]: parameters: all have their defaults\n" in suite.log("planner")
    recorded = {message.topic for message in read_messages(suite.folder / "bag")}
    wanted = {*LATCHED, "/scenarios", "/scenarios/info"} - {"/posterior", "/report"}
    assert wanted <= recorded

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The nodes in processes of their own, over DDS."""

import math

import numpy as np
import pytest
from support.suite_processes import Client, whole_chain

from msg_conventions import trajectory
from msg_conventions.diagnostics import decode_diagnostics
from msg_conventions.roads import decode_map
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


@pytest.fixture(scope="module")
def suite(tmp_path_factory, domain):
    """All nodes, at work on one log; ended as Ctrl-C does, and then looked at."""
    yield from whole_chain(tmp_path_factory.mktemp("suite"), domain, CHAIN, count=4, apart=CHAIN)


def test_a_late_joiner_gets_everything(suite, client):
    client.hear("/scenarios", "/scenarios/info")
    client.wait("/scenarios/info", 5)
    late = Client(client.context.get_domain_id())
    try:
        late.hear(
            "/map",
            "/tracks",
            "/changepoints",
            "/posterior",
            "/fit",
            "/vehicle_1/route",
            "/scenarios",
            "/report",
        )
        for topic in (
            "/map",
            "/tracks",
            "/changepoints",
            "/posterior",
            "/fit",
            "/vehicle_1/route",
            "/report",
        ):
            late.wait(topic)
        assert late.wait("/scenarios", 4) == client.wait("/scenarios", 4)
        rows = {s.name: s.values for s in decode_diagnostics(late.heard["/report"][0])[1]}
        assert math.isfinite(float(rows["/evaluator: with changepoints"]["e_position"]))
    finally:
        late.close()


def test_maps_are_served_or_refused(suite, client):
    from nav_msgs.srv import GetMap, LoadMap

    client.hear("/map", "/diagnostics")
    (grid, *_) = client.wait("/map")
    answer = client.call(GetMap, "/road_server/get_map", GetMap.Request())
    assert (answer.map.info.width, answer.map.info.height) == decode_map(grid)[1].drivable.shape[
        ::-1
    ]
    for url in ("file:///no/such/map.yaml", "package://no_such_package/map.yaml", "nonsense"):
        answer = client.call(LoadMap, "/road_server/load_map", LoadMap.Request(map_url=url))
        assert answer.result in (
            LoadMap.Response.RESULT_MAP_DOES_NOT_EXIST,
            LoadMap.Response.RESULT_INVALID_MAP_METADATA,
        )
    client.until(
        lambda: any("nonsense" in s.message for s in client.statuses()),
        "the reason on /diagnostics",
    )


def test_plans_are_served_or_refused(suite, client):
    from nav_msgs.srv import GetPlan

    client.hear("/diagnostics", "/fit")
    fit = trajectory.decode(client.wait("/fit")[0], "fit")
    start, goal = np.dstack([fit.position, fit.heading])[0, [0, -1]]
    request = GetPlan.Request()
    request.start.header.frame_id, request.start.header.stamp.sec = "map", 123
    request.start.pose.position.x, request.start.pose.position.y = start[:2]
    request.goal.pose.position.x, request.goal.pose.position.y = goal[:2]
    for end, state in ((request.start, start), (request.goal, goal)):
        turn = end.pose.orientation
        turn.z, turn.w = np.sin(0.5 * state[2]), np.cos(0.5 * state[2])
    plan = client.call(GetPlan, "/planner/get_plan", request).plan
    assert len(plan.poses) >= 2
    assert plan.header.stamp.sec == 123
    assert plan.poses[0].pose.position.x == request.start.pose.position.x
    assert plan.poses[-1].pose.position.y == request.goal.pose.position.y
    for stamp, (field, value, reason) in enumerate(
        (
            ("tolerance", -1.0, "tolerance"),
            ("frame", "elsewhere", "elsewhere"),
            ("x", math.nan, "finite"),
            ("w", 0.0, "no rotation"),
        )
    ):
        bad = GetPlan.Request(start=request.start, goal=request.goal)
        bad.start.header.stamp.sec = stamp
        if field == "tolerance":
            bad.tolerance = value
        elif field == "frame":
            bad.start.header.frame_id = value
        elif field == "w":
            bad.start.header.frame_id, bad.start.pose.position.x = "map", 0.0
            bad.start.pose.orientation.z = bad.start.pose.orientation.w = value
        else:
            bad.start.header.frame_id = "map"
            bad.start.pose.position.x = value
        assert not client.call(GetPlan, "/planner/get_plan", bad).plan.poses
        client.until(
            lambda reason=reason: any(
                s.name.startswith("/planner") and reason in s.message for s in client.statuses()
            ),
            f"{reason} on /diagnostics",
        )


def test_ctrl_c_leaves_a_whole_bag(suite):
    codes = suite.end()
    assert codes == dict.fromkeys(CHAIN, 0)
    for node in CHAIN:
        assert "Traceback" not in suite.log(node), suite.log(node)
        assert suite.log(node).count("parameters: ") == 1
    assert "[gp_sampler]: parameters: count=4, seed=7\n" in suite.log("gp_sampler")
    assert "[planner]: parameters: all have their defaults\n" in suite.log("planner")
    recorded = {message.topic for message in read_messages(suite.folder / "bag")}
    assert {
        "/map",
        "/tracks",
        "/changepoints",
        "/fit",
        "/vehicle_1/route",
        "/scenarios",
        "/scenarios/info",
    } <= recorded

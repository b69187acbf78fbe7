# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Many callers from processes of their own, and calls that are answered while long work runs."""

import json
import os
import re
import subprocess
import sys

import pytest
from support.lengths import LONG
from support.suite_processes import Processes, RESOURCES

from msg_conventions.scenario_info import ScenarioEntry
from msg_conventions.scenarios import digest
from scenario_gen.ros.nodes.gp_sampler import GpSampler

pytestmark = pytest.mark.dds
CALLER = """
import json, sys
import scenario_gen.ros.nodes
from support.known_readers import until_known_at
import rclpy
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
rclpy.init()
node = rclpy.create_node(f"caller_{sys.argv[1]}")
client = node.create_client(SetParametersAtomically, "gp_sampler/generate")
assert client.wait_for_service(180.0)
values = {"seed": int(sys.argv[1]), "count": int(sys.argv[2])}
request = SetParametersAtomically.Request(parameters=[Parameter(k, value=v).to_parameter_msg() for k, v in values.items()])
until_known_at(node, "gp_sampler", lambda answer: rclpy.spin_until_future_complete(node, answer, timeout_sec=1.0))
future = client.call_async(request)
rclpy.spin_until_future_complete(node, future, timeout_sec=300.0)
result = future.result().result
print(json.dumps([result.successful, result.reason]))
"""


@pytest.fixture(scope="module")
def suite(tmp_path_factory, domain):
    nodes = {
        "log_player": ["-p", f"log_path:={RESOURCES / 'synthetic_c'}"],
        "road_server": ["-p", "road_name:=straight", "-p", "wait_for_tracks:=true"],
        "segmenter": [],
        "planner": [],
        "gp_sampler": ["-p", "generate_on_input:=false"],
    }
    made = Processes(tmp_path_factory.mktemp("load"), domain, nodes)
    yield made
    made.end()


@pytest.mark.slow
def test_callers_from_many_processes_get_their_own_answers(suite, domain, client):
    client.until(lambda: client.generate(count=1).successful, "the sampler's inputs")
    client.hear("/scenarios", "/scenarios/info")
    client.wait("/scenarios/info", 2)
    client.heard.clear()
    counts = {seed: 1 + seed % 3 for seed in range(500, 520 if LONG else 504)}
    environment = os.environ | {
        "ROS_DOMAIN_ID": str(domain),
        "PYTHONPATH": os.pathsep.join(sys.path),
    }
    callers = {
        seed: subprocess.Popen(
            [sys.executable, "-c", CALLER, str(seed), str(count)],
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )
        for seed, count in counts.items()
    }
    said = {seed: caller.communicate(timeout=400.0)[0] for seed, caller in callers.items()}
    assert all(said.values()), (
        f"callers without an answer: {[seed for seed in said if not said[seed]]}\n{suite.log('gp_sampler')}"
    )
    answers = {seed: json.loads(words) for seed, words in said.items()}
    for seed, (successful, reason) in answers.items():
        assert successful, reason
        assert f"{counts[seed]} of {counts[seed]} scenarios" in reason
    requests = {
        seed: reason.partition(":")[0].split()[-1] for seed, (_, reason) in answers.items()
    }
    assert len(set(requests.values())) == len(counts)
    client.wait("/scenarios/info", sum(counts.values()) + len(counts))
    client.wait("/scenarios", sum(counts.values()))
    heard = {digest(data) for data in client.heard["/scenarios"]}
    infos = [info for info in client.infos() if isinstance(info, ScenarioEntry)]
    for seed, request in requests.items():
        own = [entry for entry in infos if entry.request == request]
        assert {entry.seed for entry in own} == {seed}
        assert len(own) == counts[seed]
        assert all(entry.sha256 in heard for entry in own)


def test_a_map_is_served_while_another_is_loaded(suite, domain, client):
    """load_map works off the executor's thread, so calls come between, and every caller gets the map that was asked for."""
    from nav_msgs.srv import GetMap, LoadMap

    client.hear("/map")
    client.wait("/map")
    loads = {
        url: client.call_later(LoadMap, "/road_server/load_map", LoadMap.Request(map_url=url))
        for url in ("four_way", "straight")
    }
    between = client.call(GetMap, "/road_server/get_map", GetMap.Request())
    assert between.map.info.width > 0
    sizes = {}
    for url, future in loads.items():
        client.until(future.done, url)
        assert future.result().result == LoadMap.Response.RESULT_SUCCESS
        sizes[url] = future.result().map.info.height
    assert sizes["four_way"] > sizes["straight"]


def test_long_work_says_how_far_it_is_lets_others_be_served_and_can_be_cancelled(suite, client):
    from nav_msgs.srv import GetMap, GetPlan
    from rcl_interfaces.srv import ListParameters, SetParametersAtomically
    from rclpy.parameter import Parameter
    from std_srvs.srv import Trigger

    client.hear("/diagnostics")
    client.until(lambda: client.generate(count=1).successful, "the sampler's inputs")
    running, *others = [client.generate_later(count=20_000) for _ in range(GpSampler.THREADS)]
    waiting = client.generate_later(count=2, seed=3)
    name = "/gp_sampler: progress"
    client.until(
        lambda: any(
            s.name == name and s.values.get("requested") == "20000" for s in client.statuses()
        ),
        "progress",
    )
    assert client.call(
        ListParameters, "/gp_sampler/list_parameters", ListParameters.Request()
    ).result.names
    assert client.call(GetMap, "/road_server/get_map", GetMap.Request()).map.data
    client.call(GetPlan, "/planner/get_plan", GetPlan.Request())
    assert not running.done(), "the others were to be served while it ran"
    third = client.generate_later(count=20_000, request="third")
    one = SetParametersAtomically.Request(
        parameters=[Parameter("request", value="third").to_parameter_msg()]
    )
    client.until(
        lambda: (
            client.call(
                SetParametersAtomically, "/gp_sampler/cancel_request", one
            ).result.successful
        ),
        "its end",
    )
    client.until(third.done, "the answer of one that waited, though others did not end")
    assert third.result().result.reason == "request third: cancelled" and not running.done()
    refused = client.call(SetParametersAtomically, "/gp_sampler/cancel_request", one).result
    assert not refused.successful and "no request 'third' is open; open: " in refused.reason
    cancelled = set()

    def ended() -> bool:  # the second request may come after the first call
        cancelled.update(
            re.findall(
                r"request \d+",
                client.call(Trigger, "/gp_sampler/cancel", Trigger.Request()).message,
            )
        )
        return all(future.done() for future in (running, *others, waiting))

    client.until(ended, "the answers of what was cancelled")
    assert len(cancelled) == GpSampler.THREADS + 1
    for future in (running, *others, waiting):
        assert not future.result().result.successful
        assert "cancelled" in future.result().result.reason
    assert not client.call(Trigger, "/gp_sampler/cancel", Trigger.Request()).success
    assert client.generate(count=1).successful

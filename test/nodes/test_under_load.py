# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Many callers from processes of their own, and calls that are answered while long work runs."""

import json
import os
import subprocess
import sys
import time

import pytest
from suite_processes import Processes, RESOURCES

from msg_conventions.diagnostics import decode_diagnostics
from msg_conventions.scenarios import digest

pytestmark = pytest.mark.dds
CALLER = """
import json, sys
import scenario_gen.nodes
import rclpy
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
rclpy.init()
node = rclpy.create_node(f"caller_{sys.argv[1]}")
client = node.create_client(SetParametersAtomically, "gp_sampler/generate")
assert client.wait_for_service(60.0)
values = {"seed": int(sys.argv[1]), "count": int(sys.argv[2])}
request = SetParametersAtomically.Request(parameters=[Parameter(k, value=v).to_parameter_msg() for k, v in values.items()])
future = client.call_async(request)
rclpy.spin_until_future_complete(node, future, timeout_sec=90.0)
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
def test_twenty_callers_from_twenty_processes_get_their_own_answers(suite, domain, client):
    client.hear("/fit", "/vehicle_1/route", "/scenarios", "/scenarios/info")
    client.wait("/fit")
    client.wait("/vehicle_1/route")
    time.sleep(1.0)  # the sampler's own subscriptions
    counts = {seed: 1 + seed % 3 for seed in range(500, 520)}
    environment = os.environ | {"ROS_DOMAIN_ID": str(domain)}
    callers = {
        seed: subprocess.Popen(
            [sys.executable, "-c", CALLER, str(seed), str(count)], stdout=subprocess.PIPE, text=True, env=environment
        )
        for seed, count in counts.items()
    }
    answers = {seed: json.loads(caller.communicate(timeout=120.0)[0]) for seed, caller in callers.items()}
    for seed, (successful, reason) in answers.items():
        assert successful, reason
        assert f"{counts[seed]} of {counts[seed]} scenarios" in reason
    requests = {seed: reason.partition(":")[0].split()[-1] for seed, (_, reason) in answers.items()}
    assert len(set(requests.values())) == 20
    client.wait("/scenarios/info", sum(counts.values()) + len(counts))
    client.wait("/scenarios", sum(counts.values()))
    heard = {digest(data) for data in client.heard["/scenarios"]}
    infos = [decode_diagnostics(data)[1][0].values for data in client.heard["/scenarios/info"]]
    for seed, request in requests.items():
        own = [values for values in infos if values["request"] == request and "sha256" in values]
        assert {values["seed"] for values in own} == {str(seed)}
        assert len(own) == counts[seed]
        assert all(values["sha256"] in heard for values in own)


def test_a_map_is_served_while_another_is_loaded(suite, domain, client):
    """load_map works off the executor's thread, so calls come between, and every caller gets the map that was asked for."""
    from nav_msgs.srv import GetMap, LoadMap

    client.hear("/map")
    client.wait("/map")
    loads = {
        url: client.call_later(LoadMap, "/road_server/load_map", LoadMap.Request(map_url=url)) for url in ("four_way", "straight")
    }
    between = client.call(GetMap, "/road_server/get_map", GetMap.Request())
    assert between.map.info.width > 0
    sizes = {}
    for url, future in loads.items():
        client.until(future.done, url)
        assert future.result().result == LoadMap.Response.RESULT_SUCCESS
        sizes[url] = future.result().map.info.height
    assert sizes["four_way"] > sizes["straight"]

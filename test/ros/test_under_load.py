# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Many callers from processes of their own, and calls that are answered while long work runs."""

import re

import pytest
from support.suite_processes import Processes, RESOURCES

from scenario_gen.ros.nodes.gp_sampler import GpSampler

pytestmark = pytest.mark.dds


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


def test_long_work_can_be_cancelled(suite, client):
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

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The parts of the nodes that need no other process."""

import math
from pathlib import Path
import threading

from nav_msgs.srv import GetPlan
import numpy as np
import pytest

from msg_conventions.cdr import encode
from msg_conventions.documents import encode_document, hash_of, Head
from msg_conventions.layouts import HEADER
from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import flatten
from scenario_gen.base.worker import Worker
from scenario_gen.pipeline import PipelineConfig
from scenario_gen.roads import build_road
from scenario_gen.ros.common.ros_parameters import descriptor
from scenario_gen.ros.common.stage_node import Inputs
from scenario_gen.ros.common.suite import Job, parameters
from scenario_gen.ros.nodes import planner
from scenario_gen.ros.nodes.road_server import road_of_url

ROOT = Path(__file__).resolve().parents[2]


def _message(stamp: int) -> bytes:
    return encode(HEADER, stamp=stamp, frame_id="map")


def test_inputs_need_equal_stamps():
    inputs = Inputs(("tracks", "changepoints"), ("map",))
    assert inputs.missing() == ["changepoints", "map", "tracks"]
    inputs.put("tracks", _message(1))
    inputs.put("map", _message(99))
    inputs.put("changepoints", _message(0))
    assert inputs.missing() == ["changepoints"]
    inputs.put("changepoints", _message(1))
    assert inputs.complete() is not None
    inputs.put("tracks", _message(2))  # a new template: the old changepoints wait for their like
    assert inputs.missing() == ["changepoints"]
    inputs.put("changepoints", _message(2))
    assert set(inputs.complete()) == {"tracks", "changepoints", "map"}


def _document(messages: dict[str, bytes]) -> bytes:
    hashes = {topic: hash_of(topic, data) for topic, data in messages.items()}
    return encode_document(Head(1, hashes))


def test_inputs_match_their_documents():
    inputs = Inputs(("tracks", "road/lanes", "fit/info"), ("map",))
    one, other = (encode(HEADER, stamp=1, frame_id=frame) for frame in ("map", "odom"))
    messages = {"tracks": _message(1), "map": one, "road/lanes": _document({"map": one})}
    for topic, data in messages.items():
        inputs.put(topic, data)
    assert inputs.missing() == ["fit/info"]
    inputs.put("fit/info", _document(messages) + bytes(3))  # as DDS fills it up
    complete = inputs.complete()
    assert complete is not None and not inputs.replaced(complete)
    inputs.put("map", other)  # the fit is not to this map, even if the planner never says another
    assert inputs.missing() == ["road/lanes of this map", "fit/info of this map"]
    assert inputs.complete() is None and inputs.replaced(complete)
    with pytest.raises(InputError, match="fit/info"):
        inputs.put("fit/info", _message(1))
    inputs.put("road/lanes", _document({"map": other}))
    assert inputs.missing() == ["fit/info of this map", "fit/info of this road/lanes"]
    messages |= {"map": other, "road/lanes": _document({"map": other})}
    inputs.put("fit/info", _document(messages))
    assert inputs.complete() is not None


def test_waiting_job_is_replaced():
    done, failures, gate = [], [], threading.Event()
    worker = Worker(lambda name, error: failures.append((name, str(error))))
    started = threading.Event()

    def long(cancelled):
        started.set()
        gate.wait(180.0)
        done.append(("long", cancelled()))

    worker.submit("a", long)
    assert started.wait(180.0)
    worker.submit("b", lambda cancelled: done.append(("old", cancelled())))
    worker.submit("b", lambda cancelled: done.append(("new", cancelled())))
    worker.submit("a", lambda cancelled: done.append(("again", cancelled())))
    worker.submit("c", lambda _: 1 / 0)
    gate.set()
    finished = threading.Event()
    worker.submit("end", lambda _: finished.set())
    assert finished.wait(180.0)
    assert done == [("long", True), ("new", False), ("again", False)]
    assert failures == [("c", "division by zero")]
    worker.close()


def test_parameters_have_descriptors_with_ranges():
    for name, (entry, _value) in flatten(PipelineConfig()).items():
        made = descriptor(entry)
        assert made.description, name
        if isinstance(entry.default, float) and entry.metadata["low"] is not None:
            assert made.floating_point_range[0].from_value == entry.metadata["low"]
        if entry.metadata["choices"]:
            assert entry.metadata["choices"][0] in made.additional_constraints


def test_urls_of_load_map():
    assert road_of_url("file:///maps/a%20b.yaml") == "/maps/a b.yaml"
    assert road_of_url("straight") == "straight"
    with pytest.raises(InputError, match="no_such_package"):
        road_of_url("package://no_such_package/map.yaml")
    with pytest.raises(InputError, match="file://"):
        road_of_url("http://example.org/map.yaml")


def test_suite_passes_on_all_parameters(tmp_path):
    body = parameters(
        [Job("/x", tmp_path / "log", "straight", 3)], PipelineConfig(), 5, 7, tmp_path / "bag"
    )
    given = {name for node in body.values() for name in node["ros__parameters"]}
    stages = {"log", "road", "segmentation", "fitting", "planning", "sampling", "limits"}
    assert {name for name in flatten(PipelineConfig()) if name.split(".")[0] in stages} <= given
    assert body["/x/gp_sampler"]["ros__parameters"]["count"] == 5
    assert body["/x/log_player"]["ros__parameters"]["encounter"] == 3


def _plan_request(**changes: float | str) -> GetPlan.Request:
    """Along the built-in straight road, with fields of the goal and the tolerance changed."""
    request = GetPlan.Request()
    request.start.pose.position.x, request.goal.pose.position.x = 10.0, 100.0
    request.start.pose.position.y = request.goal.pose.position.y = 3.75
    request.tolerance = changes.get("tolerance", 0.0)
    request.goal.header.frame_id = changes.get("frame", "map")
    request.goal.pose.position.x = changes.get("x", 100.0)
    request.goal.pose.orientation.w = changes.get("w", 1.0)
    return request


def test_plan_joins_the_requested_poses():
    query = planner.query_of(_plan_request(), "map", planner.Config())
    path = planner.plan_poses(build_road("straight"), query, planner.Config())
    assert np.allclose(path[[0, -1]], [[10.0, 3.75, 0.0], [100.0, 3.75, 0.0]])


@pytest.mark.parametrize(
    ("field", "value", "named"),
    [
        ("tolerance", -1.0, "tolerance"),
        ("frame", "elsewhere", "goal .*elsewhere"),
        ("x", math.nan, "goal is not finite"),
        ("w", 0.0, "goal: quaternion"),
    ],
)
def test_impossible_plan_requests_are_refused(field, value, named):
    with pytest.raises(InputError, match=named):
        planner.query_of(_plan_request(**{field: value}), "map", planner.Config())

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The parts of the nodes that need no other process."""

from pathlib import Path
import threading

import pytest
from rclpy.parameter import Parameter

from msg_conventions.cdr import encode
from msg_conventions.documents import encode_document, hash_of, Head
from msg_conventions.layouts import HEADER
from scenario_gen.base.errors import InputError
from scenario_gen.base.parameters import flatten
from scenario_gen.base.worker import Worker
from scenario_gen.pipeline import PipelineConfig
from scenario_gen.ros.common.ros_parameters import descriptor, with_values
from scenario_gen.ros.common.stage_node import Inputs
from scenario_gen.ros.common.suite import Job, parameters
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


def test_values_are_checked():
    config = PipelineConfig()
    assert with_values(config, [Parameter("road.lane_width", value=4)]).road.lane_width == 4.0
    with pytest.raises(InputError, match=r"lane_width.*at least"):
        with_values(config, [Parameter("road.lane_width", value=-4.0)])


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

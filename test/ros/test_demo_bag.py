# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The demo's way: jobs through real nodes into one bag, and the bag through fresh nodes again."""

import threading
from types import SimpleNamespace

import pytest
from support.node_server import process
from support.suite_processes import Processes, RESOURCES

from msg_conventions.documents import DOCUMENTS, hash_of
from msg_conventions.scenario_info import decode_info
from msg_conventions.scenarios import encode_scenario
from scenario_gen.bags.recordings.write import result_messages
from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.base.errors import InputError
from scenario_gen.logs import read_log
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.ros.common.suite import Job, run_suite

pytestmark = [pytest.mark.dds, pytest.mark.slow]
JOBS = (
    Job("/case_1", RESOURCES / "synthetic_c", "straight"),
    Job("/case_2", RESOURCES / "synthetic_b", "t_intersection"),
)


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """The bag of two jobs, alone in its folder."""
    folder = tmp_path_factory.mktemp("demo")
    return run_suite(JOBS, PipelineConfig(), count=3, seed=7, bag=folder / "bag")


@pytest.fixture(scope="module", autouse=True)
def forked():
    """Processes that have loaded the libraries, as the other tests have them."""
    with pytest.MonkeyPatch.context() as patch:
        context = SimpleNamespace(Process=process)
        patch.setattr(
            "scenario_gen.ros.common.suite.multiprocessing",
            SimpleNamespace(get_context=lambda _: context),
        )
        yield


def test_suite_records_jobs_in_namespaces(demo):
    for job in JOBS:
        encounter = read_log(job.log).encounters[0]
        case = generate(encounter, job.road, PipelineConfig(), count=3, seed=7)
        expected = [encode_scenario(s, encounter.start_ns) for s in case.generated.scenarios]
        assert [
            m.data for m in read_messages(demo) if m.topic == f"{job.namespace}/scenarios"
        ] == expected
        written = list(result_messages(case))
        for topic in DOCUMENTS:
            own = [data for name, data, _ in written if name == topic]
            assert [
                m.data for m in read_messages(demo) if m.topic == f"{job.namespace}/{topic}"
            ] == own
        messages = {topic: data for topic, data, _ in written}
        infos = [
            decode_info(m.data)
            for m in read_messages(demo)
            if m.topic == f"{job.namespace}/scenarios/info"
        ]
        inputs = {topic: hash_of(topic, messages[topic]) for topic in ("tracks", "map")}
        assert [info.inputs for info in infos] == [inputs] * 4
    assert [path.name for path in demo.parent.iterdir()] == ["bag"]


def test_played_back_bag_gives_same_bytes(demo, tmp_path, domain, client):
    """Tracks and road of both jobs into fresh nodes that live in the bag's time, each in its namespace."""
    recorded = {}
    for message in read_messages(demo):
        recorded.setdefault(message.topic, []).append(message.data)
    sim_time = ["-p", "use_sim_time:=true"]
    topics = "/case_./(tracks|map|road/lanes)"
    played = {"bag": demo, "topics": topics, "rate": 1000.0, "clock": "true", "stay": "true"}
    nodes = {
        "player": [word for name, value in played.items() for word in ("-p", f"{name}:={value}")],
        "segmenter": [*sim_time, "-p", "seed:=7"],
        "planner": [*sim_time, "-p", "seed:=7"],
        "gp_sampler": [*sim_time, "-p", "count:=3", "-p", "seed:=7"],
    }
    spaces = tuple(job.namespace for job in JOBS)
    made = Processes(
        tmp_path, domain, nodes, {node: spaces for node in nodes if node != "player"}, apart=nodes
    )
    try:
        derived = [
            f"{space}/{topic}"
            for space in spaces
            for topic in ("changepoints", "posterior", "fit/info", "scenarios")
        ]
        client.hear(*derived)
        for topic in derived:
            assert client.wait(topic, len(recorded[topic])) == recorded[topic], topic
    finally:
        assert made.end() == dict.fromkeys(nodes, 0)


def test_failed_job_names_its_stage(tmp_path):
    with pytest.raises(InputError, match="/x/log_player"):
        run_suite(
            [Job("/x", tmp_path / "none.csv", "straight")],
            PipelineConfig(),
            count=3,
            seed=7,
            bag=tmp_path / "bag",
        )
    assert list(tmp_path.iterdir()) == []
    assert threading.active_count() < 20

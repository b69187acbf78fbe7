# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""An ego slot and start and end states, asked of the node: the bytes of the same request in process, and all of it in the bag."""

import re

import pytest
from support.bag_examples import skipped
from support.message_decoders import decode_state
from support.suite_processes import Processes, RESOURCES

from msg_conventions.ego import ego_messages
from msg_conventions.scenario_info import RequestSummary, ScenarioEntry
from msg_conventions.scenarios import digest, encode_scenario
from scenario_gen.bags.recordings.read import load, read_recording
from scenario_gen.bags.recordings.write import result_messages
from scenario_gen.logs import read_log
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.output.review.evaluation import evaluate_bag
from scenario_gen.pipeline import generate, generate_outcomes, PipelineConfig
from scenario_gen.types import Request, token

pytestmark = pytest.mark.dds
LOG, ROAD, SEED = RESOURCES / "synthetic_b", "t_intersection", 7
CHAIN = ("log_player", "segmenter", "planner", "gp_sampler", "road_server", "recorder")
MOVED = {"starts": "2: 53 4.57 0 9.5", "goals": "1: 19 8.07 3.1413 11"}


@pytest.fixture(scope="module")
def suite(tmp_path_factory, domain):
    """All nodes but the evaluator, at work on one log."""
    folder = tmp_path_factory.mktemp("requests")
    arguments = {
        node: ["-p", f"seed:={SEED}"] if node in ("segmenter", "planner", "gp_sampler") else []
        for node in CHAIN
    }
    arguments["log_player"] = ["-p", f"log_path:={LOG}"]
    arguments["road_server"] = ["-p", f"road_name:={ROAD}", "-p", "wait_for_tracks:=true"]
    arguments["gp_sampler"] += ["-p", "count:=2"]
    arguments["recorder"] = ["-p", f"bag:={folder / 'bag'}"]
    made = Processes(folder, domain, arguments)
    yield made
    made.kill()


def in_process_result(count, **asked):
    (encounter,) = read_log(LOG).encounters
    return generate(encounter, ROAD, count=count, seed=SEED, request=Request(**asked))


def in_process(count, **asked):
    result = in_process_result(count, **asked)
    return result.encounter, result.generated


def published(client, result):
    """Digests of the scenarios of an answered request, and their accounts."""
    request = re.match(r"request (\d+)", result.reason)[1]

    def accounts():
        return [info for info in client.infos() if info.request == request]

    client.until(lambda: any(isinstance(info, RequestSummary) for info in accounts()), "the end")
    own = [info for info in accounts() if isinstance(info, ScenarioEntry)]
    client.until(
        lambda: (
            {entry.sha256 for entry in own}
            <= {digest(data) for data in client.heard["/scenarios"]}
        ),
        "the scenarios",
    )
    return [entry.sha256 for entry in own], own


def asked_digests(count, **asked):
    """Digests of the scenarios of a request in process."""
    encounter, made = in_process(count, **asked)
    return [digest(encode_scenario(s, encounter.start_ns)) for s in made.scenarios]


def test_ego_has_bytes_as_in_process(suite, client):
    client.hear("/scenarios", "/scenarios/info", "/ego/start", "/ego/goal", "/ego/witness")
    client.wait("/scenarios/info", 3)
    result = client.generate(ego="1", count=3)
    assert result.successful, result.reason
    encounter, made = in_process(3, ego="1")
    digests, accounts = published(client, result)
    assert digests == [digest(encode_scenario(s, encounter.start_ns)) for s in made.scenarios]
    witnesses = [
        digest(encode_scenario(s.reference_drive, encounter.start_ns)) for s in made.scenarios
    ]
    assert [entry.witness for entry in accounts] == witnesses
    client.until(
        lambda: set(witnesses) <= set(map(digest, client.heard["/ego/witness"])), "the witnesses"
    )
    for topic, data in ego_messages(made.ego, "map", encounter.start_ns):
        assert client.wait(f"/{topic}")[-1] == data, topic
    stamp, frame, child, state = decode_state(client.heard["/ego/start"][-1])
    assert (stamp, frame, child) == (encounter.start_ns, "map", "vehicle_1")
    assert all(entry.ego.id == "1" and (entry.ego.start == state).all() for entry in accounts)
    client.announce("/ego/goal")  # as traffic does
    client.until(
        lambda: client.node.count_publishers("/ego/goal") == 1,
        "that the sampler leaves it the goal",
    )


def test_outcomes_have_bytes_as_in_process(suite, client):
    plain = in_process_result(1)
    config = PipelineConfig(sampling=SamplingConfig(decisions="drawn"))
    recorded, *others = generate_outcomes(plain.encounter, plain.road, config, count=8, seed=SEED)
    assert len(others) > 1
    client.hear("/scenarios", "/scenarios/info")
    client.wait("/scenarios/info", 3)
    result = client.generate(**{"sampling.decisions": "drawn", "count": 8})
    assert result.successful, result.reason
    sets = [("", recorded)]
    sets += [(f"/{token(made.encounter.decision.outcome)}", made) for made in others]
    for namespace, made in sets:
        wanted = [data for topic, data, _ in result_messages(made) if topic == "scenarios"]
        topic = f"{namespace}/scenarios"
        client.hear(topic)
        client.until(
            lambda topic=topic, wanted=wanted: set(wanted) <= set(client.heard[topic]), topic
        )
        client.until(
            lambda topic=topic, wanted=wanted: client.counted(topic) >= len(wanted), "the bag"
        )


def test_states_are_in_the_bag(suite, client):
    client.hear("/scenarios", "/scenarios/info")
    client.wait("/scenarios/info", 3)
    results = [client.generate(count=2, **asked) for asked in (MOVED, {})]
    digests = [published(client, result)[0] for result in results]
    assert digests[0] == asked_digests(2, **MOVED)
    assert digests[1] == asked_digests(2), "states are valid for their call only"
    for topic in ("/scenarios", "/scenarios/info"):
        client.until(
            lambda topic=topic: client.counted(topic) >= len(client.heard[topic]),
            f"{topic} in the bag",
        )
    suite.end()
    bag = suite.folder / "bag"
    evaluations = evaluate_bag(bag)
    assert [(found.causes, skipped(found)) for found in evaluations] == [({}, {})] * len(
        evaluations
    )
    outcomes = {str(load(bag, found.namespace).encounter.decision) for found in evaluations[1:]}
    assert len(outcomes) == len(evaluations) - 1 > 1
    hashes = read_recording(bag).namespaces[""].hashes
    assert {sha256 for own in digests for sha256 in own} <= set(hashes)

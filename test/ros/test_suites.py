# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Whole suites, each composed in one process: the same scenarios, and no suite hears another one's."""

import pytest
from support.node_server import start_nodes
from support.suite_processes import Client, RESOURCES

from msg_conventions.scenarios import digest, encode_scenario
from scenario_gen.base.ros_domain import free_domain
from scenario_gen.logs import read_log
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.ros.common.start import chosen_nodes
from scenario_gen.ros.node_names import SUITE

# namespace, domain (by number), log, road, seed
SUITES = (
    ("/a", 0, "synthetic_c", "straight", 7),
    ("/b", 0, "synthetic_b", "t_intersection", 7),
    ("/a", 1, "synthetic_c", "straight", 8),
)
COUNT = 2


@pytest.fixture(scope="module")
def domains():
    with free_domain() as one, free_domain() as other:
        yield (one, other)


@pytest.fixture(scope="module")
def suites(tmp_path_factory, domains):
    folder = tmp_path_factory.mktemp("suites")
    running = []
    for namespace, domain, log, road, seed in SUITES:
        values = {
            "log_path": RESOURCES / log,
            "road_name": road,
            "wait_for_tracks": "true",
            "count": COUNT,
            "seed": seed,
        }
        words = [word for key, value in values.items() for word in ("-p", f"{key}:={value}")]
        where = {"ROS_DOMAIN_ID": str(domains[domain]), "ROS_LOG_DIR": str(folder)}
        running.append(
            start_nodes("suite", "--namespace", namespace, "--ros-args", *words, **where)
        )
    yield
    for process in running:
        process.kill()
        process.communicate()


@pytest.mark.dds
@pytest.mark.slow
def test_each_suite_makes_its_own_scenarios_and_none_meets_another(suites, domains):
    clients = [Client(number) for number in domains]
    try:
        for client in clients:
            client.hear("/a/scenarios", "/b/scenarios", "/a/scenarios/info", "/b/scenarios/info")
        for namespace, domain, log, road, seed in SUITES:
            clients[domain].wait(f"{namespace}/scenarios/info", COUNT + 1)
            heard = clients[domain].wait(f"{namespace}/scenarios", COUNT)
            (encounter,) = read_log(RESOURCES / log).encounters
            case = generate(encounter, road, PipelineConfig(), count=COUNT, seed=seed)
            expected = [
                digest(encode_scenario(s, encounter.start_ns)) for s in case.generated.scenarios
            ]
            assert [digest(data) for data in heard] == expected, (
                "one process must give the bytes that the stages give"
            )
        assert (
            len(clients[0].heard["/a/scenarios"]) == len(clients[0].heard["/b/scenarios"]) == COUNT
        )
        assert not clients[1].heard["/b/scenarios"]
        spaces = [
            {space for _, space in client.node.get_node_names_and_namespaces()}
            for client in clients
        ]
        assert spaces == [{"/", "/a", "/b"}, {"/", "/a"}]
        names = [
            name
            for name, space in clients[0].node.get_node_names_and_namespaces()
            if space == "/a"
        ]
        assert sorted(names) == sorted(SUITE)
    finally:
        for client in clients:
            client.close()


def test_nodes_are_chosen_by_name():
    assert chosen_nodes(["suite", "--nodes", "segmenter,recorder", "--ros-args"]) == (
        ["recorder", "segmenter"],
        ["suite", "--ros-args"],
    )
    assert "player" not in chosen_nodes(["suite"])[0]
    for words in (["--nodes", "no_such"], ["--nodes"]):
        with pytest.raises(SystemExit, match="usage"):
            chosen_nodes(["suite", *words])

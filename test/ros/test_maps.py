# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A set knows its map: another road while sets are at work leaves nothing of the old one beside the new."""

from nav_msgs.srv import LoadMap
import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from support.bag_examples import skipped, unaccounted
from support.lengths import LONG
from support.suite_processes import Client, Processes, RESOURCES

from msg_conventions.diagnostics import Level
from msg_conventions.documents import hash_of, head_of
from msg_conventions.scenario_info import RequestSummary
from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.output.review.evaluation import evaluate_bag

pytestmark = pytest.mark.dds
LOADS = 10 if LONG else 2
NODES = ("log_player", "road_server", "segmenter", "planner", "gp_sampler", "recorder")
TINY = "image: tiny.pgm\nresolution: 0.5\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"


@pytest.fixture(scope="module")
def suite(tmp_path_factory, domain):
    """The whole chain, with sets long enough to be disturbed."""
    folder = tmp_path_factory.mktemp("maps")
    arguments: dict[str, list[str]] = {node: [] for node in NODES}
    arguments["log_player"] = ["-p", f"log_path:={RESOURCES / 'synthetic_c'}"]
    arguments["road_server"] = ["-p", "road_name:=straight", "-p", "wait_for_tracks:=true"]
    arguments["gp_sampler"] = ["-p", "count:=20", "-p", "seed:=7"]
    arguments["recorder"] = ["-p", f"bag:={folder / 'bag'}"]
    made = Processes(folder, domain, arguments)
    yield made
    made.kill()


def _maps(client: Client) -> list[str]:
    """Return the hash of the map that each entry and summary names."""
    return [info.inputs["map"] for info in client.infos()]


def _closed(client: Client, hashed: str) -> bool:
    return any(
        isinstance(info, RequestSummary) and info.inputs["map"] == hashed
        for info in client.infos()
    )


def _another_road(client: Client, width: float) -> str:
    """Load the straight road with lanes of another width; return its hash."""
    parameter = Parameter("road.lane_width", value=width).to_parameter_msg()
    request = SetParameters.Request(parameters=[parameter])
    assert client.call(SetParameters, "/road_server/set_parameters", request).results[0].successful
    return _loaded(client, "straight")


def _loaded(client: Client, url: str) -> str:
    """Load a map; return its hash."""
    before = len(client.wait("/map"))
    assert client.call(LoadMap, "/road_server/load_map", LoadMap.Request(map_url=url)).result == 0
    return hash_of("map", client.wait("/map", before + 1)[-1])


def _fitted(client: Client, hashed: str) -> dict[str, str]:
    """Return the hashes that the newest fit names, once it is one to this map."""

    def newest() -> dict[str, str]:
        return dict(head_of(client.wait("/fit/info")[-1], "fit/info").inputs)

    client.until(lambda: newest()["map"] == hashed, "a fit to this map")
    return newest()


def test_old_map_is_not_mixed_in(suite, client):
    client.hear("/scenarios/info", "/map", "/fit/info")
    heard_by = client.node.get_subscriptions_info_by_topic
    for topic in ("/map", "/road/lanes", "/tracks", "/fit/info", "/scenarios", "/scenarios/info"):
        client.until(
            lambda topic=topic: any(one.node_name == "recorder" for one in heard_by(topic)),
            f"the recorder on {topic}",
        )
    hashes = [hash_of("map", client.wait("/map")[0])]
    for k in range(LOADS):
        if (
            k % 3 == 0
        ):  # amid its publication; else while the planner or the sampler is at work, or before
            client.until(
                lambda: hashes[-1] in _maps(client),
                "a scenario on this map",
            )
        hashes.append(_another_road(client, 3.5 + 0.05 * (k + 1)))
    client.until(lambda: _closed(client, hashes[-1]), "the set on the last map")
    assert len(set(hashes)) == LOADS + 1
    order = list(map(hashes.index, _maps(client)))
    assert order == sorted(order), "a scenario on an older map came after one on a newer"
    assert len({info.inputs["tracks"] for info in client.infos()}) == 1
    _fitted(client, hashes[-1])


def test_refused_map_has_no_routes(suite, client, tmp_path):
    client.hear("/scenarios/info", "/map", "/diagnostics")
    client.until(
        lambda: client.infos() and isinstance(client.infos()[-1], RequestSummary), "the last set"
    )
    (tmp_path / "tiny.pgm").write_bytes(b"P5 20 20 255\n" + b"\xff" * 400)
    (tmp_path / "tiny.yaml").write_text(TINY)
    tiny = _loaded(client, str(tmp_path / "tiny.yaml"))

    def refused() -> bool:
        return any(
            s.name == "/planner: plan" and s.level is Level.ERROR for s in client.statuses()
        )

    client.until(refused, "the planner's refusal")
    reasons = []

    def is_told() -> bool:
        answer = client.generate()
        reasons.append(answer.reason)
        return not answer.successful and "fit/info of this map" in answer.reason

    client.until(is_told, f"a refusal that says why, of {reasons}")
    assert tiny not in _maps(client)


def test_bag_is_valid_on_each_map(suite):
    assert suite.end() == dict.fromkeys(NODES, 0)
    bag = suite.folder / "bag"
    (found,) = evaluate_bag(bag)
    assert found.causes == {} and unaccounted(found) == 0
    assert not any("off_road" in check for check in skipped(found))
    assert (
        len({hash_of("map", m.data) for m in read_messages(bag) if m.topic == "/map"}) == LOADS + 2
    )

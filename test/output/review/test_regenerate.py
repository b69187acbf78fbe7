# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Any published scenario again from its bag, bit for bit; a clear error where that cannot be."""

from dataclasses import replace

import pytest
from support import map_builders
from support.bag_examples import copied

from msg_conventions.diagnostics import decode_diagnostics, encode_diagnostics
from msg_conventions.scenario_info import ADAPTATION
from msg_conventions.scenarios import digest
from scenario_gen.bags.recordings.read import read_recording
from scenario_gen.bags.recordings.write import write_recording
from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.base.errors import InputError, ScenarioGenError
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.method.evaluation import EvaluationConfig
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.output.results import provenance_of
from scenario_gen.output.review.regenerate import regenerate_scenario, write_regenerated
from scenario_gen.output.review.validation import validate_bag
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.types import (
    NoteKind,
)
from scenario_gen.types.request import Request

LOG, ROAD, SEED = bundled("b"), "t_intersection", 7
REQUESTS = {
    "plain": Request(),
    "ego": Request(ego="1"),
    "moved": Request(goals="1: 24.0 8.07 3.14159 11", ego="2"),
}


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """One bag, a namespace for each request."""
    (encounter,) = read_log([LOG]).encounters
    config = PipelineConfig(
        evaluation=EvaluationConfig(resamples=10), sampling=SamplingConfig(variety="narrow")
    )
    runs = {}
    for name, request in REQUESTS.items():
        case = generate(encounter, ROAD, config, count=3, seed=SEED, request=request)
        runs[f"/{name}"] = replace(
            case, provenance=provenance_of([LOG], SEED, 3, [ROAD], config, request)
        )
    return write_recording(tmp_path_factory.mktemp("regenerate") / "bag", runs)


@pytest.fixture(scope="module")
def mirrored_bag(tmp_path_factory):
    """Of a template of right-hand traffic on a map of left-hand traffic."""
    folder = tmp_path_factory.mktemp("mirrored")
    road = folder / "crossroads.osm"
    image = {  # of the crossroads: left and right exchanged, borders too
        name: ([(x, -y) for x, y in right], [(x, -y) for x, y in left], after)
        for name, (left, right, after) in map_builders.lanes().items()
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(map_builders, "lanes", lambda: image)
        road.write_text(map_builders.lanelet2())
    log = bundled("a")
    (encounter,) = read_log([log]).encounters
    config = PipelineConfig(
        evaluation=EvaluationConfig(resamples=10), sampling=SamplingConfig(variety="narrow")
    )
    case = generate(encounter, str(road), config, count=2, seed=SEED)
    provenance = provenance_of([log], SEED, 2, [str(road)], config, Request())
    return write_recording(folder / "bag", {"/left": replace(case, provenance=provenance)}), log


def test_a_mirrored_template_says_so_and_comes_again_from_the_log(mirrored_bag):
    bag, log = mirrored_bag
    (summary,) = read_recording(bag).namespaces["/left"].summaries
    assert summary.values[f"{ADAPTATION}0"] == str(summary.result().adaptations[0])
    assert summary.result().adaptations[0].kind is NoteKind.MIRRORED
    data = published(bag, "/left")[0]
    assert regenerate_scenario(bag, 0).data == regenerate_scenario(bag, 0, log=log).data == data


def published(bag, namespace):
    return [
        message.data for message in read_messages(bag) if message.topic == f"{namespace}/scenarios"
    ]


@pytest.mark.parametrize("name", REQUESTS)
def test_bit_for_bit(bag, name):
    for index, data in enumerate(published(bag, f"/{name}")):
        made = regenerate_scenario(bag, index, namespace=f"/{name}")
        assert made.data == data
        assert made.sha256 == digest(data)


@pytest.mark.parametrize("name", REQUESTS)
def test_the_whole_chain_from_the_log(bag, name):
    made = regenerate_scenario(bag, 1, namespace=f"/{name}", log=LOG)
    assert made.data == published(bag, f"/{name}")[1]


@pytest.mark.parametrize("name", REQUESTS)
def test_a_bag_of_its_own(bag, name, tmp_path):
    folder = write_regenerated(regenerate_scenario(bag, 2, namespace=f"/{name}"), tmp_path / "one")
    (found,) = validate_bag(folder)
    assert (found.scenarios, found.invalid, found.left_out) == (1, 0, {})
    topics = {message.topic for message in read_messages(folder)}
    assert {
        f"/{name}/tracks",
        f"/{name}/map",
        f"/{name}/fit",
        f"/{name}/vehicle_1/route",
    } <= topics
    assert (f"/{name}/ego/witness" in topics) == (name != "plain")
    assert regenerate_scenario(folder, 2).data == published(bag, f"/{name}")[2], "again from there"


def test_what_is_ambiguous_or_missing_is_said(bag, tmp_path):
    with pytest.raises(
        InputError, match="3 scenarios have number 0; choose one: --namespace '/ego' --request 1; "
    ):
        regenerate_scenario(bag, 0)
    with pytest.raises(InputError, match="no scenario 77; it has: 0, 1, 2"):
        regenerate_scenario(bag, 77)
    with pytest.raises(InputError, match="has no fit, vehicle_2/route with"):
        bare = copied(
            bag,
            tmp_path / "bare",
            lambda m: None if m.topic.endswith(("/fit", "/vehicle_2/route")) else m.data,
        )
        regenerate_scenario(bare, 0, namespace="/plain")
    with pytest.raises(InputError, match="no scenario has an entry"):
        silent = copied(
            bag, tmp_path / "silent", lambda m: None if m.topic.endswith("/info") else m.data
        )
        regenerate_scenario(silent, 0)


def with_summary(change):
    """Change the values of each request's summary."""

    def changed(message):
        if not message.topic.endswith("/scenarios/info"):
            return message.data
        stamp, statuses = decode_diagnostics(message.data)
        return encode_diagnostics(
            [
                replace(s, values=change(dict(s.values))) if "published" in s.values else s
                for s in statuses
            ],
            stamp,
        )

    return changed


def test_other_parameters_or_versions_are_said(bag, tmp_path):
    other = with_summary(
        lambda values: values | {"sampling.lateral_sigma": "0.31", "numpy": "1.0"}
    )
    with pytest.raises(ScenarioGenError, match=r"scenario 1 differs: numpy was 1\.0"):
        regenerate_scenario(copied(bag, tmp_path / "other", other), 1, namespace="/plain")
    less = with_summary(
        lambda values: {
            name: text for name, text in values.items() if name != "sampling.time_sigma"
        }
    )
    with pytest.raises(InputError, match=r"parameter sampling\.time_sigma is missing"):
        regenerate_scenario(copied(bag, tmp_path / "less", less), 1, namespace="/plain")


def test_a_missing_or_changed_log_is_said(bag, tmp_path):
    with pytest.raises(InputError, match="does not exist; the bag is from synthetic_b"):
        regenerate_scenario(bag, 0, namespace="/plain", log=tmp_path / "none.csv")
    (tmp_path / "other.csv").write_text("t,x\n")
    with pytest.raises(InputError, match="it is another file, or was changed"):
        regenerate_scenario(bag, 0, namespace="/plain", log=tmp_path / "other.csv")


def test_what_the_library_saved_is_made_again(tmp_path):
    """`generate` keeps with its result what makes it again."""
    (encounter,) = read_log(LOG).encounters
    made = generate(encounter, ROAD, count=2, seed=4, request=Request(order="free"))
    bag = made.save(tmp_path / "bag")
    for scenario in made:
        assert regenerate_scenario(bag, scenario.index).sha256

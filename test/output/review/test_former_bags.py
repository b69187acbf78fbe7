# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Bags as versions before 0.2 wrote them are evaluated, validated and made again: no hashes, and the parameters' former names."""

from dataclasses import replace

import pytest
from typer.testing import CliRunner

from msg_conventions.diagnostics import decode_diagnostics, encode_diagnostics
from scenario_gen.bags.recordings.read import read_recording
from scenario_gen.bags.recordings.write import add_message, write_recording
from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.bags.storage.writer import atomic_bag
from scenario_gen.base.parameters import flatten, former_name
from scenario_gen.cli.commands import app
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.method.evaluation import EvaluationConfig
from scenario_gen.output.results import provenance_of
from scenario_gen.output.review.evaluation import bag_results
from scenario_gen.output.review.regenerate import regenerate_scenario
from scenario_gen.output.review.validation import validate_bag
from scenario_gen.pipeline import generate, PipelineConfig

SINCE = ("road/info", "fit/info")  # topics that came with 0.2
LOG, ROAD, SEED = bundled("c"), "straight", 7


@pytest.fixture(scope="module")
def former(tmp_path_factory):
    """The bag of a run, rewritten as version 0.1 wrote it; the names of the parameters that were other ones."""
    folder = tmp_path_factory.mktemp("former")
    (encounter,) = read_log([LOG]).encounters
    config = PipelineConfig(evaluation=EvaluationConfig(resamples=10))
    result = generate(encounter, ROAD, config, count=3, seed=SEED)
    result = replace(result, provenance=provenance_of([LOG], SEED, 3, [ROAD], config))
    names = {name: former_name(name, entry) for name, (entry, _) in flatten(config).items()}
    names |= {"refused.speed_profile": "refused.time_law", "refused.stop_not_kept": "refused.moving_wait"}

    def rewritten(data):
        stamp, statuses = decode_diagnostics(data)
        said = [{names.get(key, key): value for key, value in status.values.items() if "_hash" not in key} for status in statuses]
        return encode_diagnostics([replace(s, values=values) for s, values in zip(statuses, said, strict=True)], stamp)

    with atomic_bag(folder / "former") as bag:
        for message in read_messages(write_recording(folder / "now", result)):
            topic = message.topic.lstrip("/")
            if topic not in SINCE:
                data = rewritten(message.data) if topic in ("scenarios/info", "diagnostics") else message.data
                add_message(bag, message.topic, data, message.stamp_ns)
    return folder / "former", {name for name, other in names.items() if name != other}


def test_the_rewritten_bag_says_nothing_in_the_words_of_now(former):
    bag, renamed = former
    namespace = read_recording(bag).namespaces[""]
    assert all(entry.map_hash is None and entry.template_hash is None for entry in namespace.entries)
    assert renamed and not renamed & set(namespace.summaries[-1].values)
    assert not {"road/info", "fit/info"} & {message.topic.lstrip("/") for message in read_messages(bag)}


def test_it_is_validated_and_evaluated(former):
    (found,) = validate_bag(former[0])
    assert (found.scenarios, found.invalid, found.unaccounted, found.left_out) == (3, 0, 0, {})
    (result,) = bag_results(former[0], EvaluationConfig(resamples=10))
    assert result.valid == 3 and result.fit is not None and result.road.name == ROAD


@pytest.mark.parametrize("log", [None, LOG], ids=["from the bag", "from the log"])
def test_its_scenarios_are_made_again(former, log):
    entries = read_recording(former[0]).namespaces[""].entries
    assert regenerate_scenario(former[0], entries[1].index, log=log).sha256 == entries[1].sha256


def test_the_commands_take_it(former, tmp_path):
    for command in (["validate"], ["evaluate", "--out", str(tmp_path / "out")]):
        answer = CliRunner().invoke(app, [command[0], str(former[0]), *command[1:]])
        assert answer.exit_code == 0, answer.output

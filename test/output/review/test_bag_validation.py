# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Every scenario of a bag is checked anew, against what the bag itself says of its request."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from support.bag_examples import copied, skipped, unaccounted
from support.given import answer, Given
from typer.testing import CliRunner

from msg_conventions.scenarios import digest, encode_scenario
from scenario_gen.bags.recordings.read import read_recording
from scenario_gen.bags.recordings.write import write_recording
from scenario_gen.bags.storage.bag import read_messages
from scenario_gen.base.errors import InputError
from scenario_gen.cli.commands import app
from scenario_gen.closed_loop.trials import read_trials
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.method.segmentation import segment
from scenario_gen.method.validity import Limits
from scenario_gen.output.review.evaluation import evaluate_bag
from scenario_gen.pipeline import generate, PipelineConfig
from scenario_gen.roads import build_road
from scenario_gen.types.request import Request
from scenario_gen.types.scenario import BoundaryStates, Cause

QUICK = {"evaluation.resamples": 10}


@pytest.fixture(scope="module")
def run():
    """A real run: the synthetic merging case on a straight road."""
    (encounter,) = read_log([bundled("c")]).encounters
    road = build_road("straight", encounter)
    return answer(Given(encounter, segment(encounter, seed=7), road, 7), Request(), count=4)


def counts(found):
    """The number of scenarios, and of invalid ones."""
    return len(found.verdicts), len(found.verdicts) - found.valid


def rewritten(bag, target, change=lambda _, data: data, without=()):
    """Copy a bag without some topics; `change(k, bytes)` gives the bytes of scenario k."""
    index = count()

    def changed(message):
        if message.topic.rpartition("/")[2] in without:
            return None
        return (
            change(next(index), message.data)
            if message.topic.endswith("/scenarios")
            else message.data
        )

    return copied(bag, target, changed)


def test_each_fault_has_cause_and_place(run, tmp_path):
    good = run.generated.scenarios
    moved = [s.position.copy() for s in good]
    moved[1][:] += (0.0, 400.0)  # far off the road, and off what was asked
    moved[2][1] = moved[2][0]  # one on top of the other
    bad = [
        replace(scenario, position=position)
        for scenario, position in zip(good, moved, strict=True)
    ]
    elsewhere = replace(good[3], frame_id="elsewhere")
    stamp = run.encounter.start_ns
    messages = [encode_scenario(s, stamp) for s in (*bad[:3], elsewhere)]
    bag = rewritten(
        write_recording(tmp_path / "run", {"/here": run}),
        tmp_path / "bad",
        lambda k, _: messages[k],
    )
    (found,) = evaluate_bag(bag)
    assert counts(found) == (4, 3)
    assert min(found.causes["off_road"]) == 1
    assert len(found.causes["boundary_state"]) == 2
    assert min(found.causes["overlap"]) == 2
    assert min(found.causes[Cause.UNUSABLE]) == 3
    assert "elsewhere" in next(iter(found.causes[Cause.UNUSABLE].values()))


def test_reactions_are_proven_again(tmp_path):
    """The bundled case b has a yielder; hold it to more than it was held to."""
    (encounter,) = read_log([bundled("b")]).encounters
    made = generate(encounter, "t_intersection", QUICK, count=4, seed=7)
    assert [str(edge.named("12")) for edge in made.generated.reactions] == ["2 yields to 1"]
    bag = write_recording(tmp_path / "b", {"/here": made})
    (kept,) = evaluate_bag(bag)
    (edge,) = made.generated.reactions
    assert kept.causes == {} and kept.valid == 4
    measured = kept.result
    assert measured.published == 4 and measured.generated.reactions == (edge,)
    assert measured.reacting["edges"] == [edge.document(made.encounter.vehicles) | {"kept": True}]
    strict = Limits(gap_share=0.1, anticipation=0.0, patience=0.0)
    (found,) = evaluate_bag(bag, PipelineConfig(limits=strict))
    assert set(found.causes) == {"reaction"}
    assert found.result.generated.refused["reaction"] == len(found.causes["reaction"])
    (summary,) = read_recording(bag).namespaces["/here"].summaries
    assert summary.reactions == tuple(made.reacting["edges"])
    assert "has cleared; " in next(iter(found.causes["reaction"].values()))


def test_missing_topics_are_named(run, tmp_path):
    silent = ("tracks", "map", "fit", "info")  # scenarios/info knows what was asked, too
    bag = rewritten(
        write_recording(tmp_path / "run", {"/here": run}), tmp_path / "bare", without=silent
    )
    (found,) = evaluate_bag(bag)
    assert found.causes == {}
    assert sorted(sentence.partition(":")[0] for sentence in skipped(found)) == [
        "boundary_state",
        "off_road",
        "passing_order",
        "sha256",
        "stop_not_kept",
    ]
    assert set(skipped(found).values()) == {4}


def test_scenario_is_held_against_its_states(run, tmp_path):
    """A request with states of its own does not change `fit`: its `scenarios/info` says what they were."""
    fit = replace(
        run.fit,
        requested=BoundaryStates(
            run.fit.requested.start + np.array((0.0, 5.0, 0.0, 0.0)), run.fit.requested.end
        ),
    )
    (found,) = evaluate_bag(write_recording(tmp_path / "other", replace(run, fit=fit)))
    assert len(found.causes["boundary_state"]) == 4
    without_fit = rewritten(tmp_path / "other", tmp_path / "info", without=("fit",))
    assert len(evaluate_bag(without_fit)[0].causes["boundary_state"]) == 4
    own = rewritten(
        write_recording(tmp_path / "run", {"/here": run}), tmp_path / "own", without=("fit",)
    )
    assert evaluate_bag(own)[0].causes == {} and skipped(evaluate_bag(own)[0]) == {}


def test_altered_scenarios_are_named(run, tmp_path):
    """A scenario moved by a nanometre is still valid by itself; only its account knows better."""
    bag = write_recording(tmp_path / "run", {"/here": run})
    other = replace(
        run.generated.scenarios[2], position=run.generated.scenarios[2].position + 1e-9
    )
    changed = rewritten(
        bag,
        tmp_path / "changed",
        lambda k, data: encode_scenario(other, run.encounter.start_ns) if k == 2 else data,
    )
    (found,) = evaluate_bag(changed)
    assert counts(found) == (4, 1)
    assert list(found.causes) == [Cause.ALTERED]
    assert (len(found.causes[Cause.ALTERED]), min(found.causes[Cause.ALTERED])) == (1, 2)
    index = run.generated.scenarios[2].index
    assert (
        f"message 2 has SHA-256 {digest(encode_scenario(other, run.encounter.start_ns))[:12]}"
        in next(iter(found.causes[Cause.ALTERED].values()))
    )
    assert f"scenario {index} of request 1 was published as" in next(
        iter(found.causes[Cause.ALTERED].values())
    )
    answer = CliRunner().invoke(app, ["evaluate", str(changed)])
    assert answer.exit_code == 1 and Cause.ALTERED in answer.output


def test_lost_entry_leaves_scenario_unaccounted(run, tmp_path):
    """The last chunk of a recording is lost, and with it what `scenarios/info` said last."""
    bag = write_recording(tmp_path / "run", {"/here": run})
    infos = [m.data for m in read_messages(bag) if m.topic.endswith("/scenarios/info")]
    cut = without_infos(bag, tmp_path / "cut", infos[-3:])
    (found,) = evaluate_bag(cut)
    assert (*counts(found), unaccounted(found)) == (4, 0, 2)
    answer = CliRunner().invoke(app, ["evaluate", str(cut)])
    assert answer.exit_code == 0 and "2 of 4 scenarios are unaccounted" in answer.output
    case = evaluate_bag(cut)[0].result
    assert any(
        "2 of 4 scenarios are unaccounted" in str(note) for note in case.generated.adaptations
    )


def without_infos(bag, target, infos):
    """Copy a bag without these messages of `scenarios/info`."""
    return copied(
        bag,
        target,
        lambda m: None if m.topic.endswith("/scenarios/info") and m.data in infos else m.data,
    )


def test_ego_is_checked_with_its_witness(run, tmp_path):
    """The witness is a part of what is proven: one that hits another is found, one that is lost or altered is said."""
    given = Given(run.encounter, run.segmentation, run.road, 4, sampling=SamplingConfig())
    slot = answer(given, Request(ego="2"), count=3)
    whole = evaluate_bag(write_recording(tmp_path / "whole", slot))[0]
    assert (len(whole.verdicts), whole.causes, skipped(whole)) == (3, {}, {})

    def bag_with(name, change):
        return copied(
            tmp_path / "whole",
            tmp_path / name,
            lambda m: change(m.data) if m.topic == "/ego/witness" else m.data,
        )

    (lost,) = evaluate_bag(bag_with("lost", lambda _: None))
    assert lost.causes == {}
    assert skipped(lost)["the ego: its reference drive is not on ego/witness"] == 3
    (altered,) = evaluate_bag(bag_with("altered", lambda data: data[:-8] + bytes(8)))
    assert len(altered.causes[Cause.ALTERED]) == 3
    with pytest.raises(InputError, match="whose reference drive is not in the bag"):
        read_trials(tmp_path / "lost")
    hitting = tuple(
        replace(one, reference_drive=on_top_of(one)) for one in slot.generated.scenarios
    )
    (hit,) = evaluate_bag(
        write_recording(
            tmp_path / "hit", replace(slot, generated=replace(slot.generated, scenarios=hitting))
        )
    )
    assert len(hit.causes["overlap"]) == 3


def on_top_of(scenario):
    """The scenario's witness where its first vehicle is."""
    arrays = {
        name: getattr(scenario, name)[:1]
        for name in ("position", "heading", "speed", "acceleration", "present")
    }
    return replace(scenario.reference_drive, time=scenario.time, **arrays)

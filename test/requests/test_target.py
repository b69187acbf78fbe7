# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Targets, their proposals and weights, the order asked, and the choice that covers."""

from dataclasses import replace

import numpy as np
import pytest
from support.given import answer
from support.lengths import LONG
from support.small_scenarios import moving

from scenario_gen.bags.recordings.write import write_recording
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.evaluation.measures import figures_of, measure, most_critical
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.method.sampling.sampler import TargetError
from scenario_gen.output.results import provenance_of
from scenario_gen.output.review.evaluation import evaluate_bag
from scenario_gen.pipeline import generate
from scenario_gen.types import Facts, join_ego, OrderChange, Vehicle
from scenario_gen.types.request import Request
from scenario_gen.types.target import read_targets

LOW, HIGH = 0.4, 0.9  # s of PET, of which few natural candidates of the case are


@pytest.fixture(scope="module")
def directed(chain):
    return answer(chain, Request(target=f"pet={LOW}..{HIGH}"), count=20).generated


def test_texts_are_read_and_written():
    one, two = read_targets("pet=0.5..1.5; ttc[a b,2]=..2")
    assert (one.name, one.low, one.high, one.vehicles) == ("pet", 0.5, 1.5, ())
    assert (
        two.vehicles == ("a b", "2")
        and two.low == -np.inf
        and not two.holds(np.nan)
        and two.holds(2.0)
    )
    assert read_targets(f"{one}; {two}") == (one, two)
    assert read_targets("ttc[a b,2] < 2 ;pet>=.5") == (two, replace(one, high=np.inf))


def test_scenarios_reach_range_with_weights(directed):
    assert len(directed.scenarios) == 20
    for scenario in directed.scenarios:
        assert LOW <= measure(scenario, "pet") <= HIGH
        assert scenario.facts.targets["pet"] == pytest.approx(measure(scenario, "pet"), rel=1e-5)
        assert 0.0 < scenario.facts.weight <= 10.0
    assert (
        directed.reached.directed
        and directed.reached.low <= directed.reached.share <= directed.reached.high
    )


def test_weighted_share_agrees_with_natural(chain, directed):
    """Against natural candidates: the interval of one overlaps that of the other."""
    natural = answer(chain, Request(), count=1200 if LONG else 400).generated
    hits = [LOW <= measure(scenario, "pet") <= HIGH for scenario in natural.scenarios]
    share = sum(hits) / natural.candidates
    half = 1.96 * np.sqrt(share * (1.0 - share) / natural.candidates)
    assert directed.reached.low <= share + half and share - half <= directed.reached.high


def test_unreachable_range_is_refused(chain):
    with pytest.raises(TargetError, match=r"pet=90\.\.91.*reachable: pet from"):
        answer(chain, Request(target="pet=90..91"), count=3)


@pytest.mark.parametrize(
    "request_", [Request(target=f"pet={LOW}..{HIGH}", ego="1"), Request(order="free")], ids=str
)
def test_each_in_a_bag_is_valid(chain, request_, tmp_path):
    config = PipelineConfig()
    config = replace(config, evaluation=replace(config.evaluation, resamples=10))
    made = generate(chain.encounter, chain.road, config, count=3, seed=7, request=request_)
    made = replace(made, provenance=provenance_of([], 7, 3, ["t_intersection"], config, request_))
    bag = write_recording(tmp_path / "bag", made)
    (found,) = evaluate_bag(bag)
    assert len(found.verdicts) == 3 == found.valid
    if request_.target:
        assert all(
            LOW <= measure(join_ego(one), "pet") <= HIGH for one in made.generated.scenarios
        )


def test_another_order_is_named(chain, tmp_path):
    chain = replace(
        chain, sampling=SamplingConfig()
    )  # with one clock for all nobody passes anybody
    made = answer(chain, Request(order="swap"), count=3)
    for scenario in made.generated.scenarios:
        assert OrderChange.SWAPPED in {order.change for order in scenario.facts.passing_order}
        assert (
            most_critical(figures_of(scenario)).first
            != most_critical(figures_of(chain.encounter)).first
        )
    bag = write_recording(tmp_path / "bag", replace(made, provenance={}))
    (found,) = evaluate_bag(bag)
    assert found.valid == 3
    kept = replace(
        made.generated,
        scenarios=tuple(replace(one, facts=Facts()) for one in made.generated.scenarios),
    )
    (found,) = evaluate_bag(write_recording(tmp_path / "kept", replace(made, generated=kept)))
    assert "passing_order" in found.causes and found.valid == 0, (
        "and signs, which a swapped order does not keep"
    )


def test_measures_of_a_plain_crossing():
    """Two cars of 4 × 2 m at 10 m/s on crossing axes; the second one's centre is 20 m later at the crossing."""
    rows = [[-40.0, 0.0, 0.0, 10.0, 0.0, 0.0], [0.0, -60.0, 0.5 * np.pi, 10.0, 0.0, 0.0]]
    vehicles = [Vehicle("a", 4.0, 2.0), Vehicle("b", 4.0, 2.0)]
    crossing = moving(rows, vehicles=vehicles, count=101)
    (one,) = figures_of(crossing)
    assert one.first == 0
    assert one.arrival_gap == pytest.approx(2.0, abs=0.02)
    assert one.pet == pytest.approx(2.0 - 0.6, abs=0.02)  # the first is inside for 2 m + 4 m
    assert measure(crossing, "arrival_gap", (1, 0)) == pytest.approx(-2.0, abs=0.02)
    assert one.ttc == np.inf

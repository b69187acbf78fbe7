# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One joint model: roots are as free as before, the others answer, up to a residual, in the numbers and in what is published."""

from dataclasses import replace

import numpy as np
import pytest
from support.reaction_scenes import answering, crossing, lane_encounter, wander
from support.textbook_motions import labelled

from benchmarks._interaction_measures import following, yielding
from scenario_gen.method.chain import Chain
from scenario_gen.method.evaluation.measures import figures_of
from scenario_gen.method.sampling import Plan, SamplingConfig
from scenario_gen.method.sampling.build_model import build_model, kept_reactions
from scenario_gen.method.sampling.reaction_transform import MotionContext, ReactionTransform
from scenario_gen.method.sampling.vehicle_model import NoiseScale
from scenario_gen.method.segmentation import segment
from scenario_gen.pipeline import PipelineConfig
from scenario_gen.roads import build_road
from scenario_gen.situation import Situation
from scenario_gen.types import FOLLOW

LANE = lane_encounter(LEADER := wander(np.random.default_rng(3), 200), answering(LEADER, 1.2, 0.9))
CROSSING = crossing(8.0)
LITTLE = SamplingConfig(
    arrival_sigma=1.5,
    pace_sigma=0.06,
    wait_sigma=1.0,
    end_speed_sigma=0.4,
    gap_sigma=0.0,
    headway_sigma=0.0,
    strength_sigma=0.0,
    leave_out=0.0,
    longitudinal_sigma=1.2,
    time_sigma=1.0,
    duration_tolerance=0.1,
)
CONFIG = PipelineConfig(sampling=LITTLE)
FREE = PipelineConfig(sampling=replace(LITTLE, reactions="none"))


@pytest.fixture(scope="module", params=["lane", "crossing"])
def case(request):
    encounter = {"lane": LANE, "crossing": CROSSING}[request.param]
    road = build_road("corridor", encounter, CONFIG.road)
    segmentation = segment(encounter, CONFIG.segmentation, 1)

    def made(config=CONFIG, count=40):
        return Chain(
            Situation.of(encounter), segmentation, road, config, count=count, seed=1
        ).run()

    return encounter, made, made(), made(FREE)


def model_of(encounter, result):
    waits = Situation.of(encounter).waits_to_keep(result.segmentation)
    plan = Plan(
        Situation.of(encounter),
        result.segmentation,
        result.road,
        result.routes,
        result.fit.requested,
        waits,
    )
    return build_model(plan, CONFIG.sampling).model


def test_transform_gives_the_stated_residual(case):
    encounter, _, made, _ = case
    model = model_of(encounter, made)
    (edge,) = kept_reactions(Situation.of(encounter), CONFIG.sampling).edges
    transform = ReactionTransform.of(
        model.vehicles, model.numbers, model.warp.nominal, model.reactions, NoiseScale()
    )
    eps = np.random.default_rng(0).standard_normal((20_000, model.size))
    z = transform.apply(eps)
    parts = model.numbers.vehicles
    assert np.array_equal(z[:, parts[edge.whom]], eps[:, parts[edge.whom]])
    assert np.array_equal(z[:, model.numbers.clock], eps[:, model.numbers.clock])
    assert np.allclose(z.mean(axis=0), 0.0, atol=0.06)
    who, whom = edge.who, edge.whom
    context = MotionContext(model.vehicles, model.warp.nominal, NoiseScale())
    own, other = z[:, parts[edge.who]], z[:, parts[edge.whom]].copy()
    part = model.vehicles[whom].numbers.clock
    other[:, part] = model.vehicles[whom].variation.clock.effective(
        other[:, part], 1.0
    )  # nobody reacts to the rest
    if edge.kind == FOLLOW:
        at = np.linspace(edge.since + 4.0, edge.until - 4.0, 7)
        late = own @ context.lateness(who, at).T
        late -= other @ context.lateness(whom, at - edge.lag).T
        ahead = own @ context.advance(who, at).T - other @ context.advance(whom, at - edge.lag).T
        assert late.std() < edge.residual / 8.0
        assert 0.0 < ahead.std() < 1.1 * edge.residual
    else:
        leaves = own @ context.lateness(who, np.array([edge.until])).T
        free = other @ context.lateness(whom, np.array([edge.clears])).T
        free -= other @ context.advance(whom, np.array([edge.clears])).T / 8.0
        assert (leaves - free).std() == pytest.approx(0.6, abs=0.15)
        assert free.std() > 1.2


def test_mixing_is_linear(case):
    encounter, _, made, _ = case
    model = model_of(encounter, made)
    transform = ReactionTransform.of(
        model.vehicles,
        model.numbers,
        model.warp.nominal,
        model.reactions,
        NoiseScale(vehicle_clock=0.25),
    )
    eps = np.random.default_rng(0).standard_normal((4, model.size))
    np.testing.assert_allclose(transform.apply(-eps), -transform.apply(eps), atol=1e-12)
    np.testing.assert_allclose(
        transform.apply(eps)[1:2], transform.apply(eps[1:2]), atol=1e-12
    )  # alone as among others


def test_published_reactions_answer(case):
    encounter, _, made, free = case
    (edge,) = made.generated.reactions
    named = "2 follows 1" if edge.kind == FOLLOW else "2 yields to 1"
    assert {
        "; ".join(map(str, scenario.facts.reactions)) for scenario in made.generated.scenarios
    } == {named}
    assert free.generated.reactions == () and not free.generated.scenarios[0].facts.reactions
    assert len(made.generated.scenarios) == 40
    for scenario in made.generated.scenarios[:3]:
        (figures,) = figures_of(scenario)
        assert scenario.facts.closest_approach_m == pytest.approx(figures.gap, abs=5e-4)
        assert (scenario.facts.pet_s or np.nan) == pytest.approx(
            figures.pet, abs=5e-4, nan_ok=True
        )
    if edge.kind == FOLLOW:
        seen, before = (
            following(edge, encounter, one.generated.scenarios) for one in (made, free)
        )
        assert seen.slope > 0.75 > before.slope
        assert seen.gaps[0] > 0.65 and seen.gaps[1] < 1.35 < before.gaps[1]
        assert seen.lag == pytest.approx(edge.lag, abs=0.5)
        assert seen.own > 0.05  # copying is no reaction
    else:
        seen, before = (yielding(edge, one.generated.scenarios) for one in (made, free))
        assert seen.early == 0.0
        assert 0.3 < seen.spread < 0.8 * before.spread


def test_yielder_is_slow_at_passing():
    encounter = labelled("meets another one closely", 3).encounter
    (edge,) = Situation.of(encounter).reactions.edges
    road = build_road("corridor", encounter, CONFIG.road)
    segmentation = segment(encounter, CONFIG.segmentation, 1)
    lost = []
    for config in (CONFIG, FREE):
        scenarios = (
            Chain(Situation.of(encounter), segmentation, road, config, count=30, seed=1)
            .run()
            .generated.scenarios
        )
        passed = [
            int(np.argmin(np.hypot(*(one.position[0] - one.position[1]).T))) for one in scenarios
        ]
        lost.append(
            [
                one.speed[edge.who].max() - one.speed[edge.who, k]
                for one, k in zip(scenarios, passed, strict=True)
            ]
        )
    assert np.std(lost[0]) < 0.6 * np.std(lost[1])
    assert min(lost[0]) > 4.0 > min(lost[1])


def test_other_orders_wait_for_nobody():
    assert kept_reactions(Situation.of(CROSSING), CONFIG.sampling).edges
    assert kept_reactions(Situation.of(CROSSING), CONFIG.sampling, "free").edges == ()
    assert kept_reactions(Situation.of(CROSSING), CONFIG.sampling, "swap").edges == ()
    assert kept_reactions(Situation.of(LANE), CONFIG.sampling, "free").edges
    assert kept_reactions(Situation.of(LANE), SamplingConfig(reactions="none")).edges == ()

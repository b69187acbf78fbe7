# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Drivers differ: other gaps and headways within what the certificate allows."""

from dataclasses import replace

import numpy as np
import pytest
from support.reaction_scenes import answering, crossing, lane_encounter, wander

from scenario_gen.method.chain import Chain
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.method.sampling.driver_gaps import DriverGap, Ramp
from scenario_gen.method.segmentation import segment
from scenario_gen.method.validity import allowed_gap
from scenario_gen.numerics.rounding import ROUNDING_M
from scenario_gen.pipeline import PipelineConfig
from scenario_gen.roads import build_road
from scenario_gen.situation import conflict_of, lane_gaps, passing, Situation, time_gaps

LEADER = wander(np.random.default_rng(3), 200)
LANE = lane_encounter(LEADER, answering(LEADER, 1.2, 0.9))
CROSSING = crossing(8.0)
COUNT = 60


def chain(encounter, **parameters):
    config = replace(PipelineConfig(), sampling=SamplingConfig(**parameters))
    segmentation = segment(encounter, config.segmentation, 1)
    road = build_road("corridor", encounter, config.road)
    return Chain(Situation.of(encounter), segmentation, road, config, count=COUNT, seed=1)


def gaps_behind(result, edge):
    """Seconds from the first vehicle's clearing to the second one's entry, in each scenario."""
    gaps = []
    for scenario in result:
        conflict = conflict_of(scenario, edge.who, edge.whom)
        assert conflict.second == edge.who
        clears, enters = passing(scenario, conflict, merges=edge.merges)
        gaps.append(enters - clears)
    return np.array(gaps)


def test_half_of_drivers_are_nearer():
    z = np.random.default_rng(0).standard_normal(20_000)
    nobody = np.zeros(2)
    free = DriverGap(nobody, nobody, 1.0, 0.0, -4.0, 4.0).delay(z)
    assert (np.median(free), free.std()) == (
        pytest.approx(0.0, abs=0.02),
        pytest.approx(1.0, 0.02),
    )
    bounded = DriverGap(nobody, nobody, 1.0, 0.0, -0.5, 2.0).delay(z)
    assert -0.5 - ROUNDING_M <= bounded.min() < -0.49
    assert 1.9 < bounded.max() <= 2.0 + ROUNDING_M
    assert np.median(bounded) == pytest.approx(0.0, abs=0.02)
    follower = DriverGap(nobody, nobody, 0.3, 2.0, -1.0, 1.0).delay(z)
    assert follower.min() >= 2.0 * np.expm1(-0.3) - ROUNDING_M
    assert follower.max() <= 2.0 * np.expm1(0.3) + ROUNDING_M
    assert DriverGap(nobody, nobody, 1.0, 0.0, 0.0, 0.0).delay(z) == pytest.approx(0.0)


def test_drivers_accept_other_gaps():
    (edge,) = Situation.of(CROSSING).reactions.edges
    recorded = gaps_behind(chain(CROSSING, gap_sigma=0.0).run(), edge)
    other = chain(CROSSING)
    gaps = gaps_behind(other.run(), edge)
    assert gaps.std() > 1.2 * recorded.std()
    assert np.median(gaps) == pytest.approx(np.median(recorded), abs=0.4)
    least, most = allowed_gap(edge, other.config.limits)
    assert least - 0.15 <= gaps.min() and gaps.max() <= most + 0.05


@pytest.mark.parametrize("sigma", [0.05, 0.1])
def test_untruncated_sigma_is_what_is_drawn(sigma):
    z = np.random.default_rng(0).standard_normal(20_000)
    ramp = Ramp(np.linspace(0.0, 10.0, 11), np.ones(11), np.zeros(11))
    ((headway,), (gap,)) = (Situation.of(each).reactions.edges for each in (LANE, CROSSING))
    limits = PipelineConfig().limits
    config = SamplingConfig(headway_sigma=sigma, gap_sigma=sigma)
    follower = ramp.gap_of(headway, [], config, limits)
    farther = np.log1p(follower.delay(z) / follower.headway)
    assert farther.std() == pytest.approx(sigma, rel=0.05)
    assert ramp.gap_of(gap, [], config, limits).delay(z).std() == pytest.approx(sigma, rel=0.05)


def test_yielder_without_approach_has_gap():
    """It is in the conflict area when the scenario begins."""
    ramp = Ramp(np.linspace(0.0, 10.0, 11), np.ones(11), np.zeros(11))
    (edge,) = Situation.of(CROSSING).reactions.edges
    edge = replace(edge, stands=False, since=0.0, until=0.0, lag=0.0, gap=0.0)
    gap = ramp.gap_of(edge, [], SamplingConfig(gap_sigma=0.5), PipelineConfig().limits)
    assert gap.basis.tolist() == [1.0] * 11 and gap.rate.tolist() == [0.0] * 11
    assert np.isfinite(gap.delay(np.linspace(-3.0, 3.0, 7))).all()


def test_one_driver_keeps_one_headway():
    (edge,) = Situation.of(LANE).reactions.edges
    planned = chain(LANE, drivers=0.0)
    headways = [
        np.median(time_gaps(lane_gaps(each), edge.who, edge.whom)) for each in planned.run()
    ]
    assert np.std(np.log(headways)) < 0.05, "what is left is the residual of one driver"


def test_other_drivers_keep_other_headways():
    (edge,) = Situation.of(LANE).reactions.edges

    def headways(**parameters):
        result = chain(LANE, **parameters).run()
        return np.array(
            [np.median(time_gaps(lane_gaps(each), edge.who, edge.whom)) for each in result]
        )

    recorded, other = headways(headway_sigma=0.0), headways()
    assert other.std() > 1.5 * recorded.std()
    assert np.median(other) == pytest.approx(np.median(recorded), rel=0.15)

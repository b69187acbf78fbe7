# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Long work ends where it stands when nobody waits for it any more, and is the same when somebody does."""

import pytest

from scenario_gen.base.cancelling import cancellable, CancelledError, stop_if_cancelled
from scenario_gen.logs import read_log
from scenario_gen.method.chain import Chain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.fitting import fit_template
from scenario_gen.method.routing import plan_routes
from scenario_gen.method.segmentation import segment
from scenario_gen.roads import build_road
from scenario_gen.situation import Situation

CASE = "scenario_gen/resources/synthetic_c"


def test_every_stage_can_be_cancelled(request):
    def read():  # anew: what is derived of an encounter is derived once
        return read_log(request.config.rootpath / CASE).encounters[0]

    encounter = read()
    segmentation, road = segment(encounter), build_road("straight", encounter)
    fit = fit_template(encounter, segmentation, road)
    for work in (
        lambda: segment(encounter),
        lambda fresh=read(): build_road("straight", fresh),
        lambda fresh=read(): fit_template(fresh, segmentation, road),
        lambda: plan_routes(road, fit),
        lambda: Chain(Situation.of(encounter), segmentation, road, PipelineConfig()).run(),
    ):
        with cancellable(lambda: True), pytest.raises(CancelledError):
            work()
    stop_if_cancelled()  # outside, nothing is

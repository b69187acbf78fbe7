# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A segmented template on a road, and what comes of a request for it."""

from dataclasses import dataclass, field

from scenario_gen.method.chain import Chain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.fitting import FittingConfig
from scenario_gen.method.routing import PlanningConfig
from scenario_gen.method.sampling import Callbacks, SamplingConfig
from scenario_gen.method.validity import Limits
from scenario_gen.situation import Situation
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.fit import Segmentation
from scenario_gen.types.road import Road


@dataclass(frozen=True, eq=False)
class Given:
    encounter: Encounter
    segmentation: Segmentation
    road: Road
    seed: int
    fitting: FittingConfig = field(default_factory=FittingConfig)
    planning: PlanningConfig = field(default_factory=PlanningConfig)
    sampling: SamplingConfig = field(
        default_factory=lambda: SamplingConfig(drivers=0.0)
    )  # all states are as given
    limits: Limits = field(default_factory=Limits)

    @property
    def config(self):
        return PipelineConfig(
            fitting=self.fitting,
            planning=self.planning,
            sampling=self.sampling,
            limits=self.limits,
        )


def answer(given, request, *, count, cancelled=lambda: False):
    """Return what comes of a request."""
    asked = Chain(
        Situation.of(given.encounter),
        given.segmentation,
        given.road,
        given.config,
        request,
        count,
        given.seed,
    )
    return asked.run(Callbacks(cancelled=cancelled))

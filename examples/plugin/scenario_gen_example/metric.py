# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A metric: how fast vehicles are."""

from collections.abc import Mapping

import numpy as np

from scenario_gen.method.evaluation import MetricGroup, Samples, Template
from scenario_gen.types import Interval, Metric


def of_samples(samples: Samples) -> Mapping[str, Interval]:
    """Return the mean over samples, with its interval."""
    return {
        "mean_speed": samples.bootstrap.mean(
            np.array([motion.speed.mean() for motion in samples.motions])
        )
    }


def of_template(template: Template) -> Mapping[str, float]:
    """Return the value of the recorded template."""
    return {"mean_speed": float(template.motion.speed.mean())}


SPEED = MetricGroup(
    (Metric("mean_speed", "mean speed", "m/s", "", "Speed", "of all vehicles"),),
    of_samples,
    of_template,
)

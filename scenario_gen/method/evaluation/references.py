# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Uninformed changepoints: the baselines of the segmenter at the same K.

More changepoints always fit better, so the segmenter must fit better than evenly spaced ones.
"""

from dataclasses import replace

import numpy as np

from scenario_gen.numerics import Ints
from scenario_gen.types import Segmentation


def with_changepoints_at(
    segmentation: Segmentation, changepoints: Ints, label: str
) -> Segmentation:
    """Return a segmentation with changepoints (K,); each segment is its own primitive."""
    labels = np.zeros(len(segmentation.labels), dtype=np.int64)
    labels[changepoints] = 1
    names = tuple(f"{label} {k + 1}" for k in range(len(changepoints) + 1))
    return replace(
        segmentation, labels=np.cumsum(labels), changepoints=changepoints, descriptions=names
    )


def without_changepoints(segmentation: Segmentation) -> Segmentation:
    """Return the ablation of paper V-B: the same encounter as one primitive."""
    whole = with_changepoints_at(segmentation, np.zeros(0, dtype=np.int64), "")
    return replace(whole, descriptions=("the whole encounter as one primitive",))


def uniform_changepoints(segmentation: Segmentation) -> Segmentation:
    """Return as many changepoints as the segmentation has, evenly spaced in time."""
    count, steps = len(segmentation.changepoints), len(segmentation.labels)
    places = np.linspace(0, steps - 1, count + 2)[1:-1].round().astype(np.int64)
    return with_changepoints_at(segmentation, places, "uniform piece")

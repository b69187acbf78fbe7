# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Encounter -> primitives and changepoints, with their posterior (paper II-B)."""

from scenario_gen.method.segmentation.estimator import (
    SegmentationWarning,
    StickyHDPHMM,
)
from scenario_gen.method.segmentation.hdp_hmm.config import SamplerConfig
from scenario_gen.method.segmentation.posterior import Posterior
from scenario_gen.method.segmentation.segmenter import (
    segment,
    segment_track,
    SegmentationConfig,
)

__all__ = [
    "Posterior",
    "SamplerConfig",
    "SegmentationConfig",
    "SegmentationWarning",
    "StickyHDPHMM",
    "segment",
    "segment_track",
]  # fmt: skip

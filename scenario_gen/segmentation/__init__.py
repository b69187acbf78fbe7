# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Encounter -> primitives and changepoints, with their posterior (paper II-B)."""

from scenario_gen.segmentation.estimator import SegmentationWarning, StickyHDPHMM
from scenario_gen.segmentation.hdp_hmm.config import SamplerConfig
from scenario_gen.segmentation.library import assign, Assignment, build_library, PrimitiveLibrary
from scenario_gen.segmentation.live import LiveSegmenter
from scenario_gen.segmentation.online import Changepoint, OnlineConfig, OnlineSegmenter
from scenario_gen.segmentation.posterior import Posterior
from scenario_gen.segmentation.segment_classes import FinishedSegment
from scenario_gen.segmentation.segmenter import segment, segment_track, SegmentationConfig
from scenario_gen.segmentation.series import segment_series
from scenario_gen.types.segmentation import LiveChangepoints, Segmentation

__all__ = [
    "Assignment",
    "Changepoint",
    "FinishedSegment",
    "LiveChangepoints",
    "LiveSegmenter",
    "OnlineConfig",
    "OnlineSegmenter",
    "Posterior",
    "PrimitiveLibrary",
    "SamplerConfig",
    "Segmentation",
    "SegmentationConfig",
    "SegmentationWarning",
    "StickyHDPHMM",
    "assign",
    "build_library",
    "segment",
    "segment_series",
    "segment_track",
]

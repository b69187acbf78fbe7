"""Encounter -> primitives and changepoints, with their posterior (paper II-B)."""

from scenario_gen.segmentation.library import Assignment, PrimitiveLibrary, assign, build_library
from scenario_gen.segmentation.live import LiveChangepoints, LiveSegmenter
from scenario_gen.segmentation.online import Changepoint, OnlineConfig, OnlineSegmenter
from scenario_gen.segmentation.posterior import Posterior
from scenario_gen.segmentation.result import Segmentation
from scenario_gen.segmentation.segmenter import SegmentationConfig, segment
from scenario_gen.segmentation.series import SamplerConfig, segment_series

__all__ = [
    "Assignment",
    "Changepoint",
    "LiveChangepoints",
    "LiveSegmenter",
    "OnlineConfig",
    "OnlineSegmenter",
    "Posterior",
    "PrimitiveLibrary",
    "SamplerConfig",
    "Segmentation",
    "SegmentationConfig",
    "assign",
    "build_library",
    "segment",
    "segment_series",
]

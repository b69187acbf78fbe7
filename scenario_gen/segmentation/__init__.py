"""Encounter -> primitives and changepoints, with their posterior (paper II-B)."""

from scenario_gen.segmentation.posterior import Posterior
from scenario_gen.segmentation.result import Segmentation
from scenario_gen.segmentation.segmenter import SegmentationConfig, segment
from scenario_gen.segmentation.series import SamplerConfig, segment_series

__all__ = ["Posterior", "SamplerConfig", "Segmentation", "SegmentationConfig", "segment", "segment_series"]

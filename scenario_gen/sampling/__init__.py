"""Time law and Gaussian process -> candidate scenarios (paper III-C)."""

from scenario_gen.sampling.config import SamplingConfig
from scenario_gen.sampling.sample import regenerate, sample_scenarios

__all__ = ["SamplingConfig", "regenerate", "sample_scenarios"]

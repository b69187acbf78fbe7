# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What the segmenter answers."""

from dataclasses import dataclass
import math

from scenario_gen.numerics import Floats, freeze, frozen, frozen_ints, Ints

LONG_SEGMENT_S = 15.0  # an encounter without changepoints that is longer is reported


@dataclass(frozen=True, eq=False)
class Segmentation:
    """Joint primitives of one encounter of T samples.

    Attributes:
        labels: (T,) primitive of each sample, 0 .. n_primitives - 1 in order of first appearance.
        changepoints: (K,) sample indices, each the first sample whose primitive differs (0 is
            none); labels change exactly there.
        changepoint_probability: (T,) posterior probability that a changepoint sits at each sample.
        descriptions: K + 1 sentences, one per segment ("vehicle 0 brakes, vehicle 1 stands").
        r_hat: largest split R-hat of the sampler's traces: whether its chains agreed; nan: not
            known.
    """

    labels: Ints
    changepoints: Ints
    changepoint_probability: Floats
    descriptions: tuple[str, ...]
    r_hat: float = math.nan

    def __post_init__(self) -> None:
        freeze(self, labels=frozen_ints(self.labels), changepoints=frozen_ints(self.changepoints))
        freeze(self, changepoint_probability=frozen(self.changepoint_probability))

    @property
    def n_primitives(self) -> int:
        """Number of distinct primitives."""
        return int(self.labels.max()) + 1

    def remark(self, duration: float) -> str:
        """A remark for users on an encounter of `duration` s without changepoints, or ""."""
        if len(self.changepoints) or duration <= LONG_SEGMENT_S:
            return ""
        return (
            f"no changepoint in {duration:.0f} s: speeds and courses look constant, so scenarios "
            "will have constant speed, too (if they are not constant: raise "
            "segmentation.significance_level, lower segmentation.speed_noise and turn_noise)"
        )

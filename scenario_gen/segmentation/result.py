"""What the segmenter answers."""

from dataclasses import dataclass

from scenario_gen.arrays import Floats, Ints, frozen, frozen_ints


@dataclass(frozen=True, eq=False)
class Segmentation:
    """Joint primitives of one encounter of T samples.

    Attributes:
        labels: (T,) primitive of each sample, 0 .. n_primitives - 1 in order of first appearance.
        changepoints: (K,) sample indices, each the first sample whose primitive differs (0 is none); labels change exactly there.
        changepoint_probability: (T,) posterior probability that a changepoint sits at each sample.
        descriptions: K + 1 sentences, one per segment ("vehicle 0 brakes, vehicle 1 stands").
    """

    labels: Ints
    changepoints: Ints
    changepoint_probability: Floats
    descriptions: tuple[str, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "labels", frozen_ints(self.labels))
        object.__setattr__(self, "changepoints", frozen_ints(self.changepoints))
        object.__setattr__(self, "changepoint_probability", frozen(self.changepoint_probability))

    @property
    def n_primitives(self) -> int:
        """Number of distinct primitives."""
        return int(self.labels.max()) + 1

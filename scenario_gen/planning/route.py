"""A route: the geometry one vehicle drives, without time."""

from dataclasses import dataclass

from scenario_gen.arrays import Floats, Ints, canonical_poses, frozen, frozen_ints


@dataclass(frozen=True, eq=False)
class Route:
    """A smooth path through a vehicle's anchors.

    Attributes:
        points: (M, 3) x [m], y [m], yaw [rad, unwrapped]; at most 0.5 m apart, no two equal; M = 1 if it stands throughout.
        anchor: (K + 2,) index into `points` of each anchor, non-decreasing; equal neighbours are a dwell.
        length: (M,) arc length [m] from the start to each point.
    """

    points: Floats
    anchor: Ints
    length: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", canonical_poses(self.points, continuous=True))
        object.__setattr__(self, "anchor", frozen_ints(self.anchor))
        object.__setattr__(self, "length", frozen(self.length))

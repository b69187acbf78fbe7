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

"""A route: the geometry one vehicle drives, without time."""

from dataclasses import dataclass

from scenario_gen.arrays import canonical_poses, Floats, frozen, frozen_ints, Ints


@dataclass(frozen=True, eq=False)
class Route:
    """A smooth path through a vehicle's anchors.

    Attributes:
        points: (M, 3) x [m], y [m], yaw [rad, unwrapped]; at most 0.5 m apart, no two equal; M = 1 if it stands throughout.
        anchor: (K + 2,) index into `points` of each anchor, non-decreasing; equal neighbours are a dwell.
        length: (M,) arc length [m] from the start to each point.
        joined: legs between waypoints that a direct curve joined at once; None where it is not known (a bag).
        searched: legs that were searched for; likewise.
        left_out: anchors that no free way leads through, so that the route passes them as near as it may.
    """

    points: Floats
    anchor: Ints
    length: Floats
    joined: int | None = None
    searched: int | None = None
    left_out: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", canonical_poses(self.points, continuous=True))
        object.__setattr__(self, "anchor", frozen_ints(self.anchor))
        object.__setattr__(self, "length", frozen(self.length))

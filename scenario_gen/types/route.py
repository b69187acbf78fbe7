# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A route: the geometry one vehicle drives, without time."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

from scenario_gen.numerics import canonical_poses, Floats, freeze, frozen, frozen_ints, Ints

FAR_FROM_FIT_M = 1.5
"""A route that leaves its fitted path by more is reported."""


@dataclass(frozen=True, eq=False)
class Route:
    """A smooth path through a vehicle's anchors.

    Attributes:
        points: (M, 3) x [m], y [m], yaw [rad, unwrapped]; at most 0.5 m apart, no two equal; M = 1
            if it stands throughout.
        anchor: (K + 2,) index into `points` of each anchor, non-decreasing; equal neighbours are a
            dwell.
        length: (M,) arc length [m] from the start to each point.
        joined: legs between waypoints that a direct curve joined at once; None where it is not
            known (a bag).
        searched: legs that were searched for; likewise.
        left_out: anchors that no free route leads through, so that the route passes them as near
            as it may.
        farthest: largest distance [m] between the route and the fitted path, seen from either; NaN
            where it is not known.
    """

    points: Floats
    anchor: Ints
    length: Floats
    joined: int | None = None
    searched: int | None = None
    left_out: tuple[int, ...] = ()
    farthest: float = float("nan")

    def __post_init__(self) -> None:
        points = canonical_poses(self.points, continuous=True)
        freeze(self, points=points, anchor=frozen_ints(self.anchor), length=frozen(self.length))

    def figures(self) -> dict[str, Any]:
        """Return a JSON document: legs, anchors left out, distance to the fitted path [m]."""
        return {
            "legs_joined": self.joined,
            "legs_searched": self.searched,
            "anchors_left_out": list(self.left_out),
            "farthest_from_fit_m": None if math.isnan(self.farthest) else round(self.farthest, 3),
        }

    def remarks(self, vehicle: str) -> list[str]:
        """Return remarks for users: a large distance to the fitted path, anchors left out."""
        sentences = []
        if self.farthest > FAR_FROM_FIT_M:
            sentences.append(
                f"vehicle {vehicle}: its route passes {self.farthest:.1f} m from its fitted path"
            )
        if self.left_out:
            which = ", ".join(str(k) for k in self.left_out)
            sentences.append(
                f"vehicle {vehicle}: no free route leads through its changepoint {which} "
                "as fitted; its route passes beside"
            )
        return sentences


def routes_in_words(routes: Sequence[Route]) -> str:
    """Summarize routes: joined and searched legs, and distances to the fitted paths.

    What is not known is left out, up to nothing.
    """
    sentences = []
    known = [
        (route.joined, route.searched)
        for route in routes
        if route.joined is not None and route.searched is not None
    ]
    if known:
        joined, searched = (sum(int(each[k]) for each in known) for k in (0, 1))
        sentences.append(f"{joined} legs joined at once, {searched} searched for")
    far = [route.farthest for route in routes if not math.isnan(route.farthest)]
    if far:
        sentences.append(f"at most {max(far):.2f} m from the fitted paths")
    return ", ".join(sentences)

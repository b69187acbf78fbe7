# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Results of the stages before the sampling: the segmentation, the fit and the routes."""

from collections.abc import Sequence
from dataclasses import dataclass, field
import math
from typing import Any

import numpy as np

from scenario_gen.numerics import Bools, canonical_poses, Floats, freeze, frozen, frozen_ints, Ints
from scenario_gen.types.notes import Note
from scenario_gen.types.scenario import BoundaryStates
from scenario_gen.types.vehicle import Vehicle


@dataclass(frozen=True, eq=False)
class FittedVehicle:
    """One vehicle's anchors on the road: its start, every changepoint, its end (K + 2 in all).

    Attributes:
        anchors: (K + 2, 3) x [m], y [m], yaw [rad] on the road, after repair.
        moved: (K + 2,) metres that repair moved each anchor.
        stands: (K + 1,) True for the primitives during which the vehicle stands: a dwell, no path.
        scale: factor s of eq 9, template lengths -> road lengths.
        manoeuvre: "straight", "left", "right", "U-turn", or "wait" of one that stands throughout.
        turned: how far [rad, left positive] the vehicle turns in the template and on the road; NaN
            where it is not known.
        path: (M, 3) x, y, yaw of the fitted path from start to end, at most 0.5 m apart; no row
            where it is not known (a bag).
    """

    anchors: Floats
    moved: Floats
    stands: Bools
    scale: float
    manoeuvre: str
    turned: tuple[float, float] = (float("nan"), float("nan"))
    path: Floats = field(default_factory=lambda: np.zeros((0, 3)))

    def __post_init__(self) -> None:
        freeze(
            self,
            anchors=canonical_poses(self.anchors),
            moved=frozen(self.moved),
            path=frozen(self.path),
        )

    def figures(self) -> dict[str, Any]:
        """Return a JSON document: manoeuvre, scale, largest move [m], left turns [deg]."""
        turned = (
            [round(float(turn), 1) for turn in np.degrees(self.turned)]
            if np.isfinite(self.turned).all()
            else [None, None]
        )
        return {
            "manoeuvre": self.manoeuvre,
            "scale": round(self.scale, 4),
            "moved_m": round(float(self.moved.max()), 3),
            "turned_in_template_deg": turned[0],
            "turned_on_road_deg": turned[1],
        }


@dataclass(frozen=True)
class Loss:
    """Something of the template's interaction that the fitted motion has not, or has otherwise.

    Attributes:
        kind: "turn", "conflict" (paths that cross or merge), "following", "new conflict", "order",
            "beside", "lanes" (two become one) or "arm" (nobody uses an arm of the road).
        vehicles: ids of whom it concerns.
        message: a sentence, with figures.
    """

    kind: str
    vehicles: tuple[str, ...]
    message: str


@dataclass(frozen=True, eq=False)
class Fit:
    """A template placed on a road.

    Attributes:
        vehicles: N identities and footprints.
        fitted: N fitted vehicles; none where only the requested states are known.
        anchor_index: (K + 2,) sample index in the template of each anchor (0, changepoints, T -
            1).
        requested: start and end states requested of every scenario (after repair).
        notes: what was decided (an entry chosen and why, an anchor moved by how much).
        losses: what of the template's turns, conflicts and neighbours is lost on this road; none
            where nothing is.
    """

    vehicles: tuple[Vehicle, ...]
    fitted: tuple[FittedVehicle, ...]
    anchor_index: Ints
    requested: BoundaryStates
    notes: tuple[Note, ...]
    losses: tuple[Loss, ...] = ()

    def figures(self) -> dict[str, Any]:
        """Return what is lost, and by vehicle what was decided, ready for JSON."""
        return {
            "lost": [
                {"kind": loss.kind, "vehicles": list(loss.vehicles), "said": loss.message}
                for loss in self.losses
            ],
            "vehicles": {
                vehicle.id: fitted.figures()
                for vehicle, fitted in zip(self.vehicles, self.fitted, strict=False)
            },
        }


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

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The result of the fitting: the changepoints on the road, and the losses of interaction."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from scenario_gen.numerics import Bools, canonical_poses, Floats, freeze, frozen, Ints
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
            "beside" or "arm" (an arm of the road that nobody uses).
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

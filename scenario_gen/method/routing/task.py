# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The planning task of one vehicle: all that its route depends on."""

from dataclasses import dataclass

from scenario_gen.method.routing.config import PlanningConfig
from scenario_gen.method.routing.search.planner import Planner
from scenario_gen.numerics import Floats
from scenario_gen.types import FittedVehicle, Road, Vehicle


@dataclass(frozen=True, eq=False)
class VehicleTask:
    """One vehicle on its road.

    Attributes:
        road: where the vehicle may drive.
        vehicle: its type and size.
        fitted: its anchors and its path on the road.
        config: settings of planning.
        planner: the geometric planner.
        seed: of the planner.
        max_curvature: of the route [1/m].
    """

    road: Road
    vehicle: Vehicle
    fitted: FittedVehicle
    config: PlanningConfig
    planner: Planner
    seed: int
    max_curvature: float

    @property
    def anchors(self) -> Floats:
        """(A, 3) poses."""
        return self.fitted.anchors

    def anchor_name(self, k: int) -> str:
        """Return anchor k for messages."""
        name = f"changepoint {k}"
        if k in (0, len(self.anchors) - 1):
            name = "start" if k == 0 else "end"
        x, y = self.anchors[k, :2]
        return f"the {name} of vehicle {self.vehicle.id} (anchor {k}, at {x:.2f}, {y:.2f} m)"

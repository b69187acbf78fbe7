# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The frame of exported positions, for maps in latitude and longitude.

We read such a map in metres about its centre. Autoware and scenario_simulator_v2 load it in the
frame of its MGRS square: UTM without the multiples of 100 km. Lanelet2's UtmProjector uses UTM
relative to an origin, and other software a local frame about an origin.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.logs import azimuthal, parse_origin, reprojected, utm
from scenario_gen.numerics import frozen
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.types import Scenario

MGRS_SQUARE_M = 100_000.0


def projection_of(
    origin: tuple[float, ...], export: ExportConfig
) -> tuple[str, Callable[[Scenario], Scenario]]:
    """Return a description of the exported frame, and a function that moves scenarios into it.

    If positions stay unchanged, the description is "".

    Args:
        origin: latitude and longitude [degrees] of the frame's origin; () for a map in metres,
            which stays unchanged.
        export: the projection and its origin.

    Raises:
        InputError: the projection's origin is not a latitude and longitude, or is set for MGRS.
    """
    requested = None
    if export.projection_origin:
        requested = parse_origin(export.projection_origin, "projection_origin")
        if export.projection == "mgrs":
            raise InputError(
                "projection_origin: MGRS squares have fixed origins; set projection=utm or local"
            )
    if not origin or (export.projection == "local" and requested is None):
        return "", lambda scenario: scenario
    map_origin = (origin[0], origin[1])
    about = requested or map_origin
    zero = np.zeros(2)
    if export.projection == "local":
        project, name = azimuthal(about), "metres east and north"
    else:
        project, name = utm(about)
        if export.projection == "mgrs":
            zero = np.floor(np.array(project(about[1], about[0])) / MGRS_SQUARE_M) * MGRS_SQUARE_M
            square = f"the MGRS square at {zero[0]:.0f} m east and {zero[1]:.0f} m north"
            name = f"{square} of {name}, as in Autoware"
        elif requested is not None:
            zero = np.array(project(about[1], about[0]))
    if requested is not None:
        name += f" from {about[0]:.7f}, {about[1]:.7f}"

    def moved(scenario: Scenario) -> Scenario:
        position, heading = reprojected(scenario.position, scenario.heading, map_origin, project)
        return replace(scenario, position=frozen(position - zero), heading=frozen(heading))

    return f"positions in {name} (--set projection=mgrs, utm or local)", moved

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The frame in which other software loads a map in latitude and longitude.

Such a map is read in metres about its own middle. Autoware and scenario_simulator_v2 load it in the metres of its MGRS square
(UTM, less the hundreds of kilometres), Lanelet2's UtmProjector in UTM about an origin, others in a local frame about an origin.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.logs import azimuthal, parse_origin, reprojected, utm
from scenario_gen.numerics import frozen
from scenario_gen.output.exchange.config import ExportConfig
from scenario_gen.types import Scenario

SQUARE_M = 100_000.0  # of MGRS


def projection_of(
    origin: tuple[float, ...], export: ExportConfig
) -> tuple[str, Callable[[Scenario], Scenario]]:
    """Return the name of the frame that an export asks for, "" if positions stay, and what moves a scenario into it.

    Args:
        origin: latitude and longitude [degrees] about which positions are; (): they came in metres, which stay.
        export: the projection and its origin.

    Raises:
        InputError: MGRS has no origin of one's own, or the origin is no latitude and longitude.
    """
    about = (
        parse_origin(export.projection_origin, "projection_origin")
        if export.projection_origin
        else None
    )
    if about is not None and export.projection == "mgrs":
        raise InputError(
            "projection_origin: the squares of MGRS lie where they lie; take it with --set projection=utm or local"
        )
    if not origin or (export.projection == "local" and about is None):
        return "", lambda scenario: scenario
    middle = origin[0], origin[1]
    (into, name), zero = utm(about or middle), np.zeros(2)
    if export.projection == "local":
        into, name = azimuthal(about or middle), "metres east and north"
    elif export.projection == "mgrs":
        zero = np.floor(np.array(into(*middle[::-1])) / SQUARE_M) * SQUARE_M
        name = f"the MGRS square at {zero[0]:.0f} m east and {zero[1]:.0f} m north of {name}, as Autoware loads the map"
    elif about is not None:
        zero = np.array(into(*about[::-1]))
    if about is not None:
        name += f" from {about[0]:.7f}, {about[1]:.7f}"

    def moved(scenario: Scenario) -> Scenario:
        position, heading = reprojected(scenario.position, scenario.heading, middle, into)
        return replace(scenario, position=frozen(position - zero), heading=frozen(heading))

    return f"positions in {name} (--set projection=mgrs, utm or local)", moved

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""CommonRoad maps, XML of versions 2018b and 2020a; its obstacles and planning problems are passed over.

Source: CommonRoad's documentation of the XML format, 2018b and 2020a.
"""

import math

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.base.markup import Element, finite
from scenario_gen.numerics import Floats
from scenario_gen.roads.vector.network import Draft, MapLanes, refuse_too_many_lanes

SKIPPED = frozenset(
    ("obstacle", "staticObstacle", "dynamicObstacle", "environmentObstacle", "phantomObstacle", "planningProblem", "scenarioTags")
)
_NOT_FOR_CARS = frozenset(
    ("sidewalk", "crosswalk", "bicycleLane", "busLane", "shoulder", "parking", "border", "railway", "restricted")
)
_MAX_SPEED = ("274", "274.1", "R2-1", "maxSpeed")  # names and national numbers of the sign


def lanes_of(root: Element) -> MapLanes:
    """Return the lanes of a CommonRoad file.

    Raises:
        InputError: it is broken; names file and line.
    """
    lanelets = {element.get("id"): element for element in root.all("lanelet")}
    refuse_too_many_lanes(len(lanelets), root.file)
    limits = _speed_signs(root)
    junctions = _junctions(root, set(lanelets))
    for_cars = {
        name: lanelet
        for name, lanelet in lanelets.items()
        if not {kind.text.strip() for kind in lanelet.all("laneletType")} & _NOT_FOR_CARS
    }
    drafts = []
    for name, lanelet in for_cars.items():
        successors = tuple(after.get("ref") for after in lanelet.all("successor"))
        unknown = next((after for after in successors if after not in lanelets), None)
        if unknown is not None:
            raise InputError(f"{lanelet.place}: lanelet {name} leads to lanelet {unknown}, which is not there")
        beside = tuple(
            side.get("ref")
            for tag in ("adjacentLeft", "adjacentRight")
            for side in lanelet.all(tag)
            if side.attributes.get("drivingDir") == "same"
        )
        left, right = (_points(lanelet.one(tag)) for tag in ("leftBound", "rightBound"))
        limit, junction = _speed_limit(lanelet, limits), junctions.get(name, "")
        drafts.append(Draft(name, left, right, successors, beside, limit, junction, lanelet.place))
    version = root.attributes.get("commonRoadVersion", "?")
    notes = (f"CommonRoad {version}: coordinates as they stand, in metres", *_georeference(root))
    return MapLanes(drafts, notes, len(lanelets) - len(for_cars))


def _georeference(root: Element) -> list[str]:
    reference = root.first("location", "geoTransformation", "geoReference")
    return [f"geoReference {' '.join(reference.text.split())} is stated, not applied"] if reference is not None else []


def _points(bound: Element) -> Floats:
    points = [(point.one("x").value(), point.one("y").value()) for point in bound.all("point")]
    return np.array(points, dtype=np.float64).reshape(-1, 2)


def _speed_signs(root: Element) -> dict[str, float]:
    """Speed limits [m/s] by the id of their sign."""
    limits = {}
    for sign in root.all("trafficSign"):
        for element in sign.all("trafficSignElement"):
            kind, value = element.first("trafficSignID"), element.first("additionalValue")
            if kind is not None and value is not None and kind.text.strip() in _MAX_SPEED:
                limits[sign.get("id")] = finite(value.text.strip(), value.place)
    return limits


def _speed_limit(lanelet: Element, signs: dict[str, float]) -> float:
    own = lanelet.first("speedLimit")
    if own is not None:
        return own.value()
    return min(
        (signs[ref.get("ref")] for ref in lanelet.all("trafficSignRef") if ref.attributes.get("ref") in signs), default=math.nan
    )


def _junctions(root: Element, known: set[str]) -> dict[str, str]:
    """The intersection of each lanelet that lies in one: those that follow its incoming lanelets."""
    junctions: dict[str, str] = {}
    for intersection in root.all("intersection"):
        for incoming in intersection.all("incoming"):
            for tag in ("successorsLeft", "successorsRight", "successorsStraight"):
                for ref in incoming.all(tag):
                    if ref.get("ref") not in known:
                        raise InputError(f"{ref.place}: lanelet {ref.get('ref')} is not there")
                    junctions[ref.get("ref")] = intersection.get("id")
    return junctions

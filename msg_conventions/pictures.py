# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Pictures for RViz and Foxglove: footprints (geometry_msgs/PolygonStamped) and markers (visualization_msgs/MarkerArray).

Only footprints are read back. Frame: that of the vehicles drawn. QoS: reliable, transient_local.
"""

from collections.abc import Sequence

import numpy as np

from msg_conventions.cdr import encode
from msg_conventions.layouts import MARKERS, POLYGON
from msg_conventions.markers import CUBE, CYLINDER, DELETE_ALL, LINE_LIST, LINE_STRIP, Marker
from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.curve import Curve
from scenario_gen.types import LaneNetwork, Scenario, tokens, Vehicle
from scenario_gen.types.markings import Marking, markings

FOOTPRINT_TYPE = "geometry_msgs/msg/PolygonStamped"
COLOURS = (
    (0.12, 0.47, 0.71),
    (0.84, 0.15, 0.16),
    (0.17, 0.63, 0.17),
    (1.0, 0.5, 0.05),
    (0.58, 0.4, 0.74),
    (0.55, 0.34, 0.29),
)
EGO_COLOUR = (0.06, 0.09, 0.16)
EXPOSED_COLOUR, NARROW = (
    (1.0, 0.84, 0.0),
    1.0,
)  # of those that are usually narrower than so many metres
PAINT = {
    Marking.EDGE: (0.15,),
    Marking.LANE: (0.12, 3.0, 4.5),
    Marking.CENTRE: (0.15, 3.0, 1.5),
    Marking.STOP: (0.5,),
    Marking.GIVE_WAY: (0.4, 0.6, 0.4),
    Marking.ARROW: (0.12,),
    Marking.ZEBRA: (0.5,),
}
"""How wide a marking is, and of how many metres its dashes and gaps are."""


def encode_footprint(vehicle: Vehicle, stamp_ns: int, frame_id: str) -> bytes:
    """Return the footprint in the vehicle's own frame: four corners, counter-clockwise from front left, metres, float32."""
    x, y = 0.5 * vehicle.length, 0.5 * vehicle.width
    corners = ((x, y, 0.0), (-x, y, 0.0), (-x, -y, 0.0), (x, -y, 0.0))
    return encode(POLYGON, stamp=stamp_ns, frame_id=frame_id, points=corners)


def body(
    name: str,
    vehicle: Vehicle,
    pose: tuple[float, float, float],
    colour: tuple[float, ...],
    alpha: float,
) -> Marker:
    """Return a vehicle at a pose [m, rad], as high as its type: a box, or a cylinder of who walks; yellow if it is exposed."""
    kind, shown = (
        vehicle.kind,
        colour if vehicle.kind.width >= NARROW or colour == EGO_COLOUR else EXPOSED_COLOUR,
    )
    size = (vehicle.length, vehicle.width, kind.height)
    red, green, blue = shown
    return Marker(
        f"box_{name}",
        CYLINDER if kind.walks else CUBE,
        pose=pose,
        scale=size,
        colour=(red, green, blue, alpha),
    )


def scenario_markers(scenario: Scenario, stamp_ns: int) -> bytes:
    """Return one scenario as a MarkerArray that replaces the one before: a line along each path, its vehicle where it begins."""
    markers = [Marker("", 0, DELETE_ALL)]
    for k, (name, vehicle) in enumerate(
        zip(tokens(v.id for v in scenario.vehicles), scenario.vehicles, strict=True)
    ):
        first, last = scenario.present[k].tolist()
        colour, path = COLOURS[k % len(COLOURS)], scenario.position[k, first : last + 1]
        x, y = path[0].tolist()
        markers.append(
            Marker(
                f"path_{name}",
                LINE_STRIP,
                scale=(0.15, 0.0, 0.0),
                colour=(*colour, 0.6),
                points=path,
            )
        )
        markers.append(body(name, vehicle, (x, y, float(scenario.heading[k, 0])), colour, 0.8))
    return encode_markers(markers, scenario.frame_id, stamp_ns)


def vehicle_markers(
    vehicles: Sequence[Vehicle],
    states: Floats,
    here: Bools,
    ego: int,
    frame_id: str,
    stamp_ns: int,
) -> bytes:
    """Return each vehicle that is there, states (N, 3+) x, y [m], yaw [rad], in place of all boxes before."""
    names = tokens(vehicle.id for vehicle in vehicles)
    markers = [Marker("", CUBE, DELETE_ALL, scale=(1.0, 1.0, 1.0))]
    for k in np.flatnonzero(here).tolist():
        x, y, yaw = states[k, :3].tolist()
        markers.append(
            body(
                names[k],
                vehicles[k],
                (x, y, yaw),
                EGO_COLOUR if k == ego else COLOURS[k % len(COLOURS)],
                0.9,
            )
        )
    return encode_markers(markers, frame_id, stamp_ns)


def road_markers(network: LaneNetwork | None, frame_id: str, stamp_ns: int) -> bytes:
    """Return what is painted on a road's lanes as a MarkerArray that replaces the one before; without lanes nothing."""
    markers = [Marker("", 0, DELETE_ALL)]
    for kind, lines in (markings(network) if network is not None else {}).items():
        width, *dashes = PAINT[kind]
        points = [_pairs(line, *dashes) for line in lines]
        if points:
            paint = Marker(
                kind,
                LINE_LIST,
                scale=(width, 0.0, 0.0),
                colour=(1.0, 1.0, 1.0, 0.9),
                points=np.concatenate(points),
            )
            markers.append(paint)
    return encode_markers(markers, frame_id, stamp_ns)


def _pairs(line: Floats, dash: float = 0.0, gap: float = 0.0) -> Floats:
    """(2K, 2) [m] the begin and the end of each piece of a line (M, 2), or of each dash."""
    if not dash:
        return line[np.repeat(np.arange(len(line)), 2)[1:-1]]
    curve = Curve.through(line)
    begin = np.arange(0.0, curve.length, dash + gap)
    return curve.at(np.column_stack((begin, np.minimum(begin + dash, curve.length))).ravel())[
        :, :2
    ]


def encode_markers(markers: Sequence[Marker], frame_id: str, stamp_ns: int) -> bytes:
    """Return markers as CDR bytes of a MarkerArray."""
    return encode(MARKERS, markers=[marker.fields(frame_id, stamp_ns) for marker in markers])

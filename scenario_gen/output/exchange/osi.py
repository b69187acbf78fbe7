# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""ASAM OSI 3.8: one MCAP file per scenario, for omega-prime.

A file has one GroundTruth message per instant, and the road as OpenDRIVE. Sources: OSI 3.8
(GroundTruth, MovingObject, and the trace file format for MCAP); omega-prime 0.3.7 (`Recording`,
`MapOdr`), which defines the topics. Positions refer to the centre of the bounding box, half a
height above the ground, in the frame of the scenarios. Accelerations are vectors and include the
lateral part. Times start at 0. A vehicle is in the messages while it is present.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import count
import math
from pathlib import Path
from typing import Any

import numpy as np

from scenario_gen.base.errors import InputError, needs
from scenario_gen.base.xml_reader import read_xml
from scenario_gen.numerics import Floats, NS_PER_S, wrap_angle
from scenario_gen.output.exchange.cases import Case, Exported, scenario_source
from scenario_gen.output.exchange.osi_lights import (
    bulbs,
    lane_lights,
    LaneLights,
    lanes_with_lights,
)
from scenario_gen.output.exchange.xml import date_of
from scenario_gen.types import (
    height,
    OBSTACLE_HEIGHT_M,
    rear_axle,
    Scenario,
    Vehicle,
    WHEELBASE_SHARE,
)

OBJECTS, MAP = "ground_truth", "ground_truth_map"  # omega-prime's topics
WHEEL_RADIUS_M = 0.325  # as in OpenSCENARIO files
MAX_ID = 2**63 - 1  # that readers with signed numbers can hold


@dataclass(frozen=True)
class Frame:
    """The geodetic frame of an OpenDRIVE file.

    Attributes:
        projection: PROJ string, "" if unknown.
        offset: x, y, z [m] and yaw [rad] of the origin.
    """

    projection: str
    offset: tuple[float, float, float, float] | None


@dataclass(frozen=True, eq=False)
class _Moving:
    """All vehicles, the ego last: their motion, numbers, yaw rates (N, T) [rad/s], and lights."""

    motion: Scenario
    numbers: tuple[int, ...]
    yaw_rate: Floats
    lights: LaneLights
    lanes: list[Any]


def write_osi(path: Path, case: Case, exported: Exported, road: Path) -> tuple[str, ...]:
    """Write a scenario to an MCAP file; return notes.

    Args:
        path: of the file.
        case: whose stamp is the file's date.
        exported: the scenario; its ego, or else its first vehicle, is the host.
        road: an OpenDRIVE file, in the scenario's frame.

    Raises:
        InputError: the OpenDRIVE file is not UTF-8.
        MissingExtraError: betterosi is not installed.
    """
    needs("osi", "betterosi")
    import betterosi

    numbers, notes = object_numbers(exported)
    motion = exported.everybody
    lights = lane_lights(case, motion)
    lanes = list(lanes_with_lights(lights, case))
    moving = _Moving(motion, numbers, _yaw_rates(motion), lights, lanes)
    host = numbers[-1] if exported.ego is not None else numbers[0]
    text, frame = _text(road), _frame(road)
    standing = list(_standing(case, numbers))
    metadata = {
        "creation_time": f"{date_of(case.start_ns)}Z",
        "description": f"{case.road_name}, {scenario_source(case, exported)}",
        "authors": "scenario_gen",
    }
    with betterosi.Writer(
        path, metadata=metadata, library="scenario_gen", descriptor_set=_definitions()
    ) as trace:
        drawn = betterosi.MapAsamOpenDrive(map_reference=road.name, open_drive_xml_content=text)
        trace.add(drawn, topic=MAP, log_time=0)
        for k, stamp in enumerate(np.round(motion.time * NS_PER_S).astype(np.int64).tolist()):
            trace.add(
                _ground_truth(moving, standing, k, stamp, host, road.name, frame),
                topic=OBJECTS,
                log_time=stamp,
            )
    return notes


def object_numbers(exported: Exported) -> tuple[tuple[int, ...], tuple[str, ...]]:
    """Return the numbers of the vehicles, the ego's last, and a note if they are not their ids.

    OSI's ids are numbers: if any id is not a number, all vehicles are numbered from 1.
    """
    ids = exported.everybody.ids
    digits = len(str(MAX_ID))
    if all(
        name.isascii()
        and name.isdigit()
        and len(name) <= digits
        and str(int(name)) == name
        and int(name) <= MAX_ID
        for name in ids
    ):
        return tuple(int(name) for name in ids), ()
    numbers = tuple(range(1, len(ids) + 1))
    listed = ", ".join(f"{name} is {number}" for name, number in zip(ids, numbers, strict=True))
    return numbers, (f"ids are numbers in OSI: {listed}",)


def _yaw_rates(motion: Scenario) -> Floats:
    """Return yaw rates (N, T) [rad/s], by central differences while a vehicle is present."""
    rates: Floats = np.zeros(motion.heading.shape)
    for n, (first, last) in enumerate(motion.present.tolist()):
        present = slice(first, last + 1)
        if last > first:
            rates[n, present] = np.gradient(motion.heading[n, present], motion.time[present])
    return rates


def _ground_truth(
    moving: _Moving,
    standing: list[Any],
    k: int,
    stamp: int,
    host: int,
    road_file: str,
    frame: Frame,
) -> Any:
    """Return the message of instant `k`; it names the host while that is present."""
    import betterosi as osi

    objects = list(_objects(moving, k))
    has_host = any(item.id.value == host for item in objects)
    major, minor, patch = map(int, osi.DEFAULT_VERSION.split("."))
    offset = None
    if frame.offset is not None:
        x, y, z, yaw = frame.offset
        offset = osi.GroundTruth.ProjFrameOffset(position=osi.Vector3d(x=x, y=y, z=z), yaw=yaw)
    return osi.GroundTruth(
        version=osi.InterfaceVersion(
            version_major=major, version_minor=minor, version_patch=patch
        ),
        timestamp=osi.Timestamp(seconds=stamp // NS_PER_S, nanos=stamp % NS_PER_S),
        host_vehicle_id=osi.Identifier(value=host) if has_host else None,
        moving_object=objects,
        stationary_object=standing,
        traffic_light=list(bulbs(moving.lights, float(moving.motion.time[k]))),
        lane=moving.lanes,
        map_reference=road_file,
        proj_string=frame.projection or None,
        proj_frame_offset=offset,
    )


def _objects(moving: _Moving, k: int) -> Iterator[Any]:
    """Yield the vehicles that are present at instant `k`."""
    import betterosi as osi

    motion = moving.motion
    for n in np.flatnonzero(motion.is_present[:, k]).tolist():
        vehicle, heading = motion.vehicles[n], motion.heading[n, k]
        cos, sin = float(np.cos(heading)), float(np.sin(heading))
        speed, along, rate = (
            float(values[n, k]) for values in (motion.speed, motion.acceleration, moving.yaw_rate)
        )
        x, y = motion.position[n, k].tolist()
        across = speed * rate
        base = osi.BaseMoving(
            dimension=osi.Dimension3d(
                length=vehicle.length, width=vehicle.width, height=height(vehicle)
            ),
            position=osi.Vector3d(x=x, y=y, z=height(vehicle) / 2.0),
            orientation=osi.Orientation3d(roll=0.0, pitch=0.0, yaw=_wrapped(heading)),
            velocity=osi.Vector3d(x=speed * cos, y=speed * sin, z=0.0),
            acceleration=osi.Vector3d(
                x=along * cos - across * sin, y=along * sin + across * cos, z=0.0
            ),
            orientation_rate=osi.Orientation3d(roll=0.0, pitch=0.0, yaw=rate),
        )
        number, classes = (
            osi.Identifier(value=moving.numbers[n]),
            osi.MovingObject.VehicleClassification,
        )
        if vehicle.kind.walks:
            yield osi.MovingObject(id=number, type=osi.MovingObject.Type.PEDESTRIAN, base=base)
            continue
        towed = {}
        if vehicle.trailer is not None and vehicle.trailer.id in motion.ids:
            trailer = osi.Identifier(value=moving.numbers[motion.ids.index(vehicle.trailer.id)])
            towed = {"has_trailer": True, "trailer_id": trailer}
        yield osi.MovingObject(
            id=number,
            type=osi.MovingObject.Type.VEHICLE,
            base=base,
            vehicle_classification=classes(
                type=classes.Type[vehicle.kind.osi], role=classes.Role.CIVIL, **towed
            ),
            vehicle_attributes=_attributes(vehicle),
        )


def _standing(case: Case, numbers: Sequence[int]) -> Iterator[Any]:
    """Yield the obstacles of the road, with numbers that no vehicle has."""
    import betterosi as osi

    classes = osi.StationaryObject.Classification
    free = (number for number in count(1) if number not in numbers)
    for obstacle, number in zip(case.lane_map.network.obstacles, free, strict=False):
        yield osi.StationaryObject(
            id=osi.Identifier(value=number),
            base=osi.BaseStationary(
                dimension=osi.Dimension3d(
                    length=obstacle.length, width=obstacle.width, height=OBSTACLE_HEIGHT_M
                ),
                position=osi.Vector3d(x=obstacle.x, y=obstacle.y, z=OBSTACLE_HEIGHT_M / 2.0),
                orientation=osi.Orientation3d(roll=0.0, pitch=0.0, yaw=_wrapped(obstacle.yaw)),
            ),
            classification=classes(type=classes.Type.OTHER),
        )


def _wrapped(heading: float) -> float:
    """Return an angle [rad] from -π to π."""
    return min(max(float(wrap_angle(np.asarray(heading))), -math.pi), math.pi)


def _attributes(vehicle: Vehicle) -> Any:
    """Return where the axles are, from the middle of the bounding box, and the wheels."""
    import betterosi as osi

    rear, down = -rear_axle(vehicle), WHEEL_RADIUS_M - height(vehicle) / 2.0
    return osi.MovingObject.VehicleAttributes(
        bbcenter_to_rear=osi.Vector3d(x=rear, y=0.0, z=down),
        bbcenter_to_front=osi.Vector3d(x=rear + WHEELBASE_SHARE * vehicle.length, y=0.0, z=down),
        radius_wheel=WHEEL_RADIUS_M,
    )


def _text(road: Path) -> str:
    try:
        return road.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"map {road.name}: not UTF-8 (byte {error.start}), as a trace of OSI holds its map; "
            "save it as UTF-8"
        ) from error


def _frame(road: Path) -> Frame:
    """Return the geodetic frame of an OpenDRIVE file."""
    header = read_xml(road, road.name).find("header")
    reference = header.find("geoReference") if header is not None else None
    offset = header.find("offset") if header is not None else None
    moved = None
    if offset is not None:
        moved = (
            offset.number("x", 0.0),
            offset.number("y", 0.0),
            offset.number("z", 0.0),
            offset.number("hdg", 0.0),
        )
    return Frame(" ".join(reference.content.split()) if reference is not None else "", moved)


@cache
def _definitions() -> bytes:
    """Return the FileDescriptorSet of OSI's messages, without comments (an eighth of the size)."""
    import betterosi
    from protobuf.wkt import FileDescriptorSet

    whole = FileDescriptorSet.from_binary(betterosi.load_descriptor_set(betterosi.DEFAULT_VERSION))
    for file in whole.file:
        file.source_code_info = None
    definitions: bytes = whole.to_binary()
    return definitions

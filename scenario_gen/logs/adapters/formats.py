# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which columns of public data sets hold which quantity, in which unit, by their definitions.

Positions are those of the middle of the bounding box, except in highD, which gives its upper left corner; headings are
counter-clockwise from +x. Road users that are neither car, van, truck nor bus are counted and left out.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
import math

from scenario_gen.logs.columns import Column


@dataclass(frozen=True)
class Format:
    """How a data set writes its tracks.

    Attributes:
        title: for people.
        source: of the definition.
        columns: quantity -> column, with its factor to s, m, m/s or rad: vehicle, time, x, y, vx, vy, heading, length, width,
            kind, and subkind, which says more of those that are of kind "vehicle".
        kinds: which of `kind` are read, in small letters.
        names: of the numbers in `kind` and in `subkind`, where these are no texts.
        optional: quantities that a file need not have.
        companions: endings of the files of tracks, of classes and of frames per second, where these are three files.
        image: y grows downwards and positions are corners (highD).
        signs: further columns that distinguish the format from others.
    """

    title: str
    source: str
    columns: dict[str, Column]
    kinds: tuple[str, ...]
    companions: tuple[str, str, str] | None = None
    image: bool = False
    signs: tuple[str, ...] = ()
    names: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    optional: frozenset[str] = frozenset()

    @property
    def needed(self) -> frozenset[str]:
        """The columns that a file must have."""
        wanted = {column.name for quantity, column in self.columns.items() if quantity not in self.optional}
        return frozenset(wanted | set(self.signs))

    @property
    def useful(self) -> frozenset[str]:
        """The columns that are read where a file has them, with those that it must have."""
        return self.needed | {column.name for column in self.columns.values()}


OSI_TYPES = dict(enumerate(("unknown", "other", "vehicle", "pedestrian", "animal")))
OSI_VEHICLES = dict(
    enumerate(
        (
            *(
                "vehicle",
                "vehicle",
                "small car",
                "compact car",
                "car",
                "luxury car",
                "delivery van",
                "heavy truck",
                "semitrailer",
            ),
            *("trailer", "motorbike", "bicycle", "bus", "tram", "train", "wheelchair", "semitractor", "standup scooter"),
            *("micromobility device", "work machine", "watercraft", "aircraft", "land vehicle"),
        )
    )
)  # 0 and 1 are unknown and other: a vehicle, no more is said
_LEVELX = ("_tracks.csv", "_tracksMeta.csv", "_recordingMeta.csv")  # their times are frames

FORMATS = {
    "argoverse2": Format(
        title="Argoverse 2 motion forecasting",
        source="av2-api: av2.datasets.motion_forecasting.data_schema (Track, ObjectState), columns of Parquet; steps are 0.1 s",
        columns={
            "vehicle": Column("track_id"),
            "time": Column("timestep", 0.1),
            "x": Column("position_x"),
            "y": Column("position_y"),
            "vx": Column("velocity_x"),
            "vy": Column("velocity_y"),
            "heading": Column("heading"),
            "kind": Column("object_type"),
        },
        kinds=("vehicle", "bus"),
        signs=("scenario_id",),
    ),
    "interaction": Format(
        title="INTERACTION",
        source="INTERACTION: vehicle_tracks_*.csv and pedestrian_tracks_*.csv (Zhan et al. 2019, and the README of its tools)",
        columns={
            "vehicle": Column("track_id"),
            "time": Column("timestamp_ms", 1e-3),
            "x": Column("x"),
            "y": Column("y"),
            "vx": Column("vx"),
            "vy": Column("vy"),
            "heading": Column("psi_rad"),
            "length": Column("length"),
            "width": Column("width"),
            "kind": Column("agent_type"),
        },
        kinds=("car", "truck", "bus", "van"),
        signs=("frame_id",),
    ),
    "ind": Format(
        title="inD, rounD",
        source="inD, rounD: format pages of the data sets (Bock et al. 2020, Krajewski et al. 2020); frame rate in recordingMeta",
        columns={
            "vehicle": Column("trackId"),
            "time": Column("frame"),
            "x": Column("xCenter"),
            "y": Column("yCenter"),
            "vx": Column("xVelocity"),
            "vy": Column("yVelocity"),
            "heading": Column("heading", math.pi / 180.0),
            "length": Column("length"),
            "width": Column("width"),
        },
        kinds=("car", "truck", "van", "bus", "truck_bus", "trailer"),
        companions=_LEVELX,
    ),
    "highd": Format(
        title="highD",
        source="highD: format page (Krajewski et al. 2018): x, y the upper left corner, y down, width along the road",
        columns={
            "vehicle": Column("id"),
            "time": Column("frame"),
            "x": Column("x"),
            "y": Column("y"),
            "vx": Column("xVelocity"),
            "vy": Column("yVelocity"),
            "length": Column("width"),
            "width": Column("height"),
        },
        kinds=("car", "truck"),
        companions=_LEVELX,
        image=True,
        signs=("laneId",),
    ),
    "omega_prime": Format(
        title="omega-prime",
        source="omega-prime 0.3.7: omega_prime.schemas, columns of CSV and Parquet; numbers of types: OSI 3.8, MovingObject",
        columns={
            "vehicle": Column("idx"),
            "time": Column("total_nanos", 1e-9),
            "x": Column("x"),
            "y": Column("y"),
            "vx": Column("vel_x"),
            "vy": Column("vel_y"),
            "heading": Column("yaw"),
            "length": Column("length"),
            "width": Column("width"),
            "kind": Column("type"),
            "subkind": Column("subtype"),
        },
        kinds=(
            *("vehicle", "small car", "compact car", "car", "luxury car", "delivery van", "heavy truck", "semitractor"),
            *("bus", "land vehicle"),
        ),
        names={
            "kind": {str(number): name for number, name in OSI_TYPES.items()},
            "subkind": {"-1": "vehicle"} | {str(number): name for number, name in OSI_VEHICLES.items()},
        },
        optional=frozenset(("vx", "vy", "heading", "length", "width", "subkind")),
    ),
}
"""By their names in the parameter `format`."""

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which columns of public data sets hold which quantity, in which unit, by their definitions.

Positions are those of the middle of the bounding box, except in highD, which gives its upper left corner; headings are
counter-clockwise from +x. Who is neither car, van, truck nor bus is counted and left out.
"""

from dataclasses import dataclass, field
import math

DEGREES = math.pi / 180.0


@dataclass(frozen=True)
class Quantity:
    """A column, and the factor from its unit to ours (s, m, m/s, rad)."""

    column: str
    unit: str
    factor: float = 1.0


@dataclass(frozen=True)
class Format:
    """How a data set writes its tracks.

    Attributes:
        name: of the parameter `format`.
        title: for people.
        source: of the definition.
        columns: quantity -> column: vehicle, time, x, y, vx, vy, heading, length, width, kind.
        kinds: what is read of `kind`, in small letters.
        companion: endings of a file with tracks and of the files beside it that give classes and frames per second, if any.
        image: y grows downwards and positions are corners (highD).
        signs: further columns that tell the format from others.
    """

    name: str
    title: str
    source: str
    columns: dict[str, Quantity]
    kinds: tuple[str, ...]
    companion: tuple[str, str, str] | None = None
    image: bool = False
    signs: tuple[str, ...] = field(default=())

    @property
    def needed(self) -> frozenset[str]:
        """The columns that a file must have."""
        return frozenset({quantity.column for quantity in self.columns.values()} | set(self.signs))


_LEVELX = ("_tracks.csv", "_tracksMeta.csv", "_recordingMeta.csv")

ARGOVERSE2 = Format(
    name="argoverse2",
    title="Argoverse 2 motion forecasting",
    source="av2-api: av2.datasets.motion_forecasting.data_schema (Track, ObjectState) and its Parquet columns; steps are 0.1 s",
    columns={
        "vehicle": Quantity("track_id", "text"),
        "time": Quantity("timestep", "0.1 s", 0.1),
        "x": Quantity("position_x", "m"),
        "y": Quantity("position_y", "m"),
        "vx": Quantity("velocity_x", "m/s"),
        "vy": Quantity("velocity_y", "m/s"),
        "heading": Quantity("heading", "rad"),
        "kind": Quantity("object_type", "text"),
    },
    kinds=("vehicle", "bus"),
    signs=("scenario_id",),
)
INTERACTION = Format(
    name="interaction",
    title="INTERACTION",
    source="INTERACTION: vehicle_tracks_*.csv and pedestrian_tracks_*.csv (Zhan et al. 2019, and the README of its tools)",
    columns={
        "vehicle": Quantity("track_id", "text"),
        "time": Quantity("timestamp_ms", "ms", 1e-3),
        "x": Quantity("x", "m"),
        "y": Quantity("y", "m"),
        "vx": Quantity("vx", "m/s"),
        "vy": Quantity("vy", "m/s"),
        "heading": Quantity("psi_rad", "rad"),
        "length": Quantity("length", "m"),
        "width": Quantity("width", "m"),
        "kind": Quantity("agent_type", "text"),
    },
    kinds=("car", "truck", "bus", "van"),
    signs=("frame_id",),
)
IND = Format(
    name="ind",
    title="inD, rounD",
    source="inD, rounD: format pages of the data sets (Bock et al. 2020, Krajewski et al. 2020); frame rate in recordingMeta",
    columns={
        "vehicle": Quantity("trackId", "number"),
        "time": Quantity("frame", "frames"),
        "x": Quantity("xCenter", "m"),
        "y": Quantity("yCenter", "m"),
        "vx": Quantity("xVelocity", "m/s"),
        "vy": Quantity("yVelocity", "m/s"),
        "heading": Quantity("heading", "°", DEGREES),
        "length": Quantity("length", "m"),
        "width": Quantity("width", "m"),
    },
    kinds=("car", "truck", "van", "bus", "truck_bus", "trailer"),
    companion=_LEVELX,
)
HIGHD = Format(
    name="highd",
    title="highD",
    source="highD: format page of the data set (Krajewski et al. 2018): x, y the upper left corner, y down, width along the road",
    columns={
        "vehicle": Quantity("id", "number"),
        "time": Quantity("frame", "frames"),
        "x": Quantity("x", "m"),
        "y": Quantity("y", "m"),
        "vx": Quantity("xVelocity", "m/s"),
        "vy": Quantity("yVelocity", "m/s"),
        "length": Quantity("width", "m"),
        "width": Quantity("height", "m"),
    },
    kinds=("car", "truck"),
    companion=_LEVELX,
    image=True,
    signs=("laneId",),
)
FORMATS = {known.name: known for known in (ARGOVERSE2, INTERACTION, IND, HIGHD)}

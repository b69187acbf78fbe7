# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which columns of public data sets hold which quantity, in which unit, by their definitions.

Positions are those of the middle of the bounding box, except in highD, which gives its upper left corner; headings are
counter-clockwise from +x. Road users that are neither car, van, truck nor bus are counted and left out.
"""

from dataclasses import dataclass
import math

from scenario_gen.logs.columns import Column


@dataclass(frozen=True)
class Format:
    """How a data set writes its tracks.

    Attributes:
        title: for people.
        source: of the definition.
        columns: quantity -> column, with its factor to s, m, m/s or rad: vehicle, time, x, y, vx, vy, heading, length, width,
            kind.
        kinds: which of `kind` are read, in small letters.
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

    @property
    def needed(self) -> frozenset[str]:
        """The columns that a file must have."""
        return frozenset({column.name for column in self.columns.values()} | set(self.signs))


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
}
"""By their names in the parameter `format`."""

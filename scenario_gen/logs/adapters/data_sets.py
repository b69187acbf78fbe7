# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which columns of public data sets hold which quantity, in which unit, by their definitions.

Positions are those of the middle of the bounding box, except in highD, which gives its upper left corner; headings are
counter-clockwise from +x.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
import math

from scenario_gen.logs.columns import Column


@dataclass(frozen=True)
class DataSet:
    """How a data set writes its tracks.

    Attributes:
        title: for people.
        source: of the definition.
        columns: quantity -> column, with its factor to s, m, m/s or rad: vehicle, time, x, y, vx, vy, heading, length, width,
            kind, and subkind, which says more of those that are of kind "vehicle".
        names: of the numbers in `kind` and in `subkind`, where these are no texts.
        optional: quantities that a file need not have.
        companions: endings of the files of tracks, of classes and of frames per second, where these are three files.
        image: y grows downwards and positions are corners (highD).
        signs: further columns that distinguish the format from others.
    """

    title: str
    source: str
    columns: dict[str, Column]
    companions: tuple[str, str, str] | None = None
    image: bool = False
    signs: tuple[str, ...] = ()
    names: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    optional: frozenset[str] = frozenset()

    @property
    def needed(self) -> frozenset[str]:
        """The columns that a file must have."""
        wanted = {
            column.name
            for quantity, column in self.columns.items()
            if quantity not in self.optional
        }
        return frozenset(wanted | set(self.signs))

    @property
    def useful(self) -> frozenset[str]:
        """The columns that are read where a file has them, with those that it must have."""
        return self.needed | {column.name for column in self.columns.values()}


def _columns(names: str, **scaled: tuple[str, float]) -> dict[str, Column]:
    """Return columns by quantity, of a text `x=xCenter y=yCenter`; those with a factor to our unit are given by themselves."""
    plain = (part.split("=") for part in names.split())
    return {quantity: Column(name) for quantity, name in plain} | {
        key: Column(*column) for key, column in scaled.items()
    }


OSI_TYPES = dict(enumerate(("unknown", "other", "vehicle", "pedestrian", "animal")))
_OSI_NAMES = (  # 0 and 1 are unknown and other: a vehicle, no more is said
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
    *(
        "trailer",
        "motorbike",
        "bicycle",
        "bus",
        "tram",
        "train",
        "wheelchair",
        "semitractor",
        "standup scooter",
    ),
    *("micromobility device", "work machine", "watercraft", "aircraft", "land vehicle"),
)
OSI_VEHICLES = dict(enumerate(_OSI_NAMES))
_LEVELX = ("_tracks.csv", "_tracksMeta.csv", "_recordingMeta.csv")  # their times are frames

DATA_SETS = {
    "argoverse2": DataSet(
        title="Argoverse 2 motion forecasting",
        source="av2-api: av2.datasets.motion_forecasting.data_schema (Track, ObjectState), columns of Parquet; steps are 0.1 s",
        columns=_columns(
            "vehicle=track_id x=position_x y=position_y vx=velocity_x vy=velocity_y heading=heading kind=object_type",
            time=("timestep", 0.1),
        ),
        signs=("scenario_id",),
    ),
    "interaction": DataSet(
        title="INTERACTION",
        source="INTERACTION: vehicle_tracks_*.csv and pedestrian_tracks_*.csv (Zhan et al. 2019, and the README of its tools)",
        columns=_columns(
            "vehicle=track_id x=x y=y vx=vx vy=vy heading=psi_rad length=length width=width kind=agent_type",
            time=("timestamp_ms", 1e-3),
        ),
        signs=("frame_id",),
    ),
    "ind": DataSet(
        title="inD, rounD",
        source="inD, rounD: format pages of the data sets (Bock et al. 2020, Krajewski et al. 2020); frame rate in recordingMeta",
        columns=_columns(
            "vehicle=trackId time=frame x=xCenter y=yCenter vx=xVelocity vy=yVelocity length=length width=width",
            heading=("heading", math.pi / 180.0),
        ),
        companions=_LEVELX,
    ),
    "highd": DataSet(
        title="highD",
        source="highD: format page (Krajewski et al. 2018): x, y the upper left corner, y down, width along the road",
        columns=_columns(
            "vehicle=id time=frame x=x y=y vx=xVelocity vy=yVelocity length=width width=height"
        ),
        companions=_LEVELX,
        image=True,
        signs=("laneId",),
    ),
    "omega_prime": DataSet(
        title="omega-prime",
        source="omega-prime 0.3.7: omega_prime.schemas, columns of CSV and Parquet; numbers of types: OSI 3.8, MovingObject",
        columns=_columns(
            "vehicle=idx x=x y=y vx=vel_x vy=vel_y heading=yaw length=length width=width kind=type subkind=subtype",
            time=("total_nanos", 1e-9),
        ),
        names={
            "kind": {str(number): name for number, name in OSI_TYPES.items()},
            "subkind": {"-1": "vehicle"}
            | {str(number): name for number, name in OSI_VEHICLES.items()},
        },
        optional=frozenset(("vx", "vy", "heading", "length", "width", "subkind")),
    ),
}
"""By their names in the parameter `format`."""

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The columns of public data sets, by quantity, with their units; and their recognition.

Positions are those of the centre of the bounding box, except in highD, which has its upper left
corner; headings are counter-clockwise from +x.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from scenario_gen.base.errors import needs

_INTERACTION = "interaction"
_PEDESTRIAN_COLUMNS = {"track_id", "timestamp_ms", "agent_type"}


@dataclass(frozen=True)
class Companions:
    """Suffixes of the three files of a recording: tracks, classes, frame rate."""

    tracks: str
    classes: str
    frame_rate: str


@dataclass(frozen=True)
class DataSet:
    """How a data set writes its tracks.

    Attributes:
        title: for people.
        source: its definition.
        columns: by quantity, as in the parameter `columns`; `subkind` refines the kind "vehicle".
        optional: quantities that a file may lack.
        companions: suffixes, if a recording has three files.
        is_image_frame: y increases downwards, and positions are corners (highD).
        signs: further columns that distinguish the data set from others.
    """

    title: str
    source: str
    columns: Mapping[str, str]
    companions: Companions | None = None
    is_image_frame: bool = False
    signs: tuple[str, ...] = ()
    optional: frozenset[str] = frozenset()

    @property
    def needed(self) -> frozenset[str]:
        """The columns that a file must have."""
        required = (
            column_name(text)
            for quantity, text in self.columns.items()
            if quantity not in self.optional
        )
        return frozenset((*required, *self.signs))


def column_name(text: str) -> str:
    """Return the name of a column that is written as in the parameter `columns`."""
    return text.partition(":")[0]


def _columns(text: str) -> dict[str, str]:
    """Return columns by quantity, of a text `x=xCenter y=yCenter`."""
    return dict(part.split("=") for part in text.split())


_OSI_TYPES = "unknown0+other1+vehicle2+pedestrian3+animal4"
_OSI_VEHICLES = (
    "vehicle0+vehicle1+small_car2+compact_car3+car4+luxury_car5+delivery_van6+heavy_truck7+"
    "semitrailer8+trailer9+motorbike10+bicycle11+bus12+tram13+train14+wheelchair15+semitractor16+"
    "standup_scooter17+micromobility_device18+work_machine19+watercraft20+aircraft21+"
    "land_vehicle22"
)
_LEVELX = Companions("_tracks.csv", "_tracksMeta.csv", "_recordingMeta.csv")


DATA_SETS = {
    "argoverse2": DataSet(
        title="Argoverse 2 motion forecasting",
        source="av2-api: av2.datasets.motion_forecasting.data_schema (Track, ObjectState); "
        "steps of 0.1 s",
        columns=_columns(
            "vehicle=track_id time=timestep:10fps x=position_x y=position_y vx=velocity_x "
            "vy=velocity_y heading=heading kind=object_type"
        ),
        signs=("scenario_id",),
    ),
    "interaction": DataSet(
        title="INTERACTION",
        source="Zhan et al. 2019, and the README of INTERACTION's tools",
        columns=_columns(
            "vehicle=track_id time=timestamp_ms x=x y=y vx=vx vy=vy heading=psi_rad "
            "length=length width=width kind=agent_type scene=case_id"
        ),
        signs=("frame_id",),
        optional=frozenset(("scene",)),
    ),
    "ind": DataSet(
        title="inD, rounD",
        source="format pages of inD and rounD (Bock et al. 2020, Krajewski et al. 2020)",
        columns=_columns(
            "vehicle=trackId time=frame x=xCenter y=yCenter vx=xVelocity vy=yVelocity "
            "length=length width=width heading=heading:deg"
        ),
        companions=_LEVELX,
    ),
    "highd": DataSet(
        title="highD",
        source="format page of highD (Krajewski et al. 2018): width is along the road",
        columns=_columns(
            "vehicle=id time=frame x=x y=y vx=xVelocity vy=yVelocity length=width width=height"
        ),
        companions=_LEVELX,
        is_image_frame=True,
        signs=("laneId",),
    ),
    "omega_prime": DataSet(
        title="omega-prime",
        source="omega-prime 0.3.7, omega_prime.schemas; types by OSI 3.8, MovingObject",
        columns=_columns(
            "vehicle=idx time=total_nanos:ns x=x y=y vx=vel_x vy=vel_y heading=yaw "
            f"length=length width=width kind=type:{_OSI_TYPES} subkind=subtype:{_OSI_VEHICLES}"
        ),
        optional=frozenset(("vx", "vy", "heading", "length", "width", "subkind")),
    ),
}
"""By their names in the parameter `log.format`."""


def recognised(path: Path) -> str:
    """Return the name of the data set of a file, or of its tracks; "" if unknown."""
    for data_set in DATA_SETS.values():
        if data_set.companions and is_companion(path, data_set.companions):
            tracks = companion(path, data_set.companions, data_set.companions.tracks)
            return recognised(tracks) if tracks.is_file() else ""
    names = header_of(path)
    if has_pedestrians(path, _INTERACTION) and names >= _PEDESTRIAN_COLUMNS:
        return _INTERACTION
    return next((name for name, known in DATA_SETS.items() if known.needed <= names), "")


def header_of(path: Path) -> set[str]:
    """Return the column names of a CSV or Parquet file; none of other or damaged files."""
    suffix = path.suffix.lower()
    if suffix == ".csv":
        with path.open(encoding="utf-8-sig", errors="replace") as file:
            return {field.strip() for field in file.readline().split(",")}
    if suffix != ".parquet":
        return set()
    needs("parquet", "pyarrow")
    from pyarrow import parquet

    try:
        return set(parquet.read_schema(path).names)
    except Exception:  # the reader of tables reports the damage
        return set()


def is_companion(path: Path, companions: Companions) -> bool:
    """Return whether a file belongs to a file of tracks."""
    return path.name.endswith((companions.classes, companions.frame_rate))


def companion(path: Path, companions: Companions, suffix: str) -> Path:
    """Return the file of the same recording with another suffix."""
    name = path.name
    for known in (companions.tracks, companions.classes, companions.frame_rate):
        name = name.removesuffix(known)
    return path.with_name(name + suffix)


def has_pedestrians(path: Path, name: str) -> bool:
    """Return whether a file has pedestrians only, which have separate files in INTERACTION."""
    return name == _INTERACTION and path.name.startswith("pedestrian_tracks")

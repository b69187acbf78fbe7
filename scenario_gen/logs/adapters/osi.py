# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Traces of ASAM OSI in MCAP files, as omega-prime writes them: moving objects of GroundTruth.

| quantity | field | unit |
|---|---|---|
| vehicle | moving_object.id.value | |
| class | moving_object.type; vehicle_classification.type | |
| length, width | base.dimension.length, width | m |
| time | timestamp.seconds, nanos | s, ns |
| position | base.position.x, y; the middle of the bounding box | m |
| heading | base.orientation.yaw | rad, counter-clockwise from +x |
| speed | base.velocity.x, y | m/s |

Coordinates are not projected: `proj_string` is not applied. The messages become omega-prime's
table, which is read as in `data_sets.DATA_SETS`.

Source: OSI 3.8, osi_groundtruth.proto and osi_object.proto.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
import math
from pathlib import Path
from typing import Any

import betterosi
import pandas as pd

from scenario_gen.bags.storage.config import BagConfig, ReadBudget
from scenario_gen.bags.storage.mcap import DamagedError, McapFile, open_mcap
from scenario_gen.base.documents import shown
from scenario_gen.base.errors import guarded, InputError
from scenario_gen.logs.adapters import tracks
from scenario_gen.logs.adapters.data_sets import DataSet
from scenario_gen.logs.adapters.osi_lights import LightTrace
from scenario_gen.logs.config import listed, LogConfig
from scenario_gen.logs.raw import check_size, RawLog
from scenario_gen.numerics import NS_PER_S

_MESSAGE_TYPES = ("osi3.GroundTruth", "GroundTruth")
_MAX_STAMP_S = 9_000_000_000  # in 64 bits of nanoseconds
_COLUMNS = [
    "total_nanos",
    "idx",
    "x",
    "y",
    "vel_x",
    "vel_y",
    "yaw",
    "length",
    "width",
    "type",
    "subtype",
]
Row = tuple[int, str, float, float, float, float, float, float, float, int, int]


def read(paths: Sequence[Path], config: LogConfig) -> RawLog:
    """Read the moving objects of one trace.

    Raises:
        InputError: the file is damaged or too large, has no GroundTruth messages, or an object
            has no id or position; names the message.
    """
    trailers: dict[str, str] = {}
    lights = LightTrace()
    log = tracks.read(paths, config, name="omega_prime", load=partial(_table, trailers, lights))
    vehicles = tuple(
        replace(vehicle, trailer_name=trailers.get(vehicle.id, "")) for vehicle in log.vehicles
    )
    notes: list[str] = []
    are_read = config.signals == "recorded"
    signals = tuple(lights.signals(str(paths[0]), notes)) if are_read else ()
    return replace(log, vehicles=vehicles, notes=(*log.notes, *notes), signals=signals)


def _table(
    trailers: dict[str, str],
    lights: LightTrace,
    path: Path,
    _: DataSet,
    rows_before: int,
    config: LogConfig,
) -> pd.DataFrame:
    """Return the moving objects as omega-prime's table; without velocities if none has any.

    Trailers are added to `trailers`, by the ids of their vehicles, and traffic lights to `lights`.
    """
    rows: list[Row] = []
    first_offset: Any = None
    for number, message in enumerate(_messages(path, config), 1):
        place = f"{path}, message {number}"
        offset = _frame_offset(message)
        first_offset = offset if number == 1 else first_offset
        if offset != first_offset:
            raise InputError(
                f"{place}: its proj_frame_offset differs from that of the first message; only one "
                "frame can be read"
            )
        rows += _rows(message, place)
        stamp = message.timestamp
        lights.add(message, stamp.seconds * NS_PER_S + stamp.nanos)
        for moving in message.moving_object:
            kind = moving.vehicle_classification
            if kind is not None and kind.trailer_id:
                trailers[str(moving.id.value)] = str(kind.trailer_id.value)
        check_size(str(path), 0, rows_before + len(rows), config)
    if not rows:
        raise InputError(f"{path}: none of its messages has a moving object")
    frame = pd.DataFrame(rows, columns=pd.Index(_COLUMNS))
    return frame.drop(columns=["vel_x", "vel_y"]) if frame["vel_x"].isna().all() else frame


def _decoded(data: bytes, source: str) -> Any:
    with guarded(f"{source} is not a GroundTruth"):
        return betterosi.GroundTruth.from_binary(data)


def _messages(path: Path, config: LogConfig) -> Iterator[Any]:
    """Yield the GroundTruth messages of one channel by their stamps in the file."""
    size = path.stat().st_size
    check_size(str(path), size, 0, config)
    bounds = BagConfig(most_bytes=config.size_limit << 20)
    budget = ReadBudget(bounds, str(path), size, "log.size_limit")
    try:
        with path.open("rb") as stream:
            file = open_mcap(stream, size, budget)
            channel = _channel(file, path, config)
            for number, logged in enumerate(file.messages([channel]), 1):
                budget.spend_message(len(logged.data))
                yield _decoded(logged.data, f"{path}, message {number}")
    except DamagedError as error:
        raise InputError(f"{path}: cut off or damaged at {error}; copy it again") from error


def _channel(file: McapFile, path: Path, config: LogConfig) -> int:
    """Return the id of the only GroundTruth channel, or of the one that `topics` names.

    Raises:
        InputError: there is none, or several.
    """
    topics = file.list_topics()
    known = [t for t in topics if t.type in _MESSAGE_TYPES and t.encoding == "protobuf"]
    wanted = listed(config.topics)
    chosen = [topic for topic in known if not wanted or topic.name in wanted]
    if len(chosen) == 1:
        return chosen[0].id
    listing = ", ".join(f"{shown(topic.name)} ({shown(topic.type)})" for topic in known or topics)
    remedy = "choose one with --set log.topics=…" if known else "one of osi3.GroundTruth is needed"
    raise InputError(f"{path} has {listing or 'no topics'}; {remedy}")


def _frame_offset(message: Any) -> tuple[float, float, float] | None:
    """Return x, y [m] and yaw [rad] of a message's frame in its projection; None if unknown."""
    offset = message.proj_frame_offset
    if offset is None:
        return None
    position = offset.position
    if position is None:
        return 0.0, 0.0, offset.yaw
    return position.x, position.y, offset.yaw


def _rows(message: Any, place: str) -> Iterator[Row]:
    """Yield a row for each moving object of a message.

    Raises:
        InputError: the message has no valid stamp, or an object has no id or position.
    """
    stamp = message.timestamp
    if stamp is None or not 0 <= stamp.seconds < _MAX_STAMP_S:
        problem = "no timestamp" if stamp is None else f"a timestamp of {stamp.seconds} s"
        raise InputError(f"{place}: {problem}; 0 to 9e9 s can be read")
    nanoseconds = stamp.seconds * NS_PER_S + stamp.nanos
    for number, moving in enumerate(message.moving_object, 1):
        base = moving.base
        if moving.id is None or base is None or base.position is None:
            missing = "id" if moving.id is None else "base.position"
            raise InputError(f"{place}: moving object {number} has no {missing}")
        kind = moving.vehicle_classification
        velocity_x, velocity_y = _fields(base.velocity, "x", "y")
        (yaw,) = _fields(base.orientation, "yaw")
        length, width = _fields(base.dimension, "length", "width")
        yield (
            nanoseconds,
            str(moving.id.value),
            base.position.x,
            base.position.y,
            velocity_x,
            velocity_y,
            yaw,
            length,
            width,
            int(moving.type),
            0 if kind is None else int(kind.type),
        )


def _fields(part: Any, *names: str) -> tuple[float, ...]:
    """Return fields of a part of an object; NaN if the part is missing."""
    return tuple(math.nan if part is None else getattr(part, name) for name in names)

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The final check of a reading: each vehicle is compared with its raw data, stretch by stretch."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from scenario_gen.logs.cleaning import Drops
from scenario_gen.logs.columns import with_columns
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.encounters import Piece
from scenario_gen.logs.quality import Doubt, Quantity
from scenario_gen.logs.raw import RawLog
from scenario_gen.numerics import ahead_and_left, Bools, Floats, runs
from scenario_gen.types import Encounter, together


@dataclass(frozen=True)
class CheckLimits:
    """Bounds beyond which the result of reading is in doubt.

    Attributes:
        moved_m: distance of fixes from the smooth motion; an abrupt start moves them by 3 m.
        moved_noise_factor: the same over the noise of the fixes.
        min_stretch_s: shorter stretches are outliers, which smoothing is there for.
        min_stretch_count: fixes of a stretch.
        lost_rows_share: rows of a vehicle whose stamps repeat in other places.
        lost_rows_count: the same as a number.
        rigid_m: change of the distance of two positions on one vehicle.
        min_travel_m: vehicles that drive less may be near each other.
        copy_lengths_ratio: farthest distance of two positions on one vehicle, over its length.
    """

    moved_m: float = 5.0
    moved_noise_factor: float = 6.0
    min_stretch_s: float = 1.0
    min_stretch_count: int = 4
    lost_rows_share: float = 0.1
    lost_rows_count: int = 5
    rigid_m: float = 1.0
    min_travel_m: float = 10.0
    copy_lengths_ratio: float = 0.8


_LIMITS = CheckLimits()


def doubts_of_pieces(pieces: Sequence[Piece], origin_ns: int) -> Iterator[Doubt]:
    """Yield doubts about stretches that differ from the raw fixes, and about unused speeds."""
    for piece in pieces:
        smooth = piece.smooth
        fix_s = (piece.track.fix_ns - origin_ns).astype(np.float64) * 1e-9
        limit = max(_LIMITS.moved_m, _LIMITS.moved_noise_factor * smooth.noise)
        for start, end, distance in _stretches(fix_s, smooth.moved > limit, smooth.moved):
            yield Doubt(
                Quantity.POSITION,
                distance,
                f"the motion of a car that fits best is up to {distance:.1f} m off the fixes",
                "check the time column and the units",
                piece.track.id,
                start,
                end,
                "m",
            )
        speed_s = (piece.track.speed_ns - origin_ns).astype(np.float64) * 1e-9
        for start, end, difference in _stretches(speed_s, ~smooth.believed, np.abs(smooth.before)):
            yield Doubt(
                Quantity.SPEED,
                difference,
                "speed column ignored, since it contradicts the positions by up to "
                f"{difference:.1f} m/s",
                "",
                piece.track.id,
                start,
                end,
                "m/s",
                stops=False,
            )


def _stretches(
    seconds: Floats, are_off: Bools, sizes: Floats
) -> Iterator[tuple[float, float, float]]:
    """Yield start, end and largest size of the stretches (T,) that are off for long."""
    for begin, end in runs(are_off):
        duration = seconds[end - 1] - seconds[begin]
        if end - begin >= _LIMITS.min_stretch_count and duration >= _LIMITS.min_stretch_s:
            largest = float(sizes[begin:end].max())
            yield float(seconds[begin]), float(seconds[end - 1]), largest


def doubts_of_rows(log: RawLog, drops: Drops, config: LogConfig) -> Iterator[Doubt]:
    """Yield doubts about vehicles that are at several places at one time, by their stamps."""
    counts: Counter[str] = Counter()
    for vehicle in log.vehicles:
        counts[vehicle.id] += len(vehicle.fix_ns)
    for name, conflict in drops.conflicts.items():
        share = conflict.count / max(counts[name], 1)
        if share < _LIMITS.lost_rows_share or conflict.count < _LIMITS.lost_rows_count:
            continue
        fact = f"{conflict.count} of {counts[name]} rows have the stamp of another row"
        if conflict.is_coarse:
            cause = f"{fact} and follow its path: the clock is too coarse"
            remedy = "record the time with decimals, or name another column for it"
        else:
            cause = f"{fact} at another place: several vehicles or scenes share this id"
            remedy = "name the column that tells them apart: --set log.columns=scene=…"
            if log.separators:
                remedy = with_columns(config.columns, {"scene": log.separators[0]})
        yield Doubt(Quantity.ROWS, share, cause, remedy, name)


def copies_in(encounters: Sequence[Encounter]) -> dict[str, Doubt]:
    """Return vehicles that move with another one throughout, as two sensors on a vehicle do."""
    copies: dict[str, Doubt] = {}
    for encounter in encounters:
        names = [vehicle.id for vehicle in encounter.vehicles]
        for first, second in combinations(range(len(names)), 2):
            if names[first] in copies or names[second] in copies:
                continue
            distance = _rigid_distance(encounter, first, second)
            if distance is None:
                continue
            cause = (
                f"never farther than {distance:.1f} m from {names[first]} and turns with it: both "
                "are read as one vehicle"
            )
            copies[names[second]] = Doubt(
                Quantity.VEHICLE, distance, cause, vehicle=names[second], unit="m", stops=False
            )
    return copies


def _rigid_distance(encounter: Encounter, a: int, b: int) -> float | None:
    """Return the largest distance [m] of two vehicles that move as one body, else None."""
    vehicles = (encounter.vehicles[a], encounter.vehicles[b])
    if any(vehicle.kind.walks for vehicle in vehicles):
        return None
    common = together(encounter.present, a, b)
    offset = encounter.position[b, common] - encounter.position[a, common]
    reach = _LIMITS.copy_lengths_ratio * min(vehicle.length for vehicle in vehicles)
    if not len(offset) or np.hypot(*offset.T).max() > reach:
        return None
    along, across = ahead_and_left(offset, encounter.heading[a, common])
    if np.median(np.abs(across)) > min(vehicle.width for vehicle in vehicles):
        return None  # abreast
    driven = float(encounter.speed[a, common].sum() * encounter.dt)
    spread = max(float(np.ptp(np.percentile(axis, [5.0, 95.0]))) for axis in (along, across))
    if driven < _LIMITS.min_travel_m or spread > _LIMITS.rigid_m:
        return None
    return float(np.hypot(along, across).max())

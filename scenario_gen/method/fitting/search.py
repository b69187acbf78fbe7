# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Placing a recording anywhere on a grid: the similarity that gives its footprints the most room.

The search is deterministic, from coarse to fine. First, all translations of each rotation
are tried at once: the cost of a placement is the correlation of a penalty field (the missing
clearance) with the rasterised recorded paths, computed by FFT. Then the best few are refined by a
pattern search on the fine field. The recording moves as one piece, so all meetings are kept.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
import math
from typing import NamedTuple

import numpy as np
from scipy.signal import correlate

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting.config import FittingConfig
from scenario_gen.method.fitting.placement import Placement
from scenario_gen.numerics import Floats, frozen, place
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.pattern_search import pattern_search
from scenario_gen.roads import max_repair, share_with_room
from scenario_gen.situation import separate, Track
from scenario_gen.types import Note, NoteKind, Road

_COARSE_CELL_M = 1.0
_ROTATION_COUNT = 72
_DISC_SPACING_M = 1.5  # along a path
_MIN_ROOM_SHARE = 0.8  # of footprints with room
_COMFORT_M = 0.7  # of room beyond the margin that is preferred
_COST_UNIT_COUNT = 2**20  # units of cost per 1, so that sums of costs are whole numbers


class _Similarity(NamedTuple):
    """A rotation [rad] about the recording's centre, its place x, y [m] on the map, and a scale.

    They are ordered by cost.
    """

    cost: float
    yaw: float
    x: float
    y: float
    scale: float

    def note(self, road: Road) -> Note:
        """Return the note on a placement by it."""
        return Note.of(
            NoteKind.AS_ONE_PIECE,
            road=road.name,
            degrees=np.degrees(self.yaw) % 360.0,
            scale=self.scale,
            x=self.x,
            y=self.y,
        )


def place_by_search(tracks: tuple[Track, ...], road: Road, config: FittingConfig) -> Placement:
    """Return the best rigid placement on the map; other scales are tried if scale 1 fails.

    Raises:
        RefusedError: no placement gives (almost) all footprints room.
    """
    search = _GridSearch.of(tracks, road, config)
    least_repair, best = math.inf, None
    reason = f"the recording ({np.ptp(search.discs, axis=0).max():.0f} m) is larger than the map"
    for similarity in search.candidates(config):
        stop_if_cancelled()
        moved = search.moved(tracks, similarity)
        try:
            separation = separate(moved, config.clearance, config.max_move)
            placement = Placement.separated(separation, similarity.scale, [similarity.note(road)])
            repair = max_repair(placement.tracks, road, config.max_move)
        except RefusedError as error:
            reason = str(error)
            continue
        share = min(share_with_room(road, track) for track in placement.tracks)
        if share == 1.0:
            return placement
        if share >= _MIN_ROOM_SHARE and repair < least_repair:
            least_repair, best = repair, placement
        elif best is None:
            reason = (
                "in the best placement a vehicle has room at only "
                f"{100.0 * share:.0f} % of its samples"
            )
    if best is None:
        raise RefusedError(
            f"no placement on road {road.name} has room for the recording: {reason}"
        )
    return best


@dataclass(frozen=True, eq=False)
class _GridSearch:
    """The search for similarities on a grid.

    Attributes:
        discs: (P, 2) [m] centres of discs that cover the swept footprints, about their mean.
        centre: (2,) [m] that mean in the recording.
        required: [m] the clearance that each disc needs.
        road: the grid.
    """

    discs: Floats
    centre: Floats
    required: float
    road: Road

    @classmethod
    def of(cls, tracks: tuple[Track, ...], road: Road, config: FittingConfig) -> "_GridSearch":
        """Return the search for a recording."""
        points = []
        for track in tracks:
            third = track.vehicle.length / 3.0
            count = int(np.ceil((track.travelled + 2.0 * third) / _DISC_SPACING_M)) + 1
            stations = np.linspace(-third, track.travelled + third, count)
            points.append(track.curve.at(stations)[:, :2])
        discs = np.concatenate(points)
        centre = discs.mean(axis=0)
        required = max(track.vehicle.width for track in tracks) / 2.0 + config.margin
        return cls(discs - centre, centre, required, road)

    def candidates(self, config: FittingConfig) -> Iterator[_Similarity]:
        """Yield the best similarities with each accepted scale, the best first."""
        for scale in config.place_limits.scales:
            yield from sorted(map(self._refined, sorted(self._coarse(scale))[:10]))

    def moved(self, tracks: tuple[Track, ...], similarity: _Similarity) -> tuple[Track, ...]:
        """Return tracks on the map."""
        pose = np.array([similarity.x, similarity.y, similarity.yaw])
        moved = []
        for track in tracks:
            points = track.curve.points.copy()
            points[:, :2] = place(pose, *(similarity.scale * (points[:, :2] - self.centre)).T)
            points[:, 2] += similarity.yaw
            progress = frozen(similarity.scale * track.progress)
            moved.append(replace(track, curve=Curve(points), progress=progress))
        return tuple(moved)

    def _penalty(self, clearance: Floats) -> Floats:
        """Return the squared share of missing clearance, and a little for missing comfort."""
        missing = np.maximum(self.required - clearance, 0.0)
        uncomfortable = np.maximum(self.required + _COMFORT_M - clearance, 0.0)
        squared = np.square(missing) + 0.02 * np.square(uncomfortable)
        return np.asarray(squared / np.square(self.required))

    @property
    def _stride(self) -> int:
        """Cells of the grid per coarse cell."""
        return max(round(_COARSE_CELL_M / self.road.resolution), 1)

    def _coarse_field(self) -> Floats:
        """Return (H, W) the penalty in coarse cells, less that of blocked cells.

        It is in whole units of cost. Space outside the map counts as blocked, and is zero.
        """
        every = slice(self._stride // 2, None, self._stride)
        field = self._penalty(self.road.clearance_at(every, every))
        blocked = float(self._penalty(np.zeros(1))[0])
        return np.asarray(np.round((field - blocked) * _COST_UNIT_COUNT))

    def _coarse(self, scale: float) -> Iterator[_Similarity]:
        """Yield the best translation of each rotation."""
        field = self._coarse_field()
        cell = self._stride * self.road.resolution
        for yaw in np.arange(_ROTATION_COUNT) * 2.0 * np.pi / _ROTATION_COUNT:
            points = place(np.array([0.0, 0.0, yaw]), *(scale * self.discs).T)
            index = np.floor(points / cell + 0.5).astype(np.int64)
            low, size = index.min(axis=0), np.ptp(index, axis=0) + 1
            if size[0] > field.shape[1] or size[1] > field.shape[0]:
                continue
            kernel = np.zeros((size[1], size[0]))
            np.add.at(kernel, (index[:, 1] - low[1], index[:, 0] - low[0]), 1.0)
            # The sums are whole numbers: rounding removes what depends on the CPU.
            total = np.round(correlate(field, kernel, "valid", "fft"))
            row, column = np.unravel_index(int(np.argmin(total)), total.shape)
            cost = float(np.round(total[row, column] / (_COST_UNIT_COUNT * len(points)), 9))
            first = (self._stride // 2 + 0.5) * self.road.resolution
            centre = self.road.origin + np.array([column - low[0], row - low[1]]) * cell + first
            yield _Similarity(cost, float(yaw), float(centre[0]), float(centre[1]), scale)

    def _refined(self, coarse: _Similarity) -> _Similarity:
        """Return the best similarity near one, with the same scale."""

        def costs(states: Floats) -> Floats:
            points = place(states[:, None], *(coarse.scale * self.discs).T)
            row, column, inside = self.road.cells(points)
            clearance = np.where(inside, self.road.clearance_at(row, column), 0.0)
            return np.asarray(self._penalty(clearance).mean(axis=1))

        start = np.array([[coarse.x, coarse.y, coarse.yaw]])
        steps = np.array([1.0, 1.0, np.radians(3.0)])
        states, (cost,) = pattern_search(costs, start, steps, 0.05)
        x, y, yaw = states[0].tolist()
        return _Similarity(float(cost), yaw, x, y, coarse.scale)

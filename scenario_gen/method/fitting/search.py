# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Placing a template anywhere on a map: the similarity that gives all its footprints the most room.

Coarse to fine and without chance. First, for each rotation, every translation at once: the cost of a placement is the
correlation of a penalty field (how much clearance is missing) with the template's rasterised paths, computed by FFT.
Then the best few are refined by a pattern search on the fine field. The template moves as one piece, so who meets whom,
where and when, is kept.
"""

from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting.config import FittingConfig
from scenario_gen.method.fitting.placement import (
    max_repair,
    Placement,
    SCALES,
    separated,
    share_with_room,
)
from scenario_gen.numerics import Floats, frozen
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.pattern_search import pattern_search
from scenario_gen.numerics.plane import place
from scenario_gen.roads import clearance_field
from scenario_gen.situation import Track
from scenario_gen.types import (
    Note,
    NoteKind,
    Road,
)

_CELL = 1.0  # metres of the coarse search
_TURNS = 72
_KEPT = 10  # coarse placements that are refined
_SPACING = 1.5  # metres between the path's sampled discs
_MOSTLY = 0.8  # share of footprints with room below which a placement is no good
_COMFORT = 0.7  # metres of room beyond the margin that are worth having
_WHOLE = 2**20  # costs are counted in units of 1 / _WHOLE


@dataclass(frozen=True, eq=False)
class _Motion:
    """A similarity: scale, rotation about the template's centre, where the centre goes."""

    cost: float
    scale: float
    yaw: float
    at: tuple[float, float]


def place_by_search(tracks: tuple[Track, ...], road: Road, config: FittingConfig) -> Placement:
    """Find the best rigid placement on the map (at other scales only if there is none at scale 1).

    Raises:
        RefusedError: no placement gives (almost) all footprints room.
    """
    discs, centre = _discs(tracks)
    required = max(t.vehicle.width for t in tracks) / 2.0 + config.margin
    best: tuple[float, Placement] | None = None
    reason = f"the recording ({np.ptp(discs, axis=0).max():.0f} m) is larger than the map"
    for scale in filter(config.accepts, SCALES):
        placements = sorted(_coarse(discs, road, required, scale), key=_order)[:_KEPT]
        for motion in sorted(
            (_refined(discs, road, required, motion) for motion in placements), key=_order
        ):
            stop_if_cancelled()
            try:
                placement, share, farthest = _tried(tracks, centre, motion, road, config)
            except RefusedError as error:
                reason = str(error)
                continue
            if share == 1.0:
                return placement
            if share >= _MOSTLY and (best is None or farthest < best[0]):
                best = farthest, placement
            elif best is None:
                reason = f"in the best placement a vehicle has room at only {100.0 * share:.0f} % of its samples"
    if best is None:
        raise RefusedError(
            f"no placement on road {road.name} has room for the recording: {reason}"
        )
    return best[1]


def _order(motion: _Motion) -> tuple[float, float, tuple[float, float]]:
    return motion.cost, motion.yaw, motion.at


def _tried(
    tracks: tuple[Track, ...], centre: Floats, motion: _Motion, road: Road, config: FittingConfig
) -> tuple[Placement, float, float]:
    """The placement of one similarity, the share of its footprints that have room, the farthest repair [m]."""
    note = Note.of(
        NoteKind.AS_ONE_PIECE,
        road=road.name,
        degrees=np.degrees(motion.yaw) % 360.0,
        scale=motion.scale,
        x=motion.at[0],
        y=motion.at[1],
    )
    as_laid = Placement.of(_moved(tracks, centre, motion), motion.scale, [note])
    placement = separated(as_laid, config, sideways=1.0)
    share = float(min(share_with_room(road, track) for track in placement.tracks))
    return placement, share, max_repair(placement.tracks, road, config.max_move)


def _discs(tracks: tuple[Track, ...]) -> tuple[Floats, Floats]:
    """(P, 2) centres of discs that cover the swept footprints, relative to their mean; and that mean."""
    points = []
    for track in tracks:
        third = track.vehicle.length / 3.0
        count = int(np.ceil((track.travelled + 2.0 * third) / _SPACING)) + 1
        points.append(track.curve.at(np.linspace(-third, track.travelled + third, count))[:, :2])
    everything = np.concatenate(points)
    centre = everything.mean(axis=0)
    return everything - centre, centre


def _penalty(clearance: Floats, required: float) -> Floats:
    """Missing clearance squared; a little of it also for room that would be nice to have."""
    return np.asarray(
        np.square(np.maximum(required - clearance, 0.0)) / np.square(required)
        + 0.02 * np.square(np.maximum(required + _COMFORT - clearance, 0.0)) / np.square(required)
    )


def _coarse(discs: Floats, road: Road, required: float, scale: float) -> list[_Motion]:
    """The best translation of each rotation."""
    every = max(round(_CELL / road.resolution), 1)
    cell = every * road.resolution
    field = _penalty(clearance_field(road)[every // 2 :: every, every // 2 :: every], required)
    field = field - float(
        _penalty(np.zeros(1), required)[0]
    )  # outside the map counts as blocked: make that the zero of the sum
    whole = np.fft.rfft2(np.round(field * _WHOLE))
    best = []
    for yaw in np.arange(_TURNS) * 2.0 * np.pi / _TURNS:
        points = place(np.array([0.0, 0.0, yaw]), *(scale * discs).T)
        index = np.floor(points / cell + 0.5).astype(np.int64)
        low, size = index.min(axis=0), np.ptp(index, axis=0) + 1
        if size[0] > field.shape[1] or size[1] > field.shape[0]:
            continue
        kernel = np.zeros((size[1], size[0]))
        np.add.at(kernel, (index[:, 1] - low[1], index[:, 0] - low[0]), 1.0)
        # Of whole numbers: the transform's rounding, which depends on the CPU, is rounded away.
        product = np.fft.irfft2(whole * np.fft.rfft2(kernel[::-1, ::-1], field.shape), field.shape)
        total = np.round(product[size[1] - 1 :, size[0] - 1 :])
        cost = total / (_WHOLE * len(points))
        row, column = np.unravel_index(int(np.argmin(total)), total.shape)
        grid = (
            np.array([column - low[0], row - low[1]]) * cell + (every // 2 + 0.5) * road.resolution
        )
        at = np.asarray(road.origin) + grid
        best.append(
            _Motion(
                float(np.round(cost[row, column], 9)),
                scale,
                float(yaw),
                (float(at[0]), float(at[1])),
            )
        )
    return best


def _refined(discs: Floats, road: Road, required: float, motion: _Motion) -> _Motion:
    """The best similarity near one, of the same scale."""

    def costs(states: Floats) -> Floats:
        row, column, inside = road.cells(place(states[:, None], *(motion.scale * discs).T))
        return np.asarray(
            _penalty(np.where(inside, clearance_field(road)[row, column], 0.0), required).mean(
                axis=1
            )
        )

    state, cost = pattern_search(
        costs, np.array([*motion.at, motion.yaw]), np.array([1.0, 1.0, np.radians(3.0)]), 0.05
    )
    return _Motion(cost, motion.scale, float(state[2]), (float(state[0]), float(state[1])))


def _moved(tracks: tuple[Track, ...], centre: Floats, motion: _Motion) -> tuple[Track, ...]:
    moved = []
    for track in tracks:
        points = track.curve.points.copy()
        points[:, :2] = place(
            np.array([*motion.at, motion.yaw]), *(motion.scale * (points[:, :2] - centre)).T
        )
        points[:, 2] += motion.yaw
        moved.append(
            replace(track, curve=Curve(points), progress=frozen(motion.scale * track.progress))
        )
    return tuple(moved)

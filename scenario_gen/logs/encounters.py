# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""From clean tracks to smooth pieces: tracks are cut at long gaps, relocations and reversals."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
import math

import numpy as np

from scenario_gen.logs.cleaning import CLEANING, select
from scenario_gen.logs.config import LogConfig, points_ahead
from scenario_gen.logs.quality import VehicleQuality
from scenario_gen.logs.raw import Observations
from scenario_gen.logs.smoothing import (
    interpolated_piece,
    Smooth,
    smooth_piece,
    speed_of_fixes,
    standing,
)
from scenario_gen.numerics import Bools, edge_lengths, Floats, running_sum, runs, unit
from scenario_gen.smoothing.motion import UnreconciledError
from scenario_gen.types import CAR, OTHER, VEHICLE_TYPES


@dataclass(frozen=True)
class PieceLimits:
    """Bounds on the motion within one piece.

    Attributes:
        min_reversal_rad: change of course in a stop above which the vehicle has reversed, or
            turned on the spot.
        max_tick_count: ticks of a piece; smoothing needs 3 kB for each.
        max_length_m: of a piece; smoothing needs 1.5 kB for each metre.
        max_car_curvature_per_m: no car turns more sharply, including noise.
        curvature_factor: the same for other types, over the sharpest turn of the type.
        min_backward_rad: recorded headings farther off the path are of a vehicle in reverse.
        max_backward_mps: cars are not driven backwards faster; above, the axes are mirrored.
        max_speed_factor: over the highest speed of its type; a faster vehicle has another type.
        course_length_m: length over which the course before and after a stop is measured.
    """

    min_reversal_rad: float = float(np.radians(120.0))
    max_tick_count: int = 100_000
    max_length_m: float = 100_000.0
    max_car_curvature_per_m: float = 0.4
    curvature_factor: float = 1.6
    min_backward_rad: float = float(np.radians(150.0))
    max_backward_mps: float = 5.0
    max_speed_factor: float = 1.2
    course_length_m: float = 3.0


_LIMITS = PieceLimits()
_MAX_CUT_DEPTH_COUNT = 6  # halvings of a part whose path turns too sharply
_COURSE_FIX_COUNT = 64  # fixes that are searched first for a course


@dataclass(frozen=True, eq=False)
class Piece:
    """A vehicle's smooth motion between two long gaps, on the log's common clock."""

    track: Observations
    smooth: Smooth

    @property
    def first(self) -> int:
        """Tick of the first sample."""
        return self.smooth.first

    @property
    def last(self) -> int:
        """Tick after the final sample."""
        return self.smooth.first + len(self.smooth.speed)

    def position(self, first: int, last: int) -> Floats:
        """Return positions (T, 2) [m] from tick `first` to before tick `last`."""
        return self.smooth.position[first - self.first : last - self.first]

    @cached_property
    def height(self) -> Floats | None:
        """Heights (T,) [m] at all ticks; None if they are not recorded."""
        track = self.track
        if track.height is None or not np.isfinite(track.height).any():
            return None
        known = np.isfinite(track.height)
        seconds = (track.fix_ns - track.fix_ns[0])[known] * 1e-9
        ticks = np.linspace(0.0, seconds[-1], len(self.smooth.speed))
        return np.asarray(np.interp(ticks, seconds, track.height[known]))

    def speed(self, first: int, last: int) -> Floats:
        """Return speeds (T,) [m/s] from tick `first` to before tick `last`."""
        return self.smooth.speed[first - self.first : last - self.first]


@dataclass(frozen=True, eq=False)
class _Cuts:
    """Where a track is cut (F-1,): at gaps, at reversals, or to bound the memory.

    Attributes:
        seconds: (F-1,) times between fixes.
        gaps: too long, or too far to drive.
        reversals: stops in which the vehicle reverses.
        any: all cuts.
        bridged: gaps that are filled.
    """

    seconds: Floats
    gaps: Bools
    reversals: Bools
    any: Bools
    bridged: Bools


@dataclass(frozen=True, eq=False)
class CutTrack:
    """A track in parts, each with its motion as recorded; None if it is too short."""

    track: Observations
    cuts: _Cuts
    parts: list[tuple[Observations, Smooth | None]]


def cut_track(track: Observations, origin_ns: int, config: LogConfig) -> CutTrack:
    """Cut a track at gaps, relocations and reversals.

    Gaps of up to two and a half periods of the source are bridged, so that a source of 1 Hz is not
    cut at every fix.
    """
    cuts = _find_cuts(track, config)
    parts = _split(track, cuts.any)
    return CutTrack(
        track, cuts, [(part, interpolated_piece(part, origin_ns, config)) for part in parts]
    )


def pieces_of(
    cut: CutTrack, origin_ns: int, config: LogConfig, *, smooth: bool = True
) -> tuple[list[Piece], VehicleQuality]:
    """Return the parts of a track, smoothed, or as recorded."""
    track = cut.track
    smoothed = [] if smooth else cut.parts
    lost_s = 0.0
    for part, recorded in cut.parts if smooth else ():
        try:
            smoothed += _steerable(part, recorded, origin_ns, config)
        except UnreconciledError:
            smoothed.append((part, None))
            lost_s += float(part.fix_ns[-1] - part.fix_ns[0]) * 1e-9
    ahead = points_ahead(config) if math.isnan(track.ahead) else track.ahead
    ahead *= track.length
    pieces = [
        Piece(part, _moved_ahead(motion, ahead) if ahead else motion)
        for part, motion in smoothed
        if motion is not None
    ]
    extra_reversals = len(smoothed) - len(cut.parts)
    return pieces, _vehicle_quality(track, pieces, cut.cuts, extra_reversals, lost_s, config)


def _find_cuts(track: Observations, config: LogConfig) -> _Cuts:
    """Return where a track is cut."""
    seconds = np.diff(track.fix_ns) * 1e-9
    distance = edge_lengths(track.fix)
    gaps = (seconds > longest_bridge(seconds, config)) | _is_relocation(seconds, distance)
    reversals = np.zeros_like(gaps)
    if not VEHICLE_TYPES[track.kind or CAR].walks:
        edges = [0, *(np.flatnonzero(gaps) + 1).tolist(), len(track.fix_ns)]
        for (begin, end), driven in zip(pairwise(edges), _parts(track, gaps), strict=True):
            if end - begin > 1:  # a clock of ticks over a gap of years would need all memory
                reversals[begin : end - 1] = _reversals(driven, config)
    section = (track.fix_ns - track.fix_ns[0]) // round(
        _LIMITS.max_tick_count * config.period * 1e9
    )
    part = np.floor(running_sum(distance) / _LIMITS.max_length_m)
    usual = float(np.median(seconds))
    return _Cuts(
        seconds=seconds,
        gaps=gaps,
        reversals=reversals,
        any=gaps | reversals | (np.diff(section) > 0) | (np.diff(part) > 0.0),
        bridged=(seconds > 1.5 * max(usual, config.period)) & ~gaps,
    )


def _vehicle_quality(
    track: Observations,
    pieces: Sequence[Piece],
    cuts: _Cuts,
    extra_reversals: int,
    lost_s: float,
    config: LogConfig,
) -> VehicleQuality:
    """Return how well a vehicle was recorded."""
    smooths = [piece.smooth for piece in pieces]

    def rms(name: str) -> float:
        values = np.concatenate([np.zeros(0), *(getattr(smooth, name) for smooth in smooths)])
        return float(np.sqrt(np.square(values).mean())) if len(values) else 0.0

    n_steps = sum(piece.last - piece.first - 1 for piece in pieces)
    return VehicleQuality(
        id=track.id,
        fixes=len(track.fix_ns),
        seconds=n_steps * config.period,
        pieces=len(pieces),
        bridged=int(cuts.bridged.sum()),
        longest_bridged=float(cuts.seconds[cuts.bridged].max(initial=0.0)),
        cut=int(cuts.gaps.sum()),
        longest_cut=float(cuts.seconds[cuts.gaps].max(initial=0.0)),
        reversals=int((cuts.reversals & ~cuts.gaps).sum()) + extra_reversals,
        speed_before=rms("before"),
        moved=rms("moved"),
        noise=max((smooth.noise for smooth in smooths), default=np.nan),
        lost=lost_s,
        smoothed=not pieces or any(len(smooth.moved) for smooth in smooths),
    )


def plausible(pieces: Sequence[Piece], config: LogConfig) -> tuple[list[Piece], list[str]]:
    """Return the pieces driven forwards, with types that suit their motion; and notes."""
    pieces, type_notes = _with_plausible_types(pieces)
    pieces, backward_notes = _driven_forwards(pieces, config)
    return pieces, type_notes + backward_notes


def _with_plausible_types(pieces: Sequence[Piece]) -> tuple[list[Piece], list[str]]:
    """Return the pieces; a vehicle that is too fast for its type becomes `other`, with a note."""
    top_speed: dict[tuple[str, str], float] = {}
    for piece in pieces:
        if not len(piece.smooth.moved):
            continue
        key = piece.track.id, piece.track.kind
        top_speed[key] = max(top_speed.get(key, 0.0), float(piece.smooth.speed.max()))
    too_fast: set[str] = set()
    notes = []
    for (vehicle, kind), speed in top_speed.items():
        if not kind:
            continue
        if speed > _LIMITS.max_speed_factor * VEHICLE_TYPES[kind].dynamics.max_speed:
            too_fast.add(vehicle)
            notes.append(
                f"vehicle {vehicle} is a {kind} in the log but drives {speed:.1f} m/s: "
                f"its type becomes {OTHER}"
            )
    typed = [
        replace(piece, track=replace(piece.track, kind=OTHER))
        if piece.track.id in too_fast
        else piece
        for piece in pieces
    ]
    return typed, notes


def _driven_forwards(pieces: Sequence[Piece], config: LogConfig) -> tuple[list[Piece], list[str]]:
    """Return the pieces without those whose headings are opposite to the path, and notes.

    If most are opposite, the recorded headings are not those of cars, and all pieces stay.
    """
    known = [piece for piece in pieces if len(piece.smooth.turned)]
    backward = [
        piece
        for piece in known
        if np.median(np.abs(piece.smooth.turned)) > _LIMITS.min_backward_rad
        and piece.smooth.speed.max() <= _LIMITS.max_backward_mps
    ]
    if 2 * len(backward) > len(known):
        return list(pieces), []
    notes = [
        f"vehicle {piece.track.id} drives backwards for "
        f"{(piece.last - piece.first) * config.period:.1f} s, by its recorded headings; this part "
        "is left out, since scenarios only drive forwards"
        for piece in backward
    ]
    return [piece for piece in pieces if piece not in backward], notes


def _moved_ahead(smooth: Smooth, distance: float) -> Smooth:
    """Return the motion of a point `distance` [m] ahead; unknown headings are taken as east."""
    heading = np.nan_to_num(smooth.heading)
    return replace(smooth, position=smooth.position + distance * unit(heading))


def _steerable(
    part: Observations,
    recorded: Smooth | None,
    origin_ns: int,
    config: LogConfig,
    depth: int = 0,
) -> list[tuple[Observations, Smooth | None]]:
    """Smooth a part of a track, cut wherever its path turns more sharply than a car can.

    A car cannot turn on the spot: it reversed in a stop that was too short for the fixes.

    Raises:
        UnreconciledError: no motion fits the part, also after many cuts (`depth`).
    """
    if depth > _MAX_CUT_DEPTH_COUNT:
        raise UnreconciledError("the path turns more sharply than a car can, again and again")
    if recorded is None:
        return [(part, None)]
    smooth = smooth_piece(part, recorded, origin_ns, config)
    kind = VEHICLE_TYPES[part.kind or CAR]
    if kind.walks:
        return [(part, smooth)]
    max_curvature = max(
        _LIMITS.max_car_curvature_per_m, _LIMITS.curvature_factor * kind.dynamics.sharpest
    )
    distance = edge_lengths(smooth.position)
    excess = np.abs(np.diff(smooth.heading)) - max_curvature * distance
    if not (excess > 1e-6).any():
        return [(part, smooth)]
    tick = smooth.first + int(np.argmax(excess)) + 0.5
    fix = np.searchsorted(part.fix_ns, origin_ns + round(tick * config.period * 1e9))
    cuts = np.zeros(len(part.fix_ns) - 1, dtype=bool)
    cuts[np.clip(fix, 1, len(cuts)) - 1] = True
    pieces = []
    for half in _split(part, cuts):
        recorded = interpolated_piece(half, origin_ns, config)
        pieces += _steerable(half, recorded, origin_ns, config, depth + 1)
    return pieces


def _is_relocation(seconds: Floats, distance: Floats) -> Bools:
    """Return which steps (F-1,) no vehicle drives that is as fast as just before and after.

    Args:
        seconds: (F-1,) duration of each step.
        distance: (F-1,) its length [m].
    """
    reach = np.full(len(distance), CLEANING.max_speed_mps)
    if len(distance) >= CLEANING.relocation_count:
        rate = np.pad(distance / seconds, 2, mode="edge")
        fastest_near = np.max([rate[:-4], rate[1:-3], rate[3:-1], rate[4:]], axis=0)
        reach = np.minimum(1.5 * fastest_near + CLEANING.jump_slack_mps, reach)
    too_far: Bools = distance > CLEANING.jump_slack_m + reach * seconds
    return too_far


def longest_bridge(seconds: Floats, config: LogConfig) -> float:
    """Return the longest bridged gap [s] in a track whose fixes are `seconds` (F-1,) apart."""
    period = min(float(np.median(seconds)), CLEANING.max_period_s)
    return max(config.longest_gap, 2.5 * period) + 1e-6


def _reversals(track: Observations, config: LogConfig) -> Bools:
    """Return where (F-1,) the vehicle reverses after a stop: its heading would jump."""
    start_ns = track.fix_ns[0]
    seconds = (track.fix_ns - start_ns).astype(np.float64) * 1e-9
    speed_s = (track.speed_ns - start_ns).astype(np.float64) * 1e-9
    speed = track.speed
    if not len(speed):
        speed_s = seconds
        speed = speed_of_fixes(seconds, track.fix)
    n_ticks = max(int(seconds[-1] / config.period), 1) + 1
    ticks = config.period * np.arange(n_ticks, dtype=np.float64)
    cuts = np.zeros(len(seconds) - 1, dtype=bool)
    for begin, end in runs(standing(ticks, seconds, track.fix, speed_s, speed)):
        first, last = np.searchsorted(seconds, (ticks[begin], ticks[end - 1])).tolist()
        before = _course(track.fix[first::-1])
        after = _course(track.fix[last:])
        if before is None or after is None:
            continue
        if float(before @ after) > -np.cos(_LIMITS.min_reversal_rad):
            cuts[min((first + last) // 2, len(cuts) - 1)] = True
    return cuts


def _course(fix: Floats) -> Floats | None:
    """Return the unit vector (2,) from the first fix (F, 2) [m] to a distant one, or None."""
    n_fixes = _COURSE_FIX_COUNT
    while True:
        offset = fix[:n_fixes] - fix[0]
        distance = np.hypot(offset[:, 0], offset[:, 1])
        far = np.flatnonzero(distance > _LIMITS.course_length_m)
        if len(far):
            return np.asarray(offset[far[0]] / distance[far[0]])
        if n_fixes >= len(fix):
            return None
        n_fixes *= 4


def _split(track: Observations, cuts: Bools) -> list[Observations]:
    """Split a track after each True of `cuts` (F-1,); parts of one fix are dropped."""
    return [part for part in _parts(track, cuts) if len(part.fix_ns) > 1]


def _parts(track: Observations, cuts: Bools) -> list[Observations]:
    """Return the parts of a track after each True of `cuts` (F-1,)."""
    edges = [0, *(np.flatnonzero(cuts) + 1).tolist(), len(track.fix_ns)]
    parts = []
    for begin, end in pairwise(edges):
        speeds = (track.speed_ns >= track.fix_ns[begin]) & (
            track.speed_ns <= track.fix_ns[end - 1]
        )
        parts.append(select(track, np.arange(begin, end), speeds))
    return parts

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""From clean tracks to smooth pieces: tracks are cut at long gaps, relocations and reversals."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from scenario_gen.logs.cleaning import (
    FASTEST_MPS,
    RELOCATED,
    select,
    SLOWEST_S,
    TELEPORT_SLACK_M,
    TELEPORT_SLACK_MPS,
)
from scenario_gen.logs.config import ahead_of_point, LogConfig
from scenario_gen.logs.quality import VehicleQuality
from scenario_gen.logs.raw import Observations
from scenario_gen.logs.smoothing import (
    Smooth,
    smooth_piece,
    speed_of_fixes,
    standing,
    UnreconciledError,
)
from scenario_gen.numerics import Bools, Floats, runs
from scenario_gen.types import CAR, OTHER, VEHICLE_TYPES

TURNED = np.radians(
    120.0
)  # a vehicle whose course changes by more in a stop has reversed, or turned on the spot
MOST_TICKS = 100_000  # of a piece: smoothing takes 3 kB for each
SHARPEST = 0.4  # 1/m: no car turns sharper, noise included
NOISY = 1.6  # times as sharp as others can turn, if that is sharper
BACKWARDS = np.radians(
    150.0
)  # headings further off the path are those of a vehicle that drives backwards
REVERSES_MPS = 5.0  # the fastest that cars are driven backwards; above, the axes are mirrored (`remarks_on_units`)
CONTRADICTS = 1.2  # times the highest speed of its type, from which on it is of another one
LEVER_M = 3.0  # m over which the course before and after a stop is measured


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

    def speed(self, first: int, last: int) -> Floats:
        """Return speeds (T,) [m/s], likewise."""
        return self.smooth.speed[first - self.first : last - self.first]


def pieces_of(
    track: Observations, origin_ns: int, config: LogConfig
) -> tuple[list[Piece], VehicleQuality]:
    """Cut a track at gaps, relocations and reversals, and smooth each piece.

    Gaps of up to two and a half of the source's own periods are bridged, so that a source of 1 Hz is not cut at every fix.
    """
    seconds = np.diff(track.fix_ns) * 1e-9
    usual = float(np.median(seconds))
    longest = longest_bridge(seconds, config)
    gaps = (seconds > longest) | abrupt(seconds, np.hypot(*np.diff(track.fix, axis=0).T))
    back = (
        np.zeros_like(gaps) if VEHICLE_TYPES[track.kind or CAR].walks else reversals(track, config)
    )
    cuts = gaps | back | laps(track, config)
    bridged = (seconds > 1.5 * max(usual, config.period)) & ~gaps
    whole = parts(track, cuts)
    smoothed: list[tuple[Observations, Smooth | None]] = []
    lost = 0.0
    for part in whole:
        try:
            smoothed += steered(part, origin_ns, config)
        except UnreconciledError:
            smoothed.append((part, None))
            lost += float(part.fix_ns[-1] - part.fix_ns[0]) * 1e-9
    ahead = ahead_of_point(config) * track.length
    pieces = [
        Piece(part, moved_ahead(smooth, ahead) if ahead else smooth)
        for part, smooth in smoothed
        if smooth is not None
    ]
    smooths = [piece.smooth for piece in pieces]

    def joined(name: str) -> Floats:
        return np.concatenate([np.zeros(0), *(getattr(smooth, name) for smooth in smooths)])

    def rms(name: str) -> float:
        values = joined(name)
        return float(np.sqrt(np.square(values).mean())) if len(values) else 0.0

    turned, used = np.abs(joined("turned")), joined("headings")
    quality = VehicleQuality(
        id=track.id,
        fixes=len(track.fix_ns),
        seconds=sum(int(piece.last - piece.first - 1) for piece in pieces) * config.period,
        pieces=len(pieces),
        bridged=int(bridged.sum()),
        longest_bridged=float(seconds[bridged].max(initial=0.0)),
        cut=int(gaps.sum()),
        longest_cut=float(seconds[gaps].max(initial=0.0)),
        reversals=int((back & ~gaps).sum()) + len(smoothed) - len(whole),
        speed_before=rms("before"),
        speed_after=rms("after"),
        changed=rms("changed"),
        moved=rms("moved"),
        moved_most=max((float(smooth.moved.max()) for smooth in smooths), default=0.0),
        noise=max((smooth.noise for smooth in smooths), default=np.nan),
        turned=float(np.median(turned)) if len(turned) else np.nan,
        headings=float(used.mean()) if len(used) else np.nan,
        lost=lost,
    )
    return pieces, quality


def plausible(pieces: Sequence[Piece], config: LogConfig) -> tuple[list[Piece], tuple[str, ...]]:
    """Return the pieces that are driven forwards, of types that suit their motion; and notes on what was doubtful."""
    typed, contradictions = of_types(pieces)
    kept, backwards = driven_forwards(typed, config)
    return kept, (*contradictions, *backwards)


def of_types(pieces: Sequence[Piece]) -> tuple[list[Piece], tuple[str, ...]]:
    """Return the pieces; a vehicle that is much faster than its type is of type `other`, and a note says so."""
    fastest: dict[tuple[str, str], float] = {}
    for piece in pieces:
        key = piece.track.id, piece.track.kind
        fastest[key] = max(fastest.get(key, 0.0), float(piece.smooth.speed.max()))
    wrong = {
        key: speed
        for key, speed in fastest.items()
        if key[1] and speed > CONTRADICTS * VEHICLE_TYPES[key[1]].dynamics.max_speed
    }
    notes = tuple(
        f"vehicle {vehicle} is a {name} by the log and as fast as {speed:.1f} m/s: it is read as of type {OTHER}"
        for (vehicle, name), speed in wrong.items()
    )
    others = {vehicle for vehicle, _ in wrong}
    return [
        replace(piece, track=replace(piece.track, kind=OTHER))
        if piece.track.id in others
        else piece
        for piece in pieces
    ], notes


def driven_forwards(
    pieces: Sequence[Piece], config: LogConfig
) -> tuple[list[Piece], tuple[str, ...]]:
    """Return the pieces without those whose recorded headings are opposite to the path, and a note on each of these.

    Where most are, these are no headings of cars, and all pieces stay.
    """
    known = [piece for piece in pieces if len(piece.smooth.turned)]
    opposite = [
        piece
        for piece in known
        if np.median(np.abs(piece.smooth.turned)) > BACKWARDS
        and piece.smooth.speed.max() <= REVERSES_MPS
    ]
    if 2 * len(opposite) > len(known):
        return list(pieces), ()
    notes = tuple(
        f"vehicle {piece.track.id} drives backwards for {(piece.last - piece.first) * config.period:.1f} s, by its recorded "
        "headings; that is left out, for only driving forwards is generated"
        for piece in opposite
    )
    return [piece for piece in pieces if piece not in opposite], notes


def moved_ahead(smooth: Smooth, metres: float) -> Smooth:
    """Return the motion of a point so far ahead; a vehicle of unknown heading faces east."""
    heading = np.nan_to_num(smooth.heading)
    return replace(
        smooth,
        position=smooth.position + metres * np.stack([np.cos(heading), np.sin(heading)], axis=-1),
    )


def steered(
    part: Observations, origin_ns: int, config: LogConfig
) -> list[tuple[Observations, Smooth | None]]:
    """Smooth a part of a track, cut wherever its path then turns sharper than a car can.

    A car cannot turn on the spot: where its path does, it reversed in a stop too short for the fixes.
    """
    smooth = smooth_piece(part, origin_ns, config)
    if smooth is None:
        return [(part, None)]
    kind = VEHICLE_TYPES[part.kind or CAR]
    if kind.walks:  # turns on the spot
        return [(part, smooth)]
    sharpest = max(SHARPEST, NOISY * kind.dynamics.sharpest)
    turn = np.abs(np.diff(smooth.heading)) - sharpest * np.hypot(
        *np.diff(smooth.position, axis=0).T
    )
    if not (turn > 1e-6).any():
        return [(part, smooth)]
    at = origin_ns + round((smooth.first + int(np.argmax(turn)) + 0.5) * config.period * 1e9)
    cuts = np.zeros(len(part.fix_ns) - 1, dtype=bool)
    cuts[np.clip(np.searchsorted(part.fix_ns, at), 1, len(cuts)) - 1] = True
    return [leaf for half in parts(part, cuts) for leaf in steered(half, origin_ns, config)]


def abrupt(seconds: Floats, step: Floats) -> Bools:
    """Return which steps (F-1,) [m] no vehicle drives, or none that is as fast as this one is just before and after.

    Args:
        seconds: (F-1,) that each step takes.
        step: (F-1,) [m].
    """
    rate = np.pad(step / seconds, 2, mode="edge")
    around = (
        np.max([rate[:-4], rate[1:-3], rate[3:-1], rate[4:]], axis=0)
        if len(step) >= RELOCATED
        else np.full(len(step), np.inf)
    )
    far: Bools = (
        step
        > TELEPORT_SLACK_M + np.minimum(1.5 * around + TELEPORT_SLACK_MPS, FASTEST_MPS) * seconds
    )
    return far


def laps(track: Observations, config: LogConfig) -> Bools:
    """Return where (F-1,) a track of hours is cut, so that the memory of smoothing does not grow with it."""
    lap = (track.fix_ns - track.fix_ns[0]) // round(MOST_TICKS * config.period * 1e9)
    new: Bools = np.diff(lap) > 0
    return new


def longest_bridge(seconds: Floats, config: LogConfig) -> float:
    """Return the longest gap [s] that is bridged in a track whose fixes are `seconds` (F-1,) apart."""
    return max(config.longest_gap, 2.5 * min(float(np.median(seconds)), SLOWEST_S)) + 1e-6


def reversals(track: Observations, config: LogConfig) -> Bools:
    """Return where (F-1,) to cut because the vehicle reverses after a stop: its heading would jump."""
    seconds = (track.fix_ns - track.fix_ns[0]).astype(np.float64) * 1e-9
    speed_t = (track.speed_ns - track.fix_ns[0]).astype(np.float64) * 1e-9
    speed = track.speed
    if not len(speed):
        speed_t, speed = seconds, speed_of_fixes(seconds, track.fix)
    ticks = config.period * np.arange(
        max(int(seconds[-1] / config.period), 1) + 1, dtype=np.float64
    )
    cuts = np.zeros(len(seconds) - 1, dtype=bool)
    for begin, end in runs(standing(ticks, seconds, track.fix, speed_t, speed)):
        first, last = np.searchsorted(seconds, (ticks[begin], ticks[end - 1])).tolist()
        before = departure(track.fix[first::-1])
        after = departure(track.fix[last:])
        if before is not None and after is not None and float(before @ after) > -np.cos(TURNED):
            cuts[min((first + last) // 2, len(cuts) - 1)] = True
    return cuts


def departure(fix: Floats) -> Floats | None:
    """Return the unit vector (2,) from the first fix (F, 2) [m] to the first one `LEVER` away, None if there is none."""
    offset = fix - fix[0]
    away = np.hypot(offset[:, 0], offset[:, 1])
    far = np.flatnonzero(away > LEVER_M)
    return offset[far[0]] / away[far[0]] if len(far) else None


def parts(track: Observations, cuts: Bools) -> list[Observations]:
    """Split a track after each True of `cuts` (F-1,); parts of one fix are left out."""
    edges = [0, *(np.flatnonzero(cuts) + 1).tolist(), len(track.fix_ns)]
    pieces = []
    for begin, end in pairwise(edges):
        if end - begin < 2:
            continue
        during = (track.speed_ns >= track.fix_ns[begin]) & (
            track.speed_ns <= track.fix_ns[end - 1]
        )
        pieces.append(select(track, np.arange(begin, end), during))
    return pieces

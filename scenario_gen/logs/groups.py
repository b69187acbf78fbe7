# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Groups of vehicles that meet, and the time in which each is present.

Two pieces *meet* while they are nearer than `proximity`, for at least `min_presence` seconds; a
meeting longer than `max_duration` is cut. Groups grow from meetings of `min_duration` or more
(`growing`), up to `max_vehicles`. Each member is present while it is recorded and near another
one, so it may arrive late and leave early.

In a small log (of at most `max_vehicles`, as cut by a person) every meeting counts, and a vehicle
joins that meets any member. In a larger log only meetings count in which a vehicle moves and the
two interact (`gap`: they cross, follow, merge or pass), and a vehicle joins that meets at least
half of the members present with it.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise, permutations

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.encounters import Piece
from scenario_gen.logs.gap import height_apart, INTERACTS_M, space_time_gap
from scenario_gen.logs.growing import Group, Growth, Meeting, MIN_MET_SHARE, Span
from scenario_gen.numerics import arc_lengths, Floats, Ints, runs
from scenario_gen.numerics.curve import crossings, Curve

AROUND_CROSSING_S = 3.0
"""Time for which a vehicle is kept before and after it crosses another path."""

LONGEST_EXTENSION_S = 10.0
"""A vehicle that crosses later than this after its meeting does not do so because of it."""

_MIN_EXTENSION_S = 1.0  # less is not worth vehicles that start or end at different times
_MIN_ANGLE_RAD = 0.35  # between the paths; smaller angles are of vehicles that follow or merge


def complete_spans(
    spans: Mapping[int, Span], pieces: Mapping[int, Piece], period: float
) -> dict[int, Span]:
    """Return the spans of an encounter's members, extended to where they cross another's path.

    Args:
        spans: first tick and tick after the last of each member.
        pieces: the smooth motion of each member; no span is extended beyond it.
        period: of the ticks [s].
    """
    around = round(AROUND_CROSSING_S / period)
    latest = round(LONGEST_EXTENSION_S / period)
    first = min(start for start, _ in spans.values()) - around
    last = max(end for _, end in spans.values()) + latest
    paths = {member: _path(pieces[member], first, last) for member in spans}
    complete = dict(spans)
    for member, other in permutations(sorted(spans), 2):
        start, end = spans[member]
        for tick in _crossing_ticks(paths[member], paths[other]).tolist():
            if start <= tick < end + latest:
                begin, until = complete[member]
                complete[member] = (min(begin, tick - around), max(until, tick + around + 1))

    return {
        member: _recorded(spans[member], complete[member], pieces[member], period)
        for member in spans
    }


def _recorded(span: Span, wanted: Span, piece: Piece, period: float) -> Span:
    """Return a span, extended as far as wanted and recorded, unless that is too little."""
    least = round(_MIN_EXTENSION_S / period)
    begin = max(wanted[0], piece.first)
    end = min(wanted[1], piece.last)
    return (
        begin if span[0] - begin > least else span[0],
        end if end - span[1] > least else span[1],
    )


def _path(piece: Piece, first: int, last: int) -> tuple[int, Floats]:
    """Return the first tick of a piece between two ticks, and its positions (T, 2) [m] there."""
    begin = max(first, piece.first)
    return begin, piece.position(begin, max(min(last, piece.last), begin))


def _crossing_ticks(path: tuple[int, Floats], other: tuple[int, Floats]) -> Ints:
    """Return the ticks (K,) at which a vehicle is where its path crosses another path."""
    lines = [positions for _, positions in (path, other)]
    progress = [arc_lengths(line) for line in lines]
    if min(length[-1] if len(length) else 0.0 for length in progress) < 1.0:
        return np.zeros(0, dtype=np.int64)
    stations = crossings(Curve.through(lines[0]), Curve.through(lines[1]), _MIN_ANGLE_RAD)
    return path[0] + np.searchsorted(progress[0], stations[:, 0])


OUT_OF_RANGE_S = 1.0
"""Time for which a pair may be out of range within one meeting."""

_MIN_PRESENCE_SHARE = 0.6  # with `whole`, a vehicle joins if it is present for more of the time
_EDGE_S = 1.0  # by which a group is shortened so that its vehicles start and end together
_REST_S = 2.0  # part of a long standstill that belongs to the encounter before or after it
_STANDING_MPS = 0.1
_MAX_MEETING_COUNT = 200_000  # grouping takes minutes for more
_MAX_HEIGHT_M = 4.0  # between two vehicles of one road; more is a bridge
_MAX_ALTITUDE_M = 6.0  # the same by satellites, whose heights are less exact
_NOISE_M = 50.0  # by which the distance of two vehicles may be wrong before smoothing


class _PieceGroups(Growth[Meeting]):
    """Groups of the pieces of a log, in ticks; notes name vehicles that are left out, and why."""

    def __init__(self, pieces: Sequence[Piece], config: LogConfig, *, small: bool) -> None:
        super().__init__(
            shortest=ticks(config.min_duration, config) + 1,
            least=shortest(config),
            most=config.max_vehicles,
            share=0.0 if small else MIN_MET_SHARE,
        )
        self.pieces = pieces
        self.config = config

    def _outsiders(self, group: Group[Meeting], others: Iterable[int]) -> list[str]:
        """Return the vehicles of some pieces that are not in the group with another piece."""
        ids = {self.pieces[member].track.id for member in group.spans}
        return sorted({self.pieces[other].track.id for other in others} - ids)

    def full(self, group: Group[Meeting], others: Iterable[int]) -> None:
        """Note the vehicles that are left out."""
        names = self._outsiders(group, others)
        if names:
            group.notes.append(
                f"left out of an encounter of {len(group.spans)} vehicles (max_vehicles): "
                f"{', '.join(names)}"
            )

    def join(self, group: Group[Meeting], other: int, span: Span) -> None:
        """Add a vehicle for the time in which it is near any member, or note why not."""
        if not self._outsiders(group, [other]):
            return
        config = self.config
        name = self.pieces[other].track.id
        span = self._near_span(other, group)
        duration = span[1] - span[0]
        total = group.end - group.start
        share = f"{_seconds(span, config)} of {_seconds((group.start, group.end), config)} s"
        if not config.whole:
            if duration > ticks(config.min_presence, config):
                group.spans[other] = span
            elif duration > 0:
                group.notes.append(f"vehicle {name} is left out: near for {share} (min_presence)")
            return
        if duration < _MIN_PRESENCE_SHARE * total or duration < self.shortest:
            if duration > 0:
                group.notes.append(f"vehicle {name} is left out: near for {share} (whole)")
            return
        if duration < total:
            group.notes.append(f"vehicle {name} shortens its encounter to {share}")
        group.start, group.end = span
        group.spans = dict.fromkeys((*group.spans, other), span)

    def finish(self, group: Group[Meeting]) -> None:
        """Shorten a group a little so that its vehicles are present throughout; note others."""
        config = self.config
        edge = ticks(_EDGE_S, config)
        spans = group.spans.values()
        first = max(start for start, _ in spans if start <= group.start + edge)
        last = min(end for _, end in spans if end >= group.end - edge)
        if last - first > ticks(config.min_duration, config):
            group.start = first
            group.end = last
            group.spans = {
                member: (max(start, first), min(end, last))
                for member, (start, end) in group.spans.items()
            }

    def _near_span(self, other: int, group: Group[Meeting]) -> Span:
        """Return the longest part of a group's time in which a piece is near a present member."""
        piece = self.pieces[other]
        is_near = np.zeros(group.end - group.start, dtype=bool)
        for member, (first, last) in group.spans.items():
            distance = distances(piece, self.pieces[member])
            begin = max(piece.first, self.pieces[member].first)
            start = max(begin, first)
            end = min(begin + len(distance), last)
            if end > start:
                close = distance[start - begin : end - begin] < self.config.proximity
                is_near[start - group.start : end - group.start] |= close
        spans = runs(is_near, ticks(OUT_OF_RANGE_S, self.config))
        begin, end = max(spans, key=lambda span: span[1] - span[0], default=(0, 0))
        return group.start + begin, group.start + end


def find_groups(
    pieces: Sequence[Piece], config: LogConfig, within: Span | None = None
) -> tuple[list[Group[Meeting]], list[str]]:
    """Return the encounters by time, and notes on vehicles that are left out.

    Args:
        pieces: all pieces of a log.
        config: when vehicles meet.
        within: ticks in which vehicles must meet; None: at any time.
    """
    small = len({piece.track.id for piece in pieces}) <= config.max_vehicles
    meetings, notes = _find_meetings(pieces, config, within, small=small)
    groups = []
    for group in _PieceGroups(pieces, config, small=small).groups(meetings):
        parts, part_notes = _split(group, pieces, config)
        groups += parts
        notes += [*group.notes, *part_notes] if parts else []
    groups.sort(key=_by_time)
    if not config.whole:
        groups = sorted((_completed(group, pieces, config) for group in groups), key=_by_time)
    return groups, notes


def _by_time(group: Group[Meeting]) -> tuple[int, int, list[int]]:
    """Sort key of encounters."""
    return group.start, group.end, sorted(group.spans)


def _completed(
    group: Group[Meeting], pieces: Sequence[Piece], config: LogConfig
) -> Group[Meeting]:
    """Return a group with the ends of its members' manoeuvres."""
    members = {member: pieces[member] for member in group.spans}
    spans = complete_spans(group.spans, members, config.period)
    start = min(begin for begin, _ in spans.values())
    return Group(start, max(end for _, end in spans.values()), spans, group.meetings)


def _find_meetings(
    pieces: Sequence[Piece], config: LogConfig, within: Span | None, *, small: bool
) -> tuple[list[Meeting], list[str]]:
    """Return all meetings of two vehicles, in ticks; in a `small` log each has gap 0; and notes.

    Raises:
        InputError: there are too many.
    """
    meetings = []
    notes = []
    for i, j in near_pairs(pieces, shortest(config), config.proximity):
        a, b = pieces[i], pieces[j]
        climb = height_apart(a.smooth.position, a.height, b.smooth.position, b.height)
        if climb > (_MAX_HEIGHT_M if a.track.origin is None else _MAX_ALTITUDE_M):
            notes.append(
                f"vehicles {a.track.id} and {b.track.id} are {climb:.1f} m apart in height where "
                "they are nearest: no pair"
            )
            continue
        for span in _near_spans(pieces[i], pieces[j], config, within):
            gap = 0.0 if small else _gap(pieces[i], pieces[j], span, config)
            if gap <= INTERACTS_M:
                meetings.append(Meeting(gap, span[0], min(i, j), max(i, j), span[1]))
        if len(meetings) > _MAX_MEETING_COUNT:
            raise InputError(
                f"more than {_MAX_MEETING_COUNT} meetings of two vehicles: read a part of the log "
                "(log.start, log.end, log.vehicles), or lower --set log.proximity=…"
            )
    return meetings, notes


def _near_spans(
    a: Piece, b: Piece, config: LogConfig, within: Span | None = None
) -> Iterator[Span]:
    """Yield the spans of at least `shortest` ticks in which two pieces are near each other."""
    begin = max(a.first, b.first)
    is_near = distances(a, b) < config.proximity
    if within is not None:
        time = np.arange(begin, begin + len(is_near))
        is_near &= (time >= within[0]) & (time < within[1])
    for low, high in runs(is_near, ticks(OUT_OF_RANGE_S, config)):
        for first, last in windows(begin + low, begin + high, config):
            if last - first >= shortest(config):
                yield first, last


def vehicles_near(pieces: Sequence[Piece], config: LogConfig) -> set[str]:
    """Return the vehicles of raw pieces that come near another one, with a margin."""
    reach = config.proximity + _NOISE_M
    near: set[str] = set()
    for i, j in near_pairs(pieces, 1, reach):
        names = {pieces[i].track.id, pieces[j].track.id}
        if not names <= near and distances(pieces[i], pieces[j]).min() < reach:
            near |= names
    return near


def near_pairs(pieces: Sequence[Piece], least: int, reach: float) -> Iterator[tuple[int, int]]:
    """Yield pairs of simultaneous pieces of two vehicles at one site, by first tick.

    Args:
        pieces: all pieces of a log.
        least: ticks that two pieces share at least.
        reach: distance [m] of the rectangles around their positions.
    """
    first = np.array([piece.first for piece in pieces])
    low = np.array([piece.smooth.position.min(axis=0) for piece in pieces])
    high = np.array([piece.smooth.position.max(axis=0) for piece in pieces])
    _, vehicle = np.unique([piece.track.id for piece in pieces], return_inverse=True)
    _, site = np.unique([str(piece.track.origin) for piece in pieces], return_inverse=True)
    order = np.argsort(first, kind="stable")
    for k, i in enumerate(order.tolist()):
        others = order[k + 1 :]
        others = others[: np.searchsorted(first[others], pieces[i].last - least, side="right")]
        others = others[(vehicle[others] != vehicle[i]) & (site[others] == site[i])]
        space = np.maximum(low[others] - high[i], low[i] - high[others])
        is_near = np.hypot(*np.maximum(space, 0.0).T) < reach
        for j in others[is_near].tolist():
            yield i, j


def _gap(a: Piece, b: Piece, span: Span, config: LogConfig) -> float:
    """Return the space-time gap of two vehicles [m]; infinite if neither drives `travel`."""
    if max(driven(piece, *span, config) for piece in (a, b)) < config.travel:
        return float("inf")
    gap, _, _ = space_time_gap(a.position(*span), b.position(*span), config.period)
    return gap


def windows(first: int, last: int, config: LogConfig) -> list[Span]:
    """Cut a long meeting at multiples of `max_duration` on the common clock."""
    longest = ticks(config.max_duration, config)
    least = ticks(config.min_duration, config) + 1
    if last - first <= longest:
        return [(first, last)]
    multiples = range(longest, last, longest)
    edges = [edge for edge in multiples if first + least <= edge <= last - least]
    return list(pairwise([first, *edges, last]))


def shortest(config: LogConfig) -> int:
    """Return the ticks of the shortest meeting that forms an encounter, or joins it."""
    seconds = config.min_duration
    if not config.whole:
        seconds = min(config.min_presence, seconds)
    return ticks(seconds, config) + 1


def ticks(seconds: float, config: LogConfig) -> int:
    """Return seconds as a number of ticks."""
    return round(seconds / config.period)


def distances(a: Piece, b: Piece) -> Floats:
    """Return the distances (T,) [m] of two pieces at their common ticks; infinite at two sites."""
    first = max(a.first, b.first)
    last = max(min(a.last, b.last), first)
    if a.track.origin != b.track.origin:
        return np.full(last - first, np.inf)
    offset = a.position(first, last) - b.position(first, last)
    distance: Floats = np.hypot(*offset.T)
    return distance


def driven(piece: Piece, first: int, last: int, config: LogConfig) -> float:
    """Return the distance [m] that a piece drives from tick `first` to before tick `last`."""
    return float(piece.speed(first, last).sum() * config.period)


def _seconds(span: Span, config: LogConfig) -> str:
    """Return the duration of some ticks in seconds, for notes."""
    return f"{max(span[1] - span[0] - 1, 0) * config.period:.1f}"


def _split(
    group: Group[Meeting], pieces: Sequence[Piece], config: LogConfig
) -> tuple[list[Group[Meeting]], list[str]]:
    """Cut a group at long standstills of all vehicles, and into equal parts if it lasts too long.

    Returns:
        The parts with motion, and notes on members that are present for too little of a part.
    """
    parts = []
    notes = []
    for first, last in _part_spans(group, pieces, config):
        part, absent = _part_of(group, first, last, config)
        if len(part.spans) < 2 or part.end - part.start <= ticks(config.min_duration, config):
            continue
        longest = max(driven(pieces[m], *span, config) for m, span in part.spans.items())
        if longest >= config.travel:
            parts.append(part)
            duration = _seconds((part.start, part.end), config)
            notes += [
                f"vehicle {pieces[member].track.id} is left out of a part of {duration} s: "
                f"present for {_seconds(span, config)} s (min_presence)"
                for member, span in absent.items()
            ]
    return parts, notes


def _part_spans(
    group: Group[Meeting], pieces: Sequence[Piece], config: LogConfig
) -> Iterator[Span]:
    """Yield the spans between long standstills, in equal parts of at most `max_duration`."""
    are_standing = np.ones(group.end - group.start, dtype=bool)
    for member, (first, last) in group.spans.items():
        speed = pieces[member].speed(first, last)
        are_standing[first - group.start : last - group.start] &= speed < _STANDING_MPS
    rest = ticks(_REST_S, config)
    is_used = np.ones(len(are_standing), dtype=bool)
    for begin, end in runs(are_standing):
        if end - begin > ticks(config.standstill, config):
            is_used[begin + rest : end - rest] = False
    for begin, end in runs(is_used):
        seconds = (end - begin - 1) * config.period
        n_parts = max(int(np.ceil(seconds / config.max_duration - 1e-9)), 1)
        edges = np.linspace(begin, end - 1, n_parts + 1).round().astype(int)
        for low, high in pairwise(edges.tolist()):
            yield group.start + low, group.start + high + 1


def _part_of(
    group: Group[Meeting], first: int, last: int, config: LogConfig
) -> tuple[Group[Meeting], dict[int, Span]]:
    """Return a part of a group with its members, and the spans of members present too shortly."""
    present = {}
    absent = {}
    for member, (start, end) in group.spans.items():
        span = (max(start, first), min(end, last))
        is_long = span[1] - span[0] > ticks(config.min_presence, config)
        if is_long or span == (first, last):
            present[member] = span
        elif span[1] > span[0]:
            absent[member] = span
    if present:
        first = min(start for start, _ in present.values())
        last = max(end for _, end in present.values())
    return Group(first, last, present), absent

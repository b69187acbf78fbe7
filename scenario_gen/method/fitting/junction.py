# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Placing a template through a junction: which entry and which exit for whom, and how far along.

First the template is laid on the road as one piece: from many rigid motions (each way of the vehicles that turn and drive
most), every vehicle takes the way that is nearest to its path, and the motion is refined until nothing changes (iterated closest
points, point to line). So who is beside whom, and who comes from which side, is kept, and the effort grows with the number of
vehicles, not with that of assignments. Then the best assignments are solved for the distances along their ways and compared with
the template: headings and relative positions at sampled instants, turns, crossings.
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import partial

import numpy as np

from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting.config import FittingConfig
from scenario_gen.method.fitting.junction_solver import Choice, FAR, HEADING, OWN_SLACK, Solver, Way, WHOLE_TURN
from scenario_gen.method.fitting.kept import count_lost, find_unused, refuse_lost_turns
from scenario_gen.method.fitting.placement import check_scale, has_room, Placement, separated
from scenario_gen.method.fitting.relations import find_relations, Relation
from scenario_gen.numerics import Floats, frozen, Ints, wrap_angle
from scenario_gen.numerics.kernels import F2, F3, kernel, OUTI2
from scenario_gen.roads import draw_route, draw_u_turn, relative, ways_through
from scenario_gen.template import in_words, manoeuvre_of, MOST_CHANGE, sharpness_of, Track, turn_of
from scenario_gen.types import Road, Vehicle

_SEEDS = 3  # vehicles by whose ways the template is laid on the road
_LAID = 80  # motions that are refined
_ROUNDS = 5
_SAMPLES = 64  # points of a way
_MOMENTS = 8  # samples of a track
_SOLVED = 6  # assignments that are solved for the distances along their ways
_PLACED = 10  # of them that are placed in full, until one loses no conflict
_SWAPS = 3
_OTHERS = 2  # other ways per vehicle that are tried in the best one
_LATERAL_ONLY = 1e-3  # weight of staying where one is, where nothing else says so
_LANE_CHANGE = 8.0  # m² for a way that changes lanes on a straight arm, so that none is taken without need
_SCALES = (1.0, 0.95, 1.05, 0.9, 1.1, 0.85, 1.15, 0.8, 1.2, 1.25)
_MOST_LOST = 0.2  # share of the relations; what is lost is reported
_TURN_TOLERANCE = MOST_CHANGE
_HEADING_LIMIT = np.radians(50.0)  # a fitted vehicle may be turned from the template (after the rigid motion) by this on average
_SHARPNESS_STEP = 0.25  # of the logarithm of a curvature: vehicles that differ by less share their ways
_END = 3.0  # metres at both ends of a way, where footprints reach beyond the road's end
_APEXES = np.arange(0.2, 0.81, 0.05)  # places along a road at which a U-turn is tried


def place_at_junction(tracks: tuple[Track, ...], road: Road, config: FittingConfig) -> Placement:
    """Match the template's manoeuvres and relative geometry to the road's entries and exits.

    Raises:
        RefusedError: no assignment keeps who crosses whom, the turns and the distances.
    """
    ways = _ways(tracks, road)
    for track, own in zip(tracks, ways, strict=True):
        if not own:
            raise RefusedError(
                f"vehicle {track.vehicle.id} {_turn_in_words(track)}: road {road.name} has no way for that "
                f"({len(road.entries)} entries, {len(road.exits)} exits)"
            )
    relations = find_relations(tracks)
    reasons = []
    for scale in filter(config.accepts, _SCALES):
        best: tuple[int, Placement] | None = None
        for choice in _search(tracks, ways, relations, scale)[:_PLACED]:
            reason = _misfit_reason(choice, scale)
            if not reason:
                try:
                    placement = _placed(tracks, road, choice, scale, relations, config)
                except RefusedError as error:
                    reason = str(error)
                else:
                    lost = count_lost(tracks, placement.tracks)
                    if best is None or lost < best[0]:
                        best = lost, placement
                    if lost == 0:
                        break
            reasons.append(reason)
        if best is not None:
            return best[1]
    if not reasons:
        check_scale(1.0, "the template", config)
    raise RefusedError(f"the template does not fit the ways of road {road.name}: {reasons[0]}")


def has_lanes(road: Road) -> bool:
    """True if a route for a car can be drawn from every entry: the road's entries and exits are lanes that explain it."""
    ways = _all_ways(Vehicle("car"), road, u_turns=False)
    return len(road.entries) > 0 and {way.entry for way in ways} == set(range(len(road.entries)))


def _turn_in_words(track: Track) -> str:
    return "makes a U-turn" if track.makes_u_turn else in_words(turn_of(track))


def _misfit_reason(choice: Choice, scale: float) -> str:
    """What is wrong with an assignment, "" if nothing is."""
    if choice.lost > _MOST_LOST * choice.relations:
        return f"the best assignment loses {choice.lost} of the template's {choice.relations} crossings or shared lanes"
    if choice.turned > _HEADING_LIMIT:
        return f"in the best assignment a vehicle is turned from the template by {np.degrees(choice.turned):.0f}°"
    if choice.beyond > 0.0:
        return f"in the best assignment a vehicle starts or ends {choice.beyond:.1f} m beyond the road's end (scale {scale:g})"
    return ""


def _ways(tracks: tuple[Track, ...], road: Road) -> list[list[Way]]:
    """The drawn routes that suit each vehicle's turning; vehicles of about one size and sharpness share theirs."""
    drawn: dict[tuple[float, float, float, bool], list[Way]] = {}
    ways = []
    for track in tracks:
        sharpness = float(np.exp(round(float(np.log(sharpness_of(track))) / _SHARPNESS_STEP) * _SHARPNESS_STEP))
        size = (np.ceil(2.0 * track.vehicle.length) / 2.0, np.ceil(10.0 * track.vehicle.width) / 10.0)
        key = (*size, sharpness, track.makes_u_turn)
        if key not in drawn:
            stop_if_cancelled()
            drawn[key] = _all_ways(Vehicle("", *size), road, u_turns=track.makes_u_turn, sharpness=sharpness)
        ways.append([way for way in drawn[key] if _suits(track, way)])
    return ways


def _all_ways(vehicle: Vehicle, road: Road, *, u_turns: bool, sharpness: float | None = None) -> list[Way]:
    fits = partial(has_room, road, vehicle)
    everything: list[Way] = []
    ring = road.lanes is not None and road.lanes.turns_back
    through = ways_through(road) if ring else {}  # elsewhere a vehicle bends as it did in the template
    for e, entry in enumerate(road.entries):
        for x, leave in enumerate(road.exits):
            way = through.get((e, x))
            if way is None or not fits(way.cut(_END, way.length - _END).points):
                way = draw_route(entry, leave, fits, sharpness)
            curves = [] if way is None else [way]
            if not curves and u_turns:
                reach = max(float(np.hypot(*(other[:2] - entry[:2]))) for other in road.exits)
                drawn = (draw_u_turn(entry, leave, float(apex), fits) for apex in _APEXES * reach)
                curves = [curve for curve in drawn if curve is not None]
            everything += [Way(e, x, curve, float(curve.points[-1, 2] - curve.points[0, 2])) for curve in curves]
    return everything


def _suits(track: Track, way: Way) -> bool:
    """A vehicle may have driven only part of a turn, but not more than the way turns, nor to the other side."""
    turn = turn_of(track)
    if track.makes_u_turn or abs(way.turn) > np.radians(150.0):
        return track.makes_u_turn and abs(way.turn) > np.radians(150.0) and way.turn * turn > 0.0
    low, high = min(way.turn, 0.0) - _TURN_TOLERANCE, max(way.turn, 0.0) + _TURN_TOLERANCE
    return bool(low <= turn <= high)


def _search(tracks: tuple[Track, ...], ways: list[list[Way]], relations: tuple[Relation, ...], scale: float) -> list[Choice]:
    """Assignments, solved, the best first."""
    solver = Solver(tracks, relations, scale)
    tracks_on = _Laying(tracks, ways, scale).best(solver)
    choices: dict[tuple[int, ...], Choice] = {}

    def solved(chosen: tuple[int, ...]) -> Choice:
        if chosen not in choices:
            stop_if_cancelled()
            choices[chosen] = solver.solve({i: ways[i][k] for i, k in enumerate(chosen)})
        return choices[chosen]

    best = min((chosen for chosen, _ in tracks_on), key=lambda chosen: round(solved(chosen).cost, 6))
    order = dict(tracks_on)[best]
    for _ in range(_SWAPS):  # one vehicle at a time, the one by which most is won
        swapped = [(*best[:i], k, *best[i + 1 :]) for i in range(len(tracks)) for k in order[i][:_OTHERS]]
        other = min(swapped, key=lambda chosen: round(solved(chosen).cost, 6), default=best)
        if round(solved(other).cost, 6) >= round(solved(best).cost, 6):
            break
        best = other
    return sorted(choices.values(), key=lambda choice: (bool(_misfit_reason(choice, scale)), round(choice.cost, 6)))


class _Laying:
    """The template as one piece on the road: which way is nearest to whom."""

    def __init__(self, tracks: tuple[Track, ...], ways: list[list[Way]], scale: float) -> None:
        self.tracks, self.ways, self.scale = tracks, ways, scale
        moments = np.unique(np.linspace(0, len(tracks[0].progress) - 1, _MOMENTS).astype(np.int64))
        self.poses = [track.poses[moments] for track in tracks]
        self.middle = np.concatenate(self.poses)[:, :2].mean(axis=0)
        self.samples, self.spacing, self.extra = [], [], []
        known: dict[int, tuple[Floats, float]] = {}
        for track, own in zip(tracks, ways, strict=True):
            for way in own:
                if id(way) not in known:
                    known[id(way)] = way.curve.at(np.linspace(0.0, way.curve.length, _SAMPLES)), way.curve.length / (_SAMPLES - 1)
            points = np.stack([known[id(way)][0] for way in own])
            self.samples.append(np.concatenate((points, np.cos(points[..., 2:]), np.sin(points[..., 2:])), axis=-1))
            self.spacing.append(np.array([known[id(way)][1] for way in own]))
            turn = turn_of(track)
            shift = np.array([abs(relative(way.curve.points[0], way.curve.points[-1, :2])[1]) > 1.0 for way in own])
            turns = np.array([way.turn for way in own])
            self.extra.append(WHOLE_TURN * np.square(turns - turn) + _LANE_CHANGE * (shift & (np.abs(turns) < OWN_SLACK)))

    def best(self, solver: Solver) -> list[tuple[tuple[int, ...], list[list[int]]]]:
        """The best assignments: each the index of everybody's way, and for everybody the other ways in their order."""
        seeds = sorted(
            (i for i, track in enumerate(self.tracks) if not track.still or len(self.tracks) == 1),
            key=lambda i: (-round(abs(turn_of(self.tracks[i])), 1), -self.tracks[i].travelled),
        )[:_SEEDS] or [0]
        motions = []
        for i in seeds:
            for way in self.ways[i]:
                start = solver.start_by_turn(i, way.curve)
                rigid = solver.align({i: way}, {i: start}, [i])
                motions.append(np.array([*rigid.of(self.middle[None])[0], rigid.yaw]))  # where the middle goes, and the rotation
        rated = sorted(((self._rated(motion)[0], k) for k, motion in enumerate(motions)), key=lambda r: (round(r[0], 6), r[1]))
        matches: dict[tuple[int, ...], tuple[float, list[list[int]]]] = {}
        for _, k in rated[:_LAID]:
            motion = motions[k]
            for _ in range(_ROUNDS):
                _, nearest = self._rated(motion)
                motion = self._refined(motion, nearest)
            cost, nearest = self._rated(motion)
            chosen = tuple(int(np.argmin(costs)) for costs, _, _ in nearest)
            if chosen not in matches or cost < matches[chosen][0]:
                others = [[int(w) for w in np.argsort(np.round(costs, 6), kind="stable")[1:]] for costs, _, _ in nearest]
                matches[chosen] = cost, others
        order = sorted(matches, key=lambda chosen: (round(matches[chosen][0], 6), chosen))
        return [(chosen, matches[chosen][1]) for chosen in order[:_SOLVED]]

    def _rated(self, motion: Floats) -> tuple[float, list[tuple[Floats, Floats, Floats]]]:
        """The cost of a motion [m²]; for each vehicle the cost of its ways (W,), how far it is beside them and where (W, K)."""
        cos, sin = np.cos(motion[2]), np.sin(motion[2])
        total, nearest = 0.0, []
        for poses, samples, spacing, extra in zip(self.poses, self.samples, self.spacing, self.extra, strict=True):
            d = self.scale * (poses[:, :2] - self.middle)
            at = motion[:2] + np.column_stack((cos * d[:, 0] - sin * d[:, 1], sin * d[:, 0] + cos * d[:, 1]))
            which = np.empty((len(samples), len(at)), dtype=np.int64)
            _nearest(at, samples, which)
            near = np.take_along_axis(samples, which[..., None], axis=1)
            off = at[None] - near[..., :2]
            along = off[..., 0] * near[..., 3] + off[..., 1] * near[..., 4]
            aside = off[..., 1] * near[..., 3] - off[..., 0] * near[..., 4]
            miss = np.square(aside) + np.square(np.maximum(np.abs(along) - spacing[:, None], 0.0))
            turned = 1.0 - np.cos(poses[:, 2] + motion[2] - near[..., 2])
            costs = (np.minimum(miss, FAR * FAR) + HEADING * turned).mean(axis=1) + extra
            total += float(costs.min())
            nearest.append((costs, aside, near))
        return total / len(self.poses), nearest

    def _refined(self, motion: Floats, nearest: list[tuple[Floats, Floats, Floats]]) -> Floats:
        """One step of point-to-line registration (Chen & Medioni 1991), with the headings."""
        rows, values = [], []
        cos, sin = np.cos(motion[2]), np.sin(motion[2])
        for poses, (costs, aside, near) in zip(self.poses, nearest, strict=True):
            w = int(np.argmin(costs))
            d = self.scale * (poses[:, :2] - self.middle)
            lever = np.column_stack((-sin * d[:, 0] - cos * d[:, 1], cos * d[:, 0] - sin * d[:, 1]))
            normal = np.column_stack((-near[w, :, 4], near[w, :, 3]))
            rows.append(np.column_stack((normal, (normal * lever).sum(axis=1))))
            values.append(-aside[w])
            turn = np.zeros((len(poses), 3))
            turn[:, 2] = np.sqrt(HEADING / 2.0)
            rows.append(turn)
            values.append(np.sqrt(HEADING / 2.0) * wrap_angle(near[w, :, 2] - poses[:, 2] - motion[2]))
        rows.append(_LATERAL_ONLY * np.eye(3))
        values.append(np.zeros(3))
        return np.asarray(motion + np.linalg.lstsq(np.concatenate(rows), np.concatenate(values), rcond=None)[0])


def _lanes_of(road: Road, ways: Iterable[Way]) -> list[int]:
    """The lanes by which ways enter and leave a drawn junction."""
    if road.lanes is None:
        return []
    return [k for way in ways for k in (road.lanes.entries[way.entry], road.lanes.exits[way.leave])]


@kernel(F2, F3, OUTI2)
def _nearest(points: Floats, samples: Floats, which: Ints) -> None:
    """Fill `which` (W, K) with the sample of each of W ways that is nearest to each of K points (K, 2) [m], the first of equals.

    Args:
        points: (K, 2) metres.
        samples: (W, S, 5) x, y [m] first.
        which: (W, K) index of the sample.
    """
    for w in range(samples.shape[0]):
        for k in range(points.shape[0]):
            least, which[w, k] = np.inf, 0
            for s in range(samples.shape[1]):
                x, y = points[k, 0] - samples[w, s, 0], points[k, 1] - samples[w, s, 1]
                square = x * x + y * y
                if square < least:
                    least, which[w, k] = square, s


def _placed(
    tracks: tuple[Track, ...], road: Road, choice: Choice, scale: float, relations: tuple[Relation, ...], config: FittingConfig
) -> Placement:
    placed = []
    notes = [f"scaled by {scale:g} to fit the road"] if scale != 1.0 else []
    for i, track in enumerate(tracks):
        way, begin = choice.ways[i], choice.start[i]
        end = begin + scale * track.travelled
        curve = way.curve.cut(begin, max(end, begin + 1.0), 0.25)
        progress = scale * track.progress * (curve.length / max(end - begin, 1.0))
        placed.append(replace(track, curve=curve, progress=frozen(np.minimum(progress, curve.length))))
        notes.append(
            f"vehicle {track.vehicle.id} takes entry {way.entry} and exit {way.leave} ({in_words(way.turn)}), "
            f"{begin:.1f} m to {end:.1f} m of {way.curve.length:.1f} m; {_turn_in_words(track)} in the template"
        )
    for r in relations:
        a, b = tracks[r.a].vehicle.id, tracks[r.b].vehicle.id
        notes.append(f"vehicle {a} {r.kind.value} vehicle {b}, as in the template")
    notes.append(f"assignment chosen at a cost of {choice.cost:.1f} m²")
    refuse_lost_turns(tracks, tuple(placed), road.name)
    placement = Placement.of(tuple(placed), scale, notes, (manoeuvre_of(turn_of(track)) for track in placed))
    unused = find_unused(road, _lanes_of(road, choice.ways.values()))
    return separated(replace(placement, unused=unused), config, sideways=0.0, own=tracks)

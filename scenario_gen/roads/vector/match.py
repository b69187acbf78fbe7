# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A recording on the lanes of a map: the lanes that each vehicle follows, and its start there.

A hypothesis gives the approximate poses of the recorded vehicles. Each vehicle then gets the chain
of lanes that its poses are nearest to, with at most one lane change where the map allows it. A
least squares problem moves the starts along the chains, so that distances to crossings and gaps
between vehicles in one lane stay as recorded.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, islice, product, starmap
import math
from typing import NamedTuple

import numpy as np

from scenario_gen.numerics import angle_between, Floats, runs
from scenario_gen.numerics.curve import crossings, Curve
from scenario_gen.roads.vector.hypotheses import Hypothesis
from scenario_gen.roads.vector.lane_graph import (
    bend_cost,
    COSTS,
    lane_change_length,
    LaneChain,
    LaneGraph,
    LanePath,
    lateral_acceleration,
    LEAD_M,
    LIMITS,
    narrow_cost,
    off_reserved_cost,
    speeding_cost,
    STEP_M,
    WEIGHTS,
)
from scenario_gen.roads.vector.lateral import with_lateral_positions
from scenario_gen.situation import (
    Equation,
    pair_crossings,
    PairConflicts,
    solve_placement,
    Track,
    turn_of,
    WAIT_SPEED_MPS,
)
from scenario_gen.types import LaneNetwork, RuleKind, TrafficRule

_NO_LANES = "no lanes lead along the path of vehicle {} from start to end"


@dataclass(frozen=True, eq=False)
class Match:
    """A lane path for every vehicle.

    Attributes:
        paths: one for each vehicle; () if a vehicle has none.
        cost: [m²] how badly they resemble the recording.
        reason: why it cannot be used, or "".
        forced_lateral: [m/s²] the largest lateral acceleration that the recorded speeds at the
            ends force (`lateral_acceleration`).
        off_reserved_cost: [m²] the extra cost of vehicles that leave their reserved lanes.
        lost_crossings: recorded crossings that both vehicles drive to, and these lanes lack.
        windows: (N, 2) [s] in which the vehicles are on their paths, if only these are too short.
    """

    paths: tuple[LanePath, ...]
    cost: float
    reason: str
    forced_lateral: float = 0.0
    off_reserved_cost: float = 0.0
    lost_crossings: int = 0
    windows: Floats | None = None


class _Candidate(NamedTuple):
    """A chain of lanes for one vehicle: its cost [m²], its curve, and on it the K poses.

    Each pose has a station [m] and a cost [m²], (K,).
    """

    chain: LaneChain
    cost: float
    curve: Curve
    stations: Floats
    pose_costs: Floats


def match(
    graph: LaneGraph,
    tracks: Sequence[Track],
    met: PairConflicts,
    hypothesis: Hypothesis,
    *,
    prefer_reserved: bool = False,
) -> Iterator[Match]:
    """Yield lane paths for all vehicles near the poses of a hypothesis.

    There is one match; if a vehicle would turn otherwise than recorded, there is a second one in
    which it turns as recorded, and may leave a crossing.

    Args:
        graph: of the map or a part of it.
        tracks: the recording.
        met: its conflicts.
        hypothesis: its approximate poses on the map.
        prefer_reserved: whether vehicles with reserved lanes are put onto these if some are near.
    """
    scale, paths = hypothesis.scale, []
    for n, (track, poses) in enumerate(zip(tracks, hypothesis.poses, strict=True)):
        ends = hypothesis.ends[n] if hypothesis.ends else ("", "")
        if prefer_reserved and graph.reserved_for(track):  # the named lanes are for cars
            ends = "", ""
        firsts = _first_lanes(graph, poses[: None if hypothesis.may_begin_before else 1])
        path = _lane_path(
            graph, track, poses, scale, firsts, ends, prefer_reserved=prefer_reserved
        )
        if path is None:
            yield Match((), math.inf, _NO_LANES.format(track.vehicle.id))
            return
        if hypothesis.swerve is not None and hypothesis.swerve[n].any():
            path = _swerving(path, hypothesis.swerve[n])
        paths.append(path)
    paths, missing = with_lateral_positions(graph, paths, tuple(tracks))
    cost = narrow_cost(missing) + hypothesis.extra

    def judged(turning: Sequence[Equation]) -> Match:
        moved = _moved_starts(graph.network, paths, tracks, met, scale, turning)
        return _judged(graph, moved, tracks, hypothesis.poses, cost)

    yield judged([])
    turning = [
        Equation(((i, 1.0),), start, WEIGHTS.turn)
        for i, (path, track) in enumerate(zip(paths, tracks, strict=True))
        if (start := _start_to_turn(path, track)) is not None
    ]
    if turning:
        yield judged(turning)


def _first_lanes(graph: LaneGraph, poses: Floats) -> list[int]:
    """Return the lanes near the first of some poses (K, 3) that has any."""
    return next(filter(None, map(graph.near, poses)), [])


def _swerving(path: LanePath, swerve: Floats) -> LanePath:
    """Return a lane path with recorded offsets (T,) [m, left positive] from the lanes."""
    lane, at = path.curve, path.start + path.progress
    s = np.linspace(0.0, lane.length, max(math.ceil(lane.length / STEP_M), 1) + 1)
    moves = np.concatenate(([True], np.diff(at) > 0.0))
    curve = Curve.through(lane.at_offset(s, np.interp(s, at[moves], swerve[moves]))[:, :2])
    driven = np.interp(at, s, curve.station)
    return LanePath(path.lanes, curve, float(driven[0]), driven - driven[0])


def _lane_path(
    graph: LaneGraph,
    track: Track,
    poses: Floats,
    scale: float,
    firsts: Sequence[int],
    ends: tuple[str, str],
    *,
    prefer_reserved: bool,
) -> LanePath | None:
    """Return the path along lanes that resembles a vehicle's poses (K, 3) most, if any."""
    reserved = graph.reserved_for(track) if prefer_reserved else frozenset[int]()
    length = graph.length
    driven = scale * track.travelled

    def reserved_share(candidate: _Candidate) -> float:
        whole = sum(length[k] for k in candidate.chain)
        return sum(length[k] for k in candidate.chain if k in reserved) / whole

    def rank(candidate: _Candidate) -> tuple[float, LaneChain]:
        bonus = COSTS.not_reserved_m2 * reserved_share(candidate)
        return round(candidate.cost - bonus, 6), candidate.chain

    ranked = sorted(_candidates(graph, track, poses, driven, firsts, ends), key=rank)
    if not ranked:
        return None
    best = ranked[0]
    if not track.still and not reserved_share(best):
        best = _best_lane_change(graph.network, ranked[: LIMITS.changing_chains], poses)
    start = float(np.median(best.stations - np.linspace(0.0, driven, len(poses))))
    return LanePath(best.chain, best.curve, start, scale * track.progress)


def _candidates(
    graph: LaneGraph,
    track: Track,
    poses: Floats,
    driven: float,
    firsts: Sequence[int],
    ends: tuple[str, str],
) -> Iterator[_Candidate]:
    """Yield the chains from the first lanes, or from the lane with the id `ends[0]`.

    They lead over the lane with the id `ends[1]`, or over one near the last pose, if there is any.
    """
    closed = graph.closed_to(track.vehicle.kind.lane_user)
    named = [
        [k for k, lane in enumerate(graph.network.lanes) if lane.id == name] if name else []
        for name in ends
    ]
    starts = named[0] or [k for k in firsts if k not in closed]
    chains = (chain for k in starts for chain in graph.chains_from(k, driven, closed))
    lasts = set(named[1] or graph.near(poses[-1]))
    chains = (chain for chain in chains if not lasts or lasts.intersection(chain))
    for chain in dict.fromkeys(islice(chains, LIMITS.chains)):
        curve = _part_around(graph.curve(chain), poses, driven)
        stations, offsets = curve.project(poses[:, :2])
        turns = poses[:, 2] - curve.yaw_at(stations)
        costs = _pose_costs(stations, offsets, turns, curve.length)
        cost = float(costs.mean() + COSTS.turn_m2_per_rad2 * np.square(turns[-1] - turns[0]))
        yield _Candidate(chain, cost, curve, stations, costs)


def _part_around(curve: Curve, poses: Floats, driven: float) -> Curve:
    """Return the part of a lane path around poses (K, 3), with some of it before and after."""
    station, _ = curve.project(poses[:1, :2])
    low = max(float(station[0]) - LEAD_M, 0.0)
    high = min(float(station[0]) + 1.1 * driven + 2.0 * LEAD_M, curve.length)
    return curve.cut(low, high) if high - low > STEP_M else curve


def _pose_costs(stations: Floats, offsets: Floats, turns: Floats, length: float) -> Floats:
    """Return how badly (K,) [m²] poses agree with a curve of a length [m].

    Stations and offsets (K,) [m] are theirs on the curve, turns (K,) [rad] from it.
    """
    beyond = np.maximum(-stations, 0.0) + np.maximum(stations - length, 0.0)
    squared = np.square(offsets) + np.square(beyond)
    capped = np.minimum(squared, COSTS.max_squared_distance_m2)
    return np.asarray(capped + COSTS.yaw_m2 * (1.0 - np.cos(turns)))


def _best_lane_change(
    network: LaneNetwork, ranked: Sequence[_Candidate], poses: Floats
) -> _Candidate:
    """Return the best candidate, or a change between two of them that is sufficiently better."""
    best = ranked[0]
    for before, after in product(ranked, repeat=2):
        k, cost = _change_sample(before.pose_costs, after.pose_costs)
        worth = cost < best.cost - COSTS.lane_change_gain_m2
        if worth and _may_change(network, before.chain, after.chain):
            curve = lane_change_curve(before.curve, after.curve, poses[k, :2])
            if curve is not None:
                chain = tuple(dict.fromkeys((*before.chain, *after.chain)))
                stations, _ = curve.project(poses[:, :2])
                best = _Candidate(chain, cost, curve, stations, before.pose_costs)
    return best


def _change_sample(before: Floats, after: Floats) -> tuple[int, float]:
    """Return the sample at which to change between two chains, and the mean cost [m²].

    The cost is infinite if the sample is one of the first two or the last three.
    """
    total = np.cumsum(before)[:-1] + (after.sum() - np.cumsum(after))[:-1]
    k = int(np.argmin(total))
    inner = 2 <= k < len(before) - 3
    return k, float(total[k]) / len(before) if inner else math.inf


def _may_change(network: LaneNetwork, chain: LaneChain, other: LaneChain) -> bool:
    """Return whether traffic may change from a chain to another."""
    return any(k in network.lanes[lane].neighbours for lane in chain for k in other)


def lane_change_curve(first: Curve, second: Curve, at: Floats) -> Curve | None:
    """Return a smooth change from one curve to another around a place (2,) [m].

    The blend is x³(10 - 15x + 6x²).
    """
    station = float(first.project(at[None])[0][0])
    _, offset = second.project(first.at(np.array([station]))[:, :2])
    reach = lane_change_length(float(offset[0]))
    s = np.arange(0.0, first.length + 1e-9, STEP_M)
    points = first.at(s)[:, :2]
    station_on_second, _ = second.project(points)
    x = np.clip((s - station) / reach + 0.5, 0.0, 1.0)
    share = x**3 * (10.0 - 15.0 * x + 6.0 * np.square(x))
    target = second.at(station_on_second)[:, :2]
    on_second = (station_on_second > 0.0) & (station_on_second < second.length)
    blended = (points + share[:, None] * (target - points))[(s < station) | on_second]
    return Curve.through(blended) if len(blended) > 3 else None


def _moved_starts(
    network: LaneNetwork,
    paths: list[LanePath],
    tracks: Sequence[Track],
    met: PairConflicts,
    scale: float,
    turning: Sequence[Equation],
) -> list[LanePath]:
    """Move the starts so that crossings and gaps are as far along as recorded (least squares)."""
    known = [Equation(((i, 1.0),), path.start, WEIGHTS.placement) for i, path in enumerate(paths)]
    crossing_of = {(a, b): crossing for a, b, crossing in pair_crossings(tracks)}
    for b, a in combinations(range(len(tracks)), 2):
        crossing = crossing_of.get((a, b))
        if crossing is not None:
            along = scale * np.array([crossing.first, crossing.second])
            weight = WEIGHTS.beyond_crossing
            if crossing.driven:
                weight = WEIGHTS.driven_crossing
            elif (b, a) in met and not met[b, a].following:
                weight = WEIGHTS.met_crossing
            known += _crossing_equations(paths, (a, b), along, weight)
        known += _gap_equations(paths, tracks, (a, b), scale)
        known += _gap_equations(paths, tracks, (b, a), scale)
    known += turning
    for i, (path, track) in enumerate(zip(paths, tracks, strict=True)):
        stops = _starts_to_stop(network, path, track, scale)
        known += [Equation(((i, 1.0),), start, WEIGHTS.stop_line) for start in stops]
    starts = solve_placement(range(len(paths)), known)
    return [replace(path, start=starts[i]) for i, path in enumerate(paths)]


def _crossing_equations(
    paths: list[LanePath], pair: tuple[int, int], along: Floats, weight: float
) -> list[Equation]:
    """Return equations that keep the distances `along` (2,) [m] to a crossing, if there is one."""
    first, second = (paths[k] for k in pair)
    stations = crossings(first.curve, second.curve, LIMITS.crossing_angle_rad)
    if not len(stations):
        return []
    expected = np.array([first.start, second.start]) + along
    nearest = stations[int(np.argmin(np.abs(stations - expected).sum(axis=1)))]
    starts = (nearest - along).tolist()
    return [Equation(((i, 1.0),), start, weight) for i, start in zip(pair, starts, strict=True)]


def _gap_equations(
    paths: list[LanePath], tracks: Sequence[Track], pair: tuple[int, int], scale: float
) -> list[Equation]:
    """Return the equation that preserves the gap between a follower and its leader."""
    follower, leader = pair
    gap = _recorded_gap(tracks[follower], tracks[leader])
    if gap is None:
        return []
    start = paths[follower].curve.at(np.array([paths[follower].start]))[:, :2]
    station, offset = paths[leader].curve.project(start)
    if abs(float(offset[0])) >= LIMITS.same_lane_m:
        return []
    shift = float(station[0]) - paths[follower].start
    return [Equation(((follower, 1.0), (leader, -1.0)), scale * gap - shift, WEIGHTS.gap)]


def _recorded_gap(track: Track, leader: Track) -> float | None:
    """Return how far [m] along the leader's path the track's path begins, if it begins on it."""
    start = track.curve.at(0.0)
    station, offset = leader.curve.project(start[None, :2])
    turn = abs(angle_between(leader.curve.at(float(station[0]))[2], start[2]))
    in_lane = abs(float(offset[0])) < LIMITS.same_lane_m and turn < math.radians(30.0)
    return float(station[0]) if in_lane and 0.0 <= station[0] <= leader.travelled else None


def _starts_to_stop(
    network: LaneNetwork, path: LanePath, track: Track, scale: float
) -> Iterator[float]:
    """Yield the starts [m] with which a vehicle stops before a line instead of just past it."""
    if track.still:
        return
    rules = [
        rule
        for rule in network.rules
        if rule.kind == RuleKind.STOP and not set(rule.lanes).isdisjoint(path.lanes)
    ]
    stops = (
        [first for first, _ in runs((track.speed < WAIT_SPEED_MPS) & track.is_present)]
        if rules
        else []
    )
    for rule in rules:
        station = _station_of_line(path, rule)
        if station is None:
            continue
        for k in stops:
            front = scale * float(track.progress[k]) + track.vehicle.length / 2.0
            past = path.start + front - station
            if -LIMITS.before_stop_line_m < past < LIMITS.past_stop_line_m:
                yield station - front - LIMITS.before_stop_line_m


def _station_of_line(path: LanePath, rule: TrafficRule) -> float | None:
    """Return the arc length [m] at which a path meets a stop line, if it does."""
    station, offset = path.curve.project(rule.line.mean(axis=0)[None])
    return float(station[0]) if abs(float(offset[0])) <= LIMITS.same_lane_m else None


def _start_to_turn(path: LanePath, track: Track) -> float | None:
    """Return the nearest start [m] from which the vehicle turns as recorded.

    It is None if the vehicle does so already, or from no start.
    """
    turn, driven = turn_of(track), float(path.progress[-1])
    if track.still or abs(path.turn - turn) < LIMITS.noticeable_turn_error_rad:
        return None
    starts = np.arange(0.0, max(path.curve.length - driven, 0.0), STEP_M)
    error = path.curve.at(starts + driven)[:, 2] - path.curve.at(starts)[:, 2] - turn
    alike = starts[np.abs(error) < LIMITS.noticeable_turn_error_rad / 2.0]
    return float(alike[np.argmin(np.abs(alike - path.start))]) if len(alike) else None


def _judged(
    graph: LaneGraph,
    paths: Sequence[LanePath],
    tracks: Sequence[Track],
    poses: Floats,
    cost: float,
) -> Match:
    """Return the match of lane paths near poses (N, K, 3), with a further cost, and a reason."""
    driven = list(zip(paths, tracks, strict=True))
    cost += sum(map(_resemblance_cost, paths, poses)) / len(tracks)
    lost = [
        crossing.driven
        for a, b, crossing in pair_crossings(tracks)
        if not len(crossings(paths[a].curve, paths[b].curve, LIMITS.crossing_angle_rad))
    ]
    cost += COSTS.lost_driven_crossing_m2 * sum(lost)
    cost += COSTS.lost_crossing_m2 * (len(lost) - sum(lost))
    lateral = [lateral_acceleration(path, track) for path, track in driven]
    cost += speeding_cost(graph.network, paths, tracks) + bend_cost(lateral)
    short = [reason for path, track in driven for reason in _missing_length(path, track)]
    reasons = short + [
        f"the lanes bend too sharply for the speed of vehicle {track.vehicle.id}"
        for each, track in zip(lateral, tracks, strict=True)
        if each.forced > LIMITS.grip_mps2
    ]
    return Match(
        tuple(paths),
        cost,
        next(iter(reasons), ""),
        max(each.forced for each in lateral),
        off_reserved_cost(graph, paths, tracks),
        sum(lost),
        np.array(list(starmap(_window_on, driven))) if reasons and reasons == short else None,
    )


def _missing_length(path: LanePath, track: Track) -> Iterator[str]:
    """Yield by how much the lane path of a vehicle is too short."""
    half = track.vehicle.length / 2.0 + LIMITS.end_room_m
    short = max(half - path.start, path.end + half - path.curve.length)
    if short > float(path.progress[-1]):  # it would drive beyond them
        yield _NO_LANES.format(track.vehicle.id)
    elif short > 0.0:
        yield f"the lanes of vehicle {track.vehicle.id} are {short:.1f} m too short"


def _window_on(path: LanePath, track: Track) -> tuple[float, float]:
    """Return from when to when [s] the footprint of a vehicle is on its lane path."""
    half = track.vehicle.length / 2.0 + LIMITS.end_room_m
    ends = np.array([half, path.curve.length - half]) - path.start
    first = int(np.searchsorted(path.progress, ends[0]))
    stop = int(np.searchsorted(path.progress, ends[1], side="right"))
    return first * track.dt, (stop - 1) * track.dt


def _resemblance_cost(path: LanePath, poses: Floats) -> float:
    """Return the mean cost [m²] of the driven part of a path that differs from poses (K, 3)."""
    driven = path.curve.at(np.linspace(path.start, path.end, len(poses)))
    squared = np.square(driven[:, 0] - poses[:, 0]) + np.square(driven[:, 1] - poses[:, 1])
    capped = np.minimum(squared, COSTS.max_squared_distance_m2)
    turned = 1.0 - np.cos(driven[:, 2] - poses[:, 2])
    return float(capped.mean() + COSTS.yaw_m2 * turned.mean())

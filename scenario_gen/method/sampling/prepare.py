# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""From an encounter and its routes to a model that draws candidates: the nominal clock, and every vehicle's mean speed on it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.method.sampling.candidates import VehicleModel
from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.deviations import (
    lateral_covariance_root,
    lateral_room,
    MAX_ROOM_SIGMAS,
    road_ahead,
    ROOM_SIGMAS,
)
from scenario_gen.method.sampling.freedom import FADES, Freedom, freedom_of, MOST_ONWARD, OwnClock
from scenario_gen.method.sampling.model import CandidateModel
from scenario_gen.method.sampling.pace import clock_of, slowed_clock, template_grid
from scenario_gen.method.sampling.plan import Plan
from scenario_gen.method.sampling.routed_vehicle import MeanSpeed, routed_vehicle, RoutedVehicle
from scenario_gen.method.sampling.speed_profile.mean import Bounds, Motion
from scenario_gen.method.sampling.speed_profile.model import speed_model
from scenario_gen.method.sampling.speed_profile.stops import least_shares, standing_part
from scenario_gen.method.sampling.time_warp import Clock, TimeWarp
from scenario_gen.method.sampling.window import window_of
from scenario_gen.numerics import Bools, Floats
from scenario_gen.roads import ground_for
from scenario_gen.situation import Situation
from scenario_gen.types import (
    FOLLOW,
    Note,
    NoteKind,
    ReactionGraph,
    Road,
)

_STRETCHES = 9
_TIME_SHARE = (
    1.0 / 3.0
)  # of the duration, at most: what varies more slowly between given ends hardly varies
_FREE_SHIFT = (
    1.5  # m, by which changepoints may be passed from their place before the clock is stretched
)
_ANSWERS = 1.4  # times the bound of one that reacts to nobody
_HALTS = 0.3  # m/s; who is slower at an end of the template halts there, in every scenario
_REPORTED_PACE, _REPORTED_SHIFT, _REPORTED_JERK = (
    0.02,
    0.3,
    0.2,
)  # slowing, m and m/s³ from which on they are reported


@dataclass(frozen=True, eq=False)
class Prepared:
    """A model of candidates, or why there is none.

    Attributes:
        model: draws candidates; None if no speed exists even for the undisturbed routes.
        adaptations: what was changed to get there.
        refusal: why there is no model, "" if there is one.
    """

    model: CandidateModel | None
    adaptations: tuple[Note, ...]
    refusal: str = ""


def prepare(plan: Plan, config: SamplingConfig, order: str = "keep") -> Prepared:
    """Build the model: on the template's clock, slowed ahead of bends, and stretched only where no speed exists otherwise.

    Raises:
        InputError: routes, segmentation and encounter disagree in their numbers.
    """
    config = config.drawn
    encounter, road, routes, requested = plan.encounter, plan.road, plan.routes, plan.requested
    times = encounter.time[
        np.concatenate(
            [[0], plan.segmentation.changepoints, [encounter.speed.shape[1] - 1]]
        ).astype(np.int64)
    ]
    if len(routes) != len(encounter.vehicles) or any(
        len(route.anchor) != len(times) for route in routes
    ):
        raise InputError(
            f"{len(routes)} routes do not suit {len(encounter.vehicles)} vehicles with {len(times)} anchors each"
        )
    waits = [standing_part(encounter, wait) for wait in plan.waits]
    routed_vehicles = [
        routed_vehicle(n, plan, times, waits, config) for n in range(len(encounter.vehicles))
    ]
    clock, notes = _slowed(routed_vehicles, template_grid(encounter), config)
    left = (1.0 + config.max_stretch) * float(times[-1]) / float(clock.time[-1])
    best: tuple[float, float, list[MeanSpeed]] | None = None
    failed: list[tuple[RoutedVehicle, str]] = []
    for stretch in np.linspace(1.0, max(left, 1.0), _STRETCHES if left > 1.0 else 1).tolist():
        means = [
            routed.mean(clock_of(clock.grid, stretch * clock.rate)) for routed in routed_vehicles
        ]
        feasible = [mean for mean in means if not isinstance(mean, str)]
        if len(feasible) < len(means):
            failed = [
                (routed, m)
                for routed, m in zip(routed_vehicles, means, strict=True)
                if isinstance(m, str)
            ]
            continue
        shift = max(
            routed.largest_shift(mean[0])
            for routed, mean in zip(routed_vehicles, feasible, strict=True)
        )
        if best is None or shift < best[0] - _FREE_SHIFT:
            best = shift, stretch, feasible
        if shift <= _FREE_SHIFT:
            break
    if best is None:
        reasons = (
            f"vehicle {routed.vehicle.id} {reason}{routed.blamed(clock)}"
            for routed, reason in failed
        )
        return Prepared(None, (), "; ".join(reasons))
    _, stretch, feasible = best
    if stretch > 1.0:
        notes.append(Note.of(NoteKind.STRETCHED, percent=100.0 * (stretch - 1.0)))
    warp = TimeWarp(
        clock_of(clock.grid, stretch * clock.rate), config, least_shares(clock.grid, waits)
    )
    vehicles = [
        _model(routed, road, *mean, config, notes)
        for routed, mean in zip(routed_vehicles, feasible, strict=True)
    ]
    reactions, window = kept_reactions(plan.situation, config, order), None
    if config.variety == "wide":
        answers = {edge.who for edge in reactions.edges}
        tied, gaps = (
            (requested.relaxed[..., 0] == 0.0).any(axis=0),
            plan.situation.least_gaps.tolist(),
        )
        vehicles = [
            replace(
                v,
                freedom=_freedom(
                    routed,
                    n in answers,
                    warp.nominal,
                    requested.relaxed[n],
                    tied,
                    road,
                    gaps[n],
                    config,
                ),
            )
            for n, (v, routed) in enumerate(zip(vehicles, routed_vehicles, strict=True))
        ]
        window = window_of(plan.situation, config.leave_out, tied)
    return Prepared(CandidateModel(tuple(vehicles), warp, reactions, window), tuple(notes))


def kept_reactions(
    situation: Situation, config: SamplingConfig, order: str = "keep"
) -> ReactionGraph:
    """Return the reactions of the template that scenarios keep, without edges where none is to be kept.

    Where an `order` other than the template's is requested, nobody is made to wait for anybody.
    """
    graph = situation.reactions
    if config.reactions != "keep":
        return replace(graph, edges=())
    return replace(
        graph, edges=tuple(edge for edge in graph.edges if order == "keep" or edge.kind == FOLLOW)
    )


def _freedom(
    routed: RoutedVehicle,
    answers: bool,
    nominal: Clock,
    relaxed: Floats,
    tied: Bools,
    road: Road,
    gap: float,
    config: SamplingConfig,
) -> Freedom:
    """What preset `wide` relaxes for a vehicle that came so near [m] to others in the template, and `answers` one or not."""
    config = config.of(routed.vehicle.kind)
    fastest = (
        routed.speed[[0, -1]]
        + config.freedom * config.end_speed_sigma
        + 2.0 * routed.limits.max_acceleration * FADES
    )
    ahead = road_ahead(
        routed.path, routed.vehicle, ground_for(road, routed.vehicle), MOST_ONWARD * fastest
    )
    clock = OwnClock.of(nominal, routed.rests, (bool(tied[0]), bool(tied[1])), config)
    if answers:  # what the other one does comes on top of its own
        clock = replace(clock, bound=_ANSWERS * clock.bound)
    relaxed = np.where([[True, drives] for drives in routed.speed[[0, -1]] > _HALTS], relaxed, 0.0)
    return freedom_of(routed.vehicle, routed.path.arc, clock, relaxed, tied, ahead, gap, config)


def _slowed(
    routed_vehicles: Sequence[RoutedVehicle], grid: Floats, config: SamplingConfig
) -> tuple[Clock, list[Note]]:
    """The nominal clock on template times (G,) [s], and the notes on it."""
    plain = clock_of(grid, np.ones(len(grid)))
    slowdowns = []
    for routed in routed_vehicles:
        mean = routed.without_bends.mean(plain)
        slowdowns.append(
            np.ones(len(grid)) if isinstance(mean, str) else routed.slowdown(mean[0], grid)
        )
    clock = slowed_clock(grid, slowdowns, 1.0 + config.max_stretch)
    if clock.rate.max() < 1.0 + _REPORTED_PACE:
        return plain, []
    worst, k = divmod(int(np.argmax(slowdowns)), len(grid))
    return clock, [
        Note.of(
            NoteKind.SLOWED,
            percent=100.0 * (1.0 - 1.0 / clock.rate.max()),
            vehicle=routed_vehicles[worst].vehicle.id,
            time=grid[k],
            delay=clock.time[-1] - grid[-1],
        )
    ]


def _model(
    routed: RoutedVehicle,
    road: Road,
    mean: Floats,
    motion: Motion,
    bounds: Bounds,
    config: SamplingConfig,
    notes: list[Note],
) -> VehicleModel:
    """The vehicle's model; what was changed for it is added to the notes."""
    name, path, spline = routed.vehicle.id, routed.path, routed.spline
    shift = routed.largest_shift(mean)
    if shift > _REPORTED_SHIFT:
        notes.append(Note.of(NoteKind.CHANGEPOINTS_SHIFTED, vehicle=name, distance=shift))
    jerk = float(np.abs(motion.jerk @ mean).max())
    if jerk > bounds.jerk + _REPORTED_JERK:
        notes.append(Note.of(NoteKind.JERKY, vehicle=name, jerk=jerk, smooth=bounds.jerk))
    room = lateral_room(
        path,
        routed.vehicle,
        ground_for(road, routed.vehicle),
        MAX_ROOM_SIGMAS * config.lateral_sigma,
    )
    narrow = room < ROOM_SIGMAS * config.lateral_sigma
    if narrow.any() and config.lateral_sigma > 0.0 and path.length > 0.0:
        percent = 100.0 * float(narrow.mean())
        notes.append(Note.of(NoteKind.NARROW, vehicle=name, percent=percent))
    length = min(config.longitudinal_time, _TIME_SHARE * float(routed.times[-1] - routed.times[0]))
    sigma = config.of(routed.vehicle.kind).longitudinal_sigma
    speed = speed_model(spline, mean, motion, bounds, routed.time, routed.speed, sigma, length)
    return VehicleModel(
        routed.vehicle,
        path,
        lateral_covariance_root(path, room, config, routed.steering),
        room,
        speed,
    )

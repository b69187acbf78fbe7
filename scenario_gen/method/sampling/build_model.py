# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""From a planned template to a model of candidates: nominal clock, mean speeds, variation."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.method.sampling.candidates import (
    ACCELERATION_DECAY_S,
    CandidateModel,
    MAX_EXTRAPOLATION_S,
)
from scenario_gen.method.sampling.config import SamplingConfig
from scenario_gen.method.sampling.deviations import (
    lateral_covariance_root,
    lateral_room,
    MAX_ROOM_SIGMAS,
    road_ahead,
    ROOM_SIGMAS,
)
from scenario_gen.method.sampling.place_lights import with_lights
from scenario_gen.method.sampling.plan import Plan
from scenario_gen.method.sampling.routed_vehicle import route_vehicle, RoutedVehicle
from scenario_gen.method.sampling.speed_profile.mean import MeanSpeed
from scenario_gen.method.sampling.speed_profile.model import SpeedModel
from scenario_gen.method.sampling.speed_profile.spline import least_shares, standing_part
from scenario_gen.method.sampling.time_warp import (
    Clock,
    clock_from_rate,
    slowed_clock,
    template_grid,
    TimeWarp,
)
from scenario_gen.method.sampling.trimming import trimming_of
from scenario_gen.method.sampling.variation import Variation, VehicleClock
from scenario_gen.method.sampling.vehicle_model import VehicleModel
from scenario_gen.numerics import Bools, Floats
from scenario_gen.roads import ground_for
from scenario_gen.situation import Situation, Wait
from scenario_gen.types import FOLLOW, Note, NoteKind, Reaction, ReactionGraph, Road


@dataclass(frozen=True)
class _Tuning:
    """Choices without a source in the paper.

    Attributes:
        stretches: of the clock that are tried, evenly spaced.
        free_shift: m by which changepoints may move before the clock is stretched further.
        length_share: longest length scale of displacements over the duration: between given ends a
            slower process hardly varies.
        reacting_bound: truncation bound of a reacting vehicle's clock over that of a free one: the
            other vehicle's deviation adds to its own.
        halting_speed: m/s; a vehicle that is slower at an end of the template halts there.
        noted_slowing, noted_shift, noted_jerk: share, m and m/s³ from which changes are noted.
        room_beside: lateral room [m] of a vehicle that shares its lane side by side.
    """

    stretches: int = 9
    free_shift: float = 1.5
    length_share: float = 1.0 / 3.0
    reacting_bound: float = 1.4
    halting_speed: float = 0.3
    noted_slowing: float = 0.02
    noted_shift: float = 0.3
    noted_jerk: float = 0.2
    room_beside: float = 0.1


_TUNING = _Tuning()


@dataclass(frozen=True, eq=False)
class BuiltModel:
    """A model of candidates, or the reason why there is none.

    Attributes:
        model: draws candidates; None if no speed exists even for the undisturbed routes.
        notes: what was adapted.
        refusal: why there is no model, "" if there is one.
    """

    model: CandidateModel | None
    notes: tuple[Note, ...] = ()
    refusal: str = ""


def build_model(plan: Plan, config: SamplingConfig, order: str = "keep") -> BuiltModel:
    """Build the model of candidates.

    Raises:
        InputError: routes, segmentation and encounter disagree in their numbers.
    """
    config = config.scaled
    routed, waits = _route_vehicles(plan, config)
    clock, notes = _nominal_clock(routed, template_grid(plan.encounter), config)
    stretch = _feasible_stretch(routed, clock, config)
    if stretch.means is None:
        return BuiltModel(None, refusal=stretch.refusal)
    abreast = {n for each in plan.abreast for n in each.pair}
    notes += stretch.notes
    models = []
    for n, (each, mean) in enumerate(zip(routed, stretch.means, strict=True)):
        model, vehicle_notes = _vehicle_model(each, plan.road, mean, config, n in abreast)
        models.append(model)
        notes += vehicle_notes
    nominal = stretch.clock
    warp = TimeWarp(nominal, config, least_shares(nominal.grid, waits))
    reactions, trimming = kept_reactions(plan.situation, config, order), None
    if config.drivers > 0.0:
        fixed = (plan.requested.relaxed[..., 0] == 0.0).any(axis=0)
        models = [
            replace(
                model, variation=_variation(n, each, plan, nominal, fixed, reactions.of(n), config)
            )
            for n, (model, each) in enumerate(zip(models, routed, strict=True))
        ]
        trimming = trimming_of(plan.situation, config.leave_out, fixed)
    candidates = CandidateModel(tuple(models), warp, reactions, trimming)
    return BuiltModel(with_lights(candidates, plan), tuple(notes))


def kept_reactions(
    situation: Situation, config: SamplingConfig, order: str = "keep"
) -> ReactionGraph:
    """Return the template's reactions that scenarios keep.

    If another order than the template's is requested, no vehicle has to wait for another one.
    """
    graph = situation.reactions
    edges = [edge for edge in graph.edges if order == "keep" or edge.kind == FOLLOW]
    if config.reactions != "keep":
        return replace(graph, edges=(), stops=(), crossings=())
    return replace(graph, edges=tuple(edges))


def _route_vehicles(plan: Plan, config: SamplingConfig) -> tuple[list[RoutedVehicle], list[Wait]]:
    """Return each vehicle on its route, and the standing parts of the waits."""
    encounter, changes = plan.encounter, plan.segmentation.changepoints
    samples = np.concatenate([[0], changes, [encounter.speed.shape[1] - 1]]).astype(np.int64)
    times = encounter.time[samples]
    anchors = {len(route.anchor) for route in plan.routes}
    if len(plan.routes) != len(encounter.vehicles) or anchors != {len(times)}:
        raise InputError(
            f"{len(plan.routes)} routes do not suit {len(encounter.vehicles)} vehicles "
            f"with {len(times)} anchors each"
        )
    waits = [standing_part(encounter, wait) for wait in plan.waits]
    vehicles = range(len(encounter.vehicles))
    return [route_vehicle(n, plan, times, waits, config) for n in vehicles], waits


def _nominal_clock(
    routed: Sequence[RoutedVehicle], grid: Floats, config: SamplingConfig
) -> tuple[Clock, list[Note]]:
    """Return the nominal clock on template times (G,) [s], slowed before bends, and notes."""
    plain = clock_from_rate(grid, np.ones(len(grid)))
    slowdowns = []
    for vehicle in routed:
        mean = vehicle.without_limit("max_lateral_acceleration").mean(plain)
        slowdown = np.ones(len(grid))
        if not isinstance(mean, str):
            slowdown = vehicle.slowdown(mean.coefficients, grid)
        slowdowns.append(slowdown)
    clock = slowed_clock(grid, slowdowns, 1.0 + config.max_stretch)
    slowest = float(clock.rate.max())
    if slowest < 1.0 + _TUNING.noted_slowing:
        return plain, []
    n, k = divmod(int(np.argmax(slowdowns)), len(grid))
    note = Note.of(
        NoteKind.SLOWED,
        percent=100.0 * (1.0 - 1.0 / slowest),
        vehicle=routed[n].vehicle.id,
        time=grid[k],
        delay=clock.time[-1] - grid[-1],
    )
    return clock, [note]


class _Stretch(NamedTuple):
    """A stretched clock with the mean speeds on it; None and a reason if there are none."""

    clock: Clock
    means: list[MeanSpeed] | None
    notes: list[Note]
    refusal: str


def _feasible_stretch(
    routed: Sequence[RoutedVehicle], clock: Clock, config: SamplingConfig
) -> _Stretch:
    """Return the least stretch of a clock on which all vehicles have a mean speed.

    A longer one is used only if the changepoints then are clearly nearer to their places.
    """
    longest = (1.0 + config.max_stretch) * float(clock.grid[-1] / clock.time[-1])
    count = _TUNING.stretches if longest > 1.0 else 1
    best, least_shift = _Stretch(clock, None, [], ""), np.inf
    failed: list[MeanSpeed | str] = []
    for stretch in np.linspace(1.0, max(longest, 1.0), count).tolist():
        stretched = clock_from_rate(clock.grid, stretch * clock.rate)
        means = [vehicle.mean(stretched) for vehicle in routed]
        feasible = [mean for mean in means if not isinstance(mean, str)]
        if len(feasible) < len(means):
            failed = means
            continue
        shift = _largest_shift(routed, feasible)
        if shift < least_shift - _TUNING.free_shift:
            best, least_shift = _Stretch(stretched, feasible, _stretch_notes(stretch), ""), shift
        if shift <= _TUNING.free_shift:
            break
    return best if best.means else best._replace(refusal=_refusal(routed, failed, clock))


def _largest_shift(routed: Sequence[RoutedVehicle], means: Sequence[MeanSpeed]) -> float:
    """Return the largest distance [m] of any vehicle from a changepoint when it is due."""
    pairs = zip(routed, means, strict=True)
    return max(vehicle.largest_shift(mean.coefficients) for vehicle, mean in pairs)


def _stretch_notes(stretch: float) -> list[Note]:
    """Return the note on a stretched clock, if it is stretched."""
    percent = 100.0 * (stretch - 1.0)
    return [Note.of(NoteKind.STRETCHED, percent=percent)] if percent > 0.0 else []


def _refusal(
    routed: Sequence[RoutedVehicle], means: Sequence[MeanSpeed | str], clock: Clock
) -> str:
    """Return why vehicles have no mean speed, and which limit would help."""
    return "; ".join(
        f"vehicle {vehicle.vehicle.id} {mean}{vehicle.limiting_parameters(clock)}"
        for vehicle, mean in zip(routed, means, strict=True)
        if isinstance(mean, str)
    )


def _vehicle_model(
    routed: RoutedVehicle,
    road: Road,
    mean: MeanSpeed,
    config: SamplingConfig,
    shares_lane: bool,
) -> tuple[VehicleModel, list[Note]]:
    """Return a vehicle's model without variation, and notes; `shares_lane`: with another one."""
    label, path, notes = routed.vehicle.id, routed.path, []
    shift = routed.largest_shift(mean.coefficients)
    if shift > _TUNING.noted_shift:
        notes.append(Note.of(NoteKind.CHANGEPOINTS_SHIFTED, vehicle=label, distance=shift))
    jerk, smooth = float(np.abs(mean.motion.jerk @ mean.coefficients).max()), mean.bounds.jerk
    if jerk > smooth + _TUNING.noted_jerk:
        notes.append(Note.of(NoteKind.JERKY, vehicle=label, jerk=jerk, smooth=smooth))
    ground = ground_for(road, routed.vehicle)
    most = MAX_ROOM_SIGMAS * config.lateral_sigma
    room = lateral_room(
        path, routed.vehicle, ground, min(most, _TUNING.room_beside) if shares_lane else most
    )
    narrow = room < ROOM_SIGMAS * config.lateral_sigma
    if narrow.any() and config.lateral_sigma > 0.0 and path.length > 0.0:
        percent = 100.0 * float(narrow.mean())
        notes.append(Note.of(NoteKind.NARROW, vehicle=label, percent=percent))
    speed = SpeedModel.of(
        routed.spline,
        mean,
        routed.recorded_time,
        routed.recorded_speed,
        config.of(routed.vehicle.kind).longitudinal_sigma,
        min(config.longitudinal_time, _TUNING.length_share * float(np.ptp(routed.times))),
    )
    root = lateral_covariance_root(path, room, config, routed.steering)
    return VehicleModel(routed.vehicle, path, root, room, speed), notes


def _variation(
    n: int,
    routed: RoutedVehicle,
    plan: Plan,
    nominal: Clock,
    fixed: Bools,
    edges: Sequence[Reaction],
    config: SamplingConfig,
) -> Variation:
    """Return what varies of vehicle n.

    Args:
        n: its index.
        routed: the vehicle on its route.
        plan: the template on its road.
        nominal: the clock without deviation.
        fixed: (2,) whether start and end states are requested of any vehicle.
        edges: its reactions to other vehicles.
        config: the standard deviations.
    """
    config = config.of(routed.vehicle.kind)
    speed = routed.recorded_speed[[0, -1]]
    fastest = speed + config.freedom * config.end_speed_sigma
    fastest = fastest + 2.0 * routed.limits.max_acceleration * ACCELERATION_DECAY_S
    ground = ground_for(plan.road, routed.vehicle)
    ahead = road_ahead(routed.path, routed.vehicle, ground, MAX_EXTRAPOLATION_S * fastest)
    clock = VehicleClock.of(nominal, routed.rests, fixed.tolist(), config, edges, plan.limits)
    if edges:
        clock = replace(clock, bound=_TUNING.reacting_bound * clock.bound)
    relaxed = plan.requested.relaxed[n].copy()
    relaxed[speed <= _TUNING.halting_speed, 1] = 0.0
    return Variation.of(
        routed.vehicle,
        routed.path.arc,
        clock,
        relaxed,
        np.where(fixed, 0.0, ahead),
        float(plan.situation.least_gaps[n]),
        config,
    )

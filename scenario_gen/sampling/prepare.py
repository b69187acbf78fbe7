# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""From an encounter and its routes to a model that draws candidates: knots, limits in curves, and feasible times."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from scenario_gen.arrays import Floats
from scenario_gen.errors import InputError
from scenario_gen.sampling.candidates import CandidateModel, knots_on, piece_lengths, VehicleModel
from scenario_gen.sampling.config import SamplingConfig
from scenario_gen.sampling.deviations import (
    lateral_covariance_root,
    lateral_room,
    longitudinal_covariance_root,
    MAX_ROOM_SIGMAS,
    ROOM_SIGMAS,
)
from scenario_gen.sampling.path import BasePath
from scenario_gen.sampling.speed_profile.knots import speed_knots, SpeedKnots, STAND
from scenario_gen.sampling.speed_profile.qp import SpeedBounds, SpeedProfile, SpeedProfileQP
from scenario_gen.sampling.speed_profile.stops import creep_bounds, lengthened, shortest_shares, standing_part
from scenario_gen.sampling.time_warp import TimeWarp
from scenario_gen.template.interaction import Wait
from scenario_gen.types.encounter import Encounter, Vehicle
from scenario_gen.types.road import Road
from scenario_gen.types.route import Route
from scenario_gen.types.scenario import BoundaryStates
from scenario_gen.types.segmentation import Segmentation

SLIDE_SIGMAS = 2.0  # an anchor that slides by so many σ_s is no farther from the template than a sample is anyway
SAMPLE_SLIDE_SIGMAS = 4.0  # by which an anchor of a sample may slide, rather than have its time warp damped
_STRETCHES = 9
_KNOT_SHARES = (None, 0.5, 0.35, 0.65, 0.2, 0.8, 0.1, 0.9)  # of a primitive; None: where the template bends
_CURVE_REACH = 2.0  # m, around a position, in which the route's curvature is looked at
_CURVE_MARGINS = (0.85, 1.0)  # share of the lateral limit that the route itself may use; the rest is the samples'
_CURVE_STEP = 0.5  # s, at which speeds are bounded
_CURVE_NEAR = 0.7  # a speed above this share of its bound may exceed it in a sample
_BOUND_ROUNDS = 6


@dataclass(frozen=True, eq=False)
class Prepared:
    """A model of candidates, or why there is none.

    Attributes:
        model: draws candidates; None if no speed profile exists even for the undisturbed routes.
        adaptations: what was changed to get there, in sentences.
        refusal: why there is no model, "" if there is one.
    """

    model: CandidateModel | None
    adaptations: tuple[str, ...]
    refusal: str = ""


def prepare(
    encounter: Encounter,
    segmentation: Segmentation,
    road: Road,
    routes: Sequence[Route],
    asked: BoundaryStates,
    waits: Sequence[Wait],
    config: SamplingConfig,
    ego: int | None = None,
) -> Prepared:
    """Build the model: first in the template's time, then with anchors slid by little, then in a stretched time.

    Vehicle `ego` is left out of it, with its waits.

    Raises:
        InputError: routes, segmentation and encounter disagree in their numbers.
    """
    times = encounter.time[np.concatenate([[0], segmentation.changepoints, [encounter.speed.shape[1] - 1]]).astype(np.int64)]
    if len(routes) != len(encounter.vehicles) or any(len(route.anchor) != len(times) for route in routes):
        raise InputError(f"{len(routes)} routes do not suit {len(encounter.vehicles)} vehicles with {len(times)} anchors each")
    waits = [standing_part(encounter, wait) for wait in waits]
    driven = [n for n in range(len(encounter.vehicles)) if n != ego]
    vehicles, waits = [encounter.vehicles[n] for n in driven], [wait for wait in waits if wait.vehicle != ego]
    paths = [BasePath.of(routes[n]) for n in driven]
    knots_of = [partial(_knots, n, encounter, times, routes[n], asked, waits) for n in driven]
    slide = SLIDE_SIGMAS * config.longitudinal_sigma
    stretches = np.linspace(1.0, 1.0 + config.max_stretch, _STRETCHES if config.max_stretch > 0.0 else 1)
    reasons: list[str] = []
    for most, factors in ((slide, stretches), (np.inf, stretches)):
        for stretch in factors.tolist():
            stretched = stretch * times
            tried = [_nominal(path, at, times, stretched, most, config) for path, at in zip(paths, knots_of, strict=True)]
            reasons = [f"vehicle {v.id} {why}" for v, why in zip(vehicles, tried, strict=True) if isinstance(why, str)]
            if not reasons:
                found = [nominal for nominal in tried if isinstance(nominal, _Nominal)]
                warp = TimeWarp(stretched, config, shortest_shares(times, waits))
                return _model(vehicles, road, times, warp, paths, found, config)
    return Prepared(None, (), "; ".join(reasons))


def _knots(
    n: int, encounter: Encounter, times: Floats, route: Route, asked: BoundaryStates, waits: Sequence[Wait], share: float | None
) -> SpeedKnots:
    """The knots of vehicle n; a route without length stands throughout, whatever speed is asked."""
    dwells = route.anchor[:-1] == route.anchor[1:]
    own, creeps = lengthened(n, waits, creeping=False), lengthened(n, waits, creeping=True)
    ends = (float(asked.start[n, 3]), float(asked.end[n, 3]))
    if dwells.all():
        ends = (0.0, 0.0)
    knots = speed_knots(times, dwells, own, encounter.time, encounter.speed[n], ends, 0.5, creeps)
    standing = [v if v > STAND or not still else 0.0 for v, still in zip(ends, knots.still[[0, -1]], strict=True)]
    return speed_knots(times, dwells, own, encounter.time, encounter.speed[n], (standing[0], standing[1]), share, creeps)


@dataclass(frozen=True, eq=False)
class _Nominal:
    """A vehicle that can be driven: its speed profile QP, its anchors after sliding, and by how much the farthest slid [m]."""

    qp: SpeedProfileQP
    anchor: Floats
    slid: float


def _nominal(
    path: BasePath,
    knots_at: Callable[[float | None], SpeedKnots],
    times: Floats,
    stretched: Floats,
    most: float,
    config: SamplingConfig,
) -> _Nominal | str:
    """How the undisturbed route can be driven in the times `stretched` (K + 2,) [s], or why it cannot.

    With the knots where the template bends if possible, else elsewhere; well within the lateral limit, else just.
    """
    reason = ""
    for share in _KNOT_SHARES:
        for margin in _CURVE_MARGINS:
            found = _feasible(path, knots_at(share), times, stretched, most, config, margin)
            if isinstance(found, _Nominal):
                return found
            reason = reason or found
    return reason


def _feasible(
    path: BasePath, knots: SpeedKnots, times: Floats, stretched: Floats, most: float, config: SamplingConfig, margin: float
) -> _Nominal | str:
    """Anchors and speed bounds with which the undisturbed route can be driven in `stretched` times, or why it cannot."""
    curve, arc = path.displaced(np.zeros((1, len(path.node))))
    knot = knots_on(stretched[None], times, knots)
    lengths = piece_lengths(knots, curve, arc, path.spacing, path.anchor[None])
    creep, bounds = creep_bounds(knots), SpeedBounds.none()
    for _ in range(_BOUND_ROUNDS):
        qp = SpeedProfileQP(knots, config, creep.and_(bounds))
        speed, ok = qp.solve(knot, lengths)
        anchor, slid = path.anchor, 0.0
        if not ok[0]:
            speed, ok, moved = qp.slide(knot, lengths)
            if not ok[0]:
                limit = "" if len(bounds.interval) == 0 else " through its curves"
                return f"cannot drive {path.length:.1f} m{limit} in {stretched[-1]:.1f} s within the limits"
            anchor, slid = _slide(path.anchor, knots, moved[0])
            if slid > most:
                return f"would have to pass a changepoint {slid:.1f} m from its place"
        needed, kept = _curve_bounds(path, SpeedProfile(knot[0], speed[0]), knots, margin * config.max_lateral_acceleration)
        if kept and (len(bounds.interval) or not len(needed.interval)):
            return _Nominal(qp, anchor, slid)
        bounds = needed
    return f"cannot drive its curves within {config.max_lateral_acceleration:g} m/s² sideways in {stretched[-1]:.1f} s"


def _slide(anchor: Floats, knots: SpeedKnots, moved: Floats) -> tuple[Floats, float]:
    """Anchors moved so that constraint g ends `moved[g]` farther along, and the largest movement [m]."""
    slid = anchor.copy()
    before = 0.0
    for (first, last), after in zip(knots.bounds, moved, strict=True):
        inside = slice(first + 1, last + 1)
        slid[inside] += np.where(anchor[inside] > anchor[first], after, before)
        before = after
    return slid, float(np.abs(slid - anchor).max())


def _curve_bounds(path: BasePath, profile: SpeedProfile, knots: SpeedKnots, limit: float) -> tuple[SpeedBounds, bool]:
    """Speed bounds wherever the route's curvature might ask for them, and whether the profile itself keeps to the limit."""
    from scipy.ndimage import maximum_filter1d  # slow to import

    if len(path.node) == 1:
        return SpeedBounds.none(), True
    bend = np.abs(path.curvature)
    wide = maximum_filter1d(bend, 2 * int(np.ceil(_CURVE_REACH / path.spacing)) + 1, mode="nearest")
    s, v, _ = profile.state(np.linspace(profile.time[0], profile.time[-1], 20 * len(knots.knot)))
    kept = bool((np.square(v) * np.interp(s, path.arc, bend)).max() <= limit * 1.02)
    moving = np.flatnonzero(~knots.still)
    steps = np.diff(profile.time)
    parts = np.maximum(np.ceil(steps[moving] / _CURVE_STEP), 4).astype(np.int64)
    interval = np.repeat(moving, parts)
    at = np.concatenate([np.arange(1, n + 1) / n for n in parts.tolist()])
    s, v, _ = profile.state(profile.time[interval] + at * steps[interval])
    most = np.sqrt(limit / np.maximum(np.interp(s, path.arc, wide), 1e-6))
    needed = ~((at == 1.0) & (knots.unknown[interval + 1] < 0)) & (v > _CURVE_NEAR * most)
    return SpeedBounds(interval[needed], at[needed], most[needed]), kept


def _model(
    driven: Sequence[Vehicle],
    road: Road,
    times: Floats,
    warp: TimeWarp,
    paths: list[BasePath],
    found: list[_Nominal],
    config: SamplingConfig,
) -> Prepared:
    """The model with a time warp that may start from stretched times."""
    sentences, stretch = [], float(warp.times[-1] / times[-1])
    slide = max(SAMPLE_SLIDE_SIGMAS * config.longitudinal_sigma, *(nominal.slid for nominal in found))
    if stretch > 1.0 + 1e-9:
        sentences.append(f"clock stretched by {100.0 * (stretch - 1.0):.1f} % so that every vehicle can keep to its limits")
    vehicles = []
    for vehicle, path, nominal in zip(driven, paths, found, strict=True):
        if nominal.slid > 1e-6:
            sentences.append(f"vehicle {vehicle.id} passes changepoints up to {nominal.slid:.2f} m from their place")
        room = lateral_room(path, vehicle, road, MAX_ROOM_SIGMAS * config.lateral_sigma)
        narrow = room < ROOM_SIGMAS * config.lateral_sigma
        if narrow.any() and config.lateral_sigma > 0.0 and path.length > 0.0:
            sentences.append(
                f"vehicle {vehicle.id} varies less across {100.0 * narrow.mean():.0f} % of its route, where the road is narrow"
            )
        lateral = lateral_covariance_root(path, room, config)
        longitudinal = longitudinal_covariance_root(times, nominal.anchor, config)
        knots = replace(nominal.qp.knots, knot=nominal.qp.knots.knot * stretch)
        qp = SpeedProfileQP(knots, config, nominal.qp.bounds)
        vehicles.append(VehicleModel(vehicle, path, nominal.anchor, lateral, longitudinal, room, qp))
    return Prepared(CandidateModel(tuple(vehicles), warp, slide), tuple(sentences))

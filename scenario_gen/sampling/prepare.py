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

"""From an encounter and its routes to a model that draws candidates: knots, limits in curves, and a feasible clock."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.ndimage import maximum_filter1d

from scenario_gen.arrays import Floats
from scenario_gen.encounter import Encounter, Vehicle
from scenario_gen.errors import InputError
from scenario_gen.interaction import Wait
from scenario_gen.planning.route import Route
from scenario_gen.roads.road import Road
from scenario_gen.sampling.along import along_factor
from scenario_gen.sampling.candidates import CandidateModel, knots_on, piece_lengths, VehicleModel
from scenario_gen.sampling.clock import Clock
from scenario_gen.sampling.config import SamplingConfig
from scenario_gen.sampling.ego import others
from scenario_gen.sampling.lateral import lateral_factor, lateral_room, MOST_SIGMAS, ROOM_SIGMAS
from scenario_gen.sampling.path import BasePath
from scenario_gen.sampling.time_law import SpeedBounds, SpeedProfile, TimeLaw
from scenario_gen.sampling.time_layout import layout, STAND, TimeLayout
from scenario_gen.sampling.waits import creep_bounds, fastest_paces, lengthened, standing_part
from scenario_gen.scenario import BoundaryStates
from scenario_gen.segmentation.result import Segmentation

SLIDE_SIGMAS = 2.0  # an anchor that slides by so many σ_s is no farther from the template than a sample is anyway
SAMPLE_SLIDE_SIGMAS = 4.0  # by which an anchor of a sample may slide, rather than have its clock drawn back
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
    """Build the model: first on the template's clock, then with anchors slid by little, then with the clock stretched.

    Vehicle `ego` is left out of it, with its waits.

    Raises:
        InputError: routes, segmentation and encounter disagree in their numbers.
    """
    times = encounter.time[np.concatenate([[0], segmentation.changepoints, [encounter.speed.shape[1] - 1]]).astype(np.int64)]
    if len(routes) != len(encounter.vehicles) or any(len(route.anchor) != len(times) for route in routes):
        raise InputError(f"{len(routes)} routes do not suit {len(encounter.vehicles)} vehicles with {len(times)} anchors each")
    waits = [standing_part(encounter, wait) for wait in waits]
    driven = others(encounter, ego)
    vehicles, waits = [encounter.vehicles[n] for n in driven], [wait for wait in waits if wait.vehicle != ego]
    paths = [BasePath.of(routes[n]) for n in driven]
    lays = [partial(_layout, n, encounter, times, routes[n], asked, waits) for n in driven]
    slide = SLIDE_SIGMAS * config.longitudinal_sigma
    stretches = np.linspace(1.0, 1.0 + config.max_stretch, _STRETCHES if config.max_stretch > 0.0 else 1)
    reasons: list[str] = []
    for most, factors in ((slide, stretches), (np.inf, stretches)):
        for stretch in factors.tolist():
            clock = stretch * times
            tried = [_nominal(path, lay, times, clock, most, config) for path, lay in zip(paths, lays, strict=True)]
            reasons = [f"vehicle {v.id} {why}" for v, why in zip(vehicles, tried, strict=True) if isinstance(why, str)]
            if not reasons:
                found = [nominal for nominal in tried if isinstance(nominal, _Nominal)]
                return _model(vehicles, road, times, Clock(clock, config, fastest_paces(times, waits)), paths, found, config)
    return Prepared(None, (), "; ".join(reasons))


def _layout(
    n: int, encounter: Encounter, times: Floats, route: Route, asked: BoundaryStates, waits: Sequence[Wait], share: float | None
) -> TimeLayout:
    """The knots of vehicle n; a route without length stands throughout, whatever speed is asked."""
    dwells = route.anchor[:-1] == route.anchor[1:]
    own, creeps = lengthened(n, waits, creeping=False), lengthened(n, waits, creeping=True)
    ends = (float(asked.start[n, 3]), float(asked.end[n, 3]))
    if dwells.all():
        ends = (0.0, 0.0)
    lay = layout(times, dwells, own, encounter.time, encounter.speed[n], ends, 0.5, creeps)
    standing = [v if v > STAND or not still else 0.0 for v, still in zip(ends, lay.still[[0, -1]], strict=True)]
    return layout(times, dwells, own, encounter.time, encounter.speed[n], (standing[0], standing[1]), share, creeps)


@dataclass(frozen=True, eq=False)
class _Nominal:
    """A vehicle that can be driven: its time law, its anchors after sliding, and by how much the farthest slid [m]."""

    law: TimeLaw
    anchor: Floats
    slid: float


def _nominal(
    path: BasePath,
    lay: Callable[[float | None], TimeLayout],
    times: Floats,
    clock: Floats,
    most: float,
    config: SamplingConfig,
) -> _Nominal | str:
    """How the undisturbed route can be driven on `clock`, or why it cannot.

    With the knots where the template bends if possible, else elsewhere; well within the lateral limit, else just.
    """
    reason = ""
    for share in _KNOT_SHARES:
        for margin in _CURVE_MARGINS:
            found = _feasible(path, lay(share), times, clock, most, config, margin)
            if isinstance(found, _Nominal):
                return found
            reason = reason or found
    return reason


def _feasible(
    path: BasePath, lay: TimeLayout, times: Floats, clock: Floats, most: float, config: SamplingConfig, margin: float
) -> _Nominal | str:
    """Anchors and speed bounds with which the undisturbed route can be driven on `clock`, or why it cannot."""
    curve, arc = path.displaced(np.zeros((1, len(path.node))))
    knot = knots_on(clock[None], times, lay)
    lengths = piece_lengths(lay, curve, arc, path.spacing, path.anchor[None])
    creep, bounds = creep_bounds(lay), SpeedBounds.none()
    for _ in range(_BOUND_ROUNDS):
        law = TimeLaw(lay, config, creep.and_(bounds))
        speed, ok = law.solve(knot, lengths)
        anchor, slid = path.anchor, 0.0
        if not ok[0]:
            speed, ok, moved = law.slide(knot, lengths)
            if not ok[0]:
                limit = "" if len(bounds.interval) == 0 else " through its curves"
                return f"cannot drive {path.length:.1f} m{limit} in {clock[-1]:.1f} s within the limits"
            anchor, slid = _slide(path.anchor, lay, moved[0])
            if slid > most:
                return f"would have to pass a changepoint {slid:.1f} m from its place"
        needed, kept = _curve_bounds(path, SpeedProfile(knot[0], speed[0]), lay, margin * config.max_lateral_acceleration)
        if kept and (len(bounds.interval) or not len(needed.interval)):
            return _Nominal(law, anchor, slid)
        bounds = needed
    return f"cannot drive its curves within {config.max_lateral_acceleration:g} m/s² sideways in {clock[-1]:.1f} s"


def _slide(anchor: Floats, lay: TimeLayout, moved: Floats) -> tuple[Floats, float]:
    """Anchors moved so that constraint g ends `moved[g]` farther along, and the largest movement [m]."""
    slid = anchor.copy()
    before = 0.0
    for (first, last), after in zip(lay.bounds, moved, strict=True):
        inside = slice(first + 1, last + 1)
        slid[inside] += np.where(anchor[inside] > anchor[first], after, before)
        before = after
    return slid, float(np.abs(slid - anchor).max())


def _curve_bounds(path: BasePath, profile: SpeedProfile, lay: TimeLayout, limit: float) -> tuple[SpeedBounds, bool]:
    """Speed bounds wherever the route's curvature might ask for them, and whether the profile itself keeps to the limit."""
    if len(path.node) == 1:
        return SpeedBounds.none(), True
    bend = np.abs(path.curvature)
    wide = maximum_filter1d(bend, 2 * int(np.ceil(_CURVE_REACH / path.spacing)) + 1, mode="nearest")
    s, v, _ = profile.state(np.linspace(profile.time[0], profile.time[-1], 20 * len(lay.knot)))
    kept = bool((np.square(v) * np.interp(s, path.arc, bend)).max() <= limit * 1.02)
    moving = np.flatnonzero(~lay.still)
    steps = np.diff(profile.time)
    parts = np.maximum(np.ceil(steps[moving] / _CURVE_STEP), 4).astype(np.int64)
    interval = np.repeat(moving, parts)
    at = np.concatenate([np.arange(1, n + 1) / n for n in parts.tolist()])
    s, v, _ = profile.state(profile.time[interval] + at * steps[interval])
    most = np.sqrt(limit / np.maximum(np.interp(s, path.arc, wide), 1e-6))
    needed = ~((at == 1.0) & (lay.unknown[interval + 1] < 0)) & (v > _CURVE_NEAR * most)
    return SpeedBounds(interval[needed], at[needed], most[needed]), kept


def _model(
    driven: Sequence[Vehicle],
    road: Road,
    times: Floats,
    clock: Clock,
    paths: list[BasePath],
    found: list[_Nominal],
    config: SamplingConfig,
) -> Prepared:
    """The model on a clock that may be stretched."""
    said, stretch = [], float(clock.times[-1] / times[-1])
    slide = max(SAMPLE_SLIDE_SIGMAS * config.longitudinal_sigma, *(nominal.slid for nominal in found))
    if stretch > 1.0 + 1e-9:
        said.append(f"clock stretched by {100.0 * (stretch - 1.0):.1f} % so that every vehicle can keep to its limits")
    vehicles = []
    for vehicle, path, nominal in zip(driven, paths, found, strict=True):
        if nominal.slid > 1e-6:
            said.append(f"vehicle {vehicle.id} passes changepoints up to {nominal.slid:.2f} m from their place")
        room = lateral_room(path, vehicle, road, MOST_SIGMAS * config.lateral_sigma)
        narrow = room < ROOM_SIGMAS * config.lateral_sigma
        if narrow.any() and config.lateral_sigma > 0.0 and path.length > 0.0:
            said.append(
                f"vehicle {vehicle.id} varies less across {100.0 * narrow.mean():.0f} % of its route, where the road is narrow"
            )
        factor = lateral_factor(path, room, config)
        law = TimeLaw(_rescaled(nominal.law.layout, stretch), config, nominal.law.bounds)
        vehicles.append(
            VehicleModel(vehicle, path, nominal.anchor, factor, along_factor(times, nominal.anchor, config), room, law)
        )
    return Prepared(CandidateModel(tuple(vehicles), clock, slide), tuple(said))


def _rescaled(lay: TimeLayout, stretch: float) -> TimeLayout:
    """The same knots on a clock stretched by `stretch`."""
    return replace(lay, knot=lay.knot * stretch) if stretch != 1.0 else lay

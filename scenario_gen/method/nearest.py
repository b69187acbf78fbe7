# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The nearest request that is possible: what an impossible one is answered with, each suggestion tried out before it is made."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice

import numpy as np

from scenario_gen.base.errors import RefusedError, ScenarioGenError
from scenario_gen.method.chain import Chain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.fitting import LostEncounterError
from scenario_gen.method.sampling import Cancelled, TargetError
from scenario_gen.method.segmentation import segment
from scenario_gen.method.suitable_roads import AUTO, suitable_roads, with_suitable_roads
from scenario_gen.numerics import Floats
from scenario_gen.numerics.boxes import footprint_gaps
from scenario_gen.numerics.curve import Curve
from scenario_gen.numerics.plane import angle_between
from scenario_gen.roads import (
    CORRIDOR,
    draw_route,
    footprint_fits,
    ground_for,
    nearest_pose_with_room,
    road_and_template,
)
from scenario_gen.situation import Situation
from scenario_gen.types import (
    Encounter,
    ENDS,
    GenerationResult,
    Request,
    Road,
    State,
    Vehicle,
    vehicle_index,
)

BISECTIONS = 7
_NAMED = 2  # roads that keep an encounter
ENOUGH = 10  # valid scenarios by which a request counts as possible, if not fewer are wanted
_FAR_ENDS = (1.0, 0.75, 0.5, 0.25)  # shares of a way at which a bisection may begin
_STRETCHES = (0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
FAR_M = 30.0  # m, how far a pose with room is looked for
_OFFSETS = (
    0.25 * np.arange(1, 121)
).tolist()  # m, by which an overlapping footprint is moved along its heading
_MARGINS = (
    0.0,
    0.01,
    0.02,
    0.05,
    0.1,
    0.2,
)  # m, beyond the nearest pose with room, until a pose in whole centimetres has it


def elements(request: Request) -> list[tuple[str, str]]:
    """Return (end, vehicle) of every state that is asked for."""
    return [(end, name) for end in ENDS for name in request.states(end)]


def with_state(request: Request, end: str, name: str, state: State) -> Request:
    """Return the request with another state of one vehicle at one end."""
    return request.with_states(end, request.states(end) | {name: state})


def moved(state: State, pose: Floats) -> State:
    """Return the state at another pose (3,) [m, m, rad], in whole centimetres and tenths of a milliradian; its speed stays."""
    return (*np.round(pose[:2], 2).tolist(), round(float(pose[2]), 4), *state[3:])


def _with_room(road: Road, vehicle: Vehicle, pose: Floats, requested: Floats) -> State:
    """The pose in whole centimetres, as little beyond the nearest one as its footprint then needs."""
    away = (pose - requested)[:2] / np.hypot(*(pose - requested)[:2])
    for margin in _MARGINS:
        tried = np.array([*np.round(pose[:2] + margin * away, 2), requested[2]])
        if footprint_fits(ground_for(road, vehicle), tried[None], vehicle.length, vehicle.width)[
            0
        ]:
            return tuple(tried.tolist())
    return tuple(pose.tolist())


Path = Callable[[float], Request]


@dataclass(frozen=True)
class Suggestion:
    """A request that is possible, the stretch of the clock it needs (None: the one in effect), and the change in words."""

    request: Request
    message: str
    max_stretch: float | None = None


class ImpossibleError(RefusedError):
    """The request is impossible; `suggestions` are possible."""

    def __init__(self, reason: str, suggestions: tuple[Suggestion, ...]) -> None:
        offers = "; or ".join(suggestion.message for suggestion in suggestions)
        super().__init__(
            f"{reason}. "
            + (f"Nearest possible: {offers}" if offers else "No nearby request was found possible")
        )
        self.suggestions = suggestions


def suggest_nearest(
    error: RefusedError, requested: Chain, cancelled: Cancelled = lambda: False
) -> RefusedError:
    """Return a refusal with the nearest requests that are possible, for a command or node to answer with.

    Args:
        error: what refused the request.
        requested: what was requested.
        cancelled: whether to stop looking; then nothing is suggested.

    Returns:
        A LostEncounterError that names roads that keep the conflict; an ImpossibleError with possible requests where states were
        requested; else the error itself, as where a target or an order is what cannot be had.
    """
    if isinstance(error, TargetError):  # the states are not what is impossible
        return error
    if requested.request.moves:
        search = _Search(replace(requested, count=min(requested.count, ENOUGH)), cancelled)
        suggestions = tuple(search.run())
        return ImpossibleError(str(error), () if cancelled() else suggestions)
    if isinstance(error, LostEncounterError):
        kept = " or ".join(f"road {name}" for name in roads_that_keep(requested))
        return LostEncounterError(f"{error}. Nearest possible: {kept}")
    return error


def answer_refusal(
    error: RefusedError,
    encounter: Encounter,
    road: Road | str,
    config: PipelineConfig,
    request: Request,
    count: int,
    seed: int,
) -> RefusedError:
    """Return what a command answers when `pipeline.generate` refused these arguments: with the nearest requests or roads."""
    if road == AUTO:
        return error
    if not request.moves and not isinstance(error, LostEncounterError | TargetError):
        return with_suitable_roads(error, encounter, road, config, seed)
    road, encounter = road_and_template(road, encounter, config.road)
    segmentation = segment(encounter, config.segmentation, seed)
    return suggest_nearest(
        error, Chain(Situation.of(encounter), segmentation, road, config, request, count, seed)
    )


def roads_that_keep(requested: Chain) -> list[str]:
    """Names of the built-in roads that the template fits with all its conflicts, two at most; else `corridor`, its own road."""
    return list(
        islice(
            suitable_roads(requested.encounter, requested.segmentation, requested.config), _NAMED
        )
    ) or [CORRIDOR]


class _Search:
    """Everything that the suggestions for one request need."""

    def __init__(self, requested: Chain, cancelled: Cancelled) -> None:
        self.requested, self.cancelled = requested, cancelled
        self._plans: dict[tuple[str, str], GenerationResult | None] = {}

    @cached_property
    def base(self) -> dict[str, Floats]:
        """Start and end states of the fitting without any requested, (N, 4) by end; nothing where that is not possible either."""
        try:
            _, fit = replace(self.requested, request=Request()).plan().road_and_fit()
        except ScenarioGenError:
            return {}
        return {"starts": fit.requested.start, "goals": fit.requested.end}

    def possible(self, request: Request, stretch: float | None = None) -> bool:
        """Whether scenarios of the request can be had within its budget."""
        if self.cancelled():
            return False
        config, planned = self.requested.config, self._planned(request)
        if stretch is not None:
            config = replace(config, sampling=replace(config.sampling, max_stretch=stretch))
        if planned is None:
            return False
        try:
            result = replace(self.requested, request=request, config=config).sample(planned)
        except ScenarioGenError:
            return False
        return len(result.generated.scenarios) == self.requested.count

    def _planned(self, request: Request) -> GenerationResult | None:
        """The template with these states on its road; None if they have no place or no way. Its clock has no part in that."""
        key = request.starts, request.goals
        if key not in self._plans:
            try:
                self._plans[key] = replace(self.requested, request=request).plan()
            except ScenarioGenError:
                self._plans[key] = None
        return self._plans[key]

    def run(self) -> Iterator[Suggestion]:
        """Yield suggestions: the plain repair alone if it suffices, else every single change that does, else all at once."""
        start = self._repaired()
        if start != self.requested.request and self.possible(start):
            yield Suggestion(start, self._difference(start))
            return
        improved = False
        for end, name in elements(start):
            for path in self._paths(start, end, name):
                near = self._bisected(path)
                if near is not None:
                    improved = True
                    yield Suggestion(near, self._difference(near))
                    break
        stretched = self._stretched(start)
        if stretched is not None:
            yield stretched
        elif not improved and self.base:
            near = self._bisected(lambda share: self._all_towards_base(start, share))
            if near is not None:
                yield Suggestion(near, self._difference(near))

    def _repaired(self) -> Request:
        """The request with each state moved as little as it takes to have room, and its speed within the limit."""
        request = self.requested.request
        for end, name in elements(request):
            vehicle = self.requested.encounter.vehicles[
                vehicle_index(self.requested.encounter, name, end)
            ]
            state = request.states(end)[name]
            pose = np.array(state[:3])
            ground = ground_for(self.requested.road, vehicle)
            answer = nearest_pose_with_room(ground, pose, vehicle.length, vehicle.width, FAR_M)
            if answer is not None and answer[1] > 0.0:
                state = _with_room(self.requested.road, vehicle, answer[0], pose) + state[3:]
            if len(state) == 4:
                state = (
                    *state[:3],
                    min(state[3], self.requested.config.limits.of(vehicle.type).planned.max_speed),
                )
            request = with_state(request, end, name, state)
        for end, name in elements(request):
            request = self._apart(request, end, name)
        return request

    def _apart(self, request: Request, end: str, name: str) -> Request:
        """Move a footprint that overlaps another one along its heading until it no longer does; as it was, if nowhere is room."""
        vehicles = self.requested.encounter.vehicles
        n = vehicle_index(self.requested.encounter, name, end)
        rows = request.rows(end, self.requested.encounter)[:, :3]
        if self.base:
            rows = np.where(np.isnan(rows), self.base[end][:, :3], rows)
        others = [m for m in range(len(rows)) if m != n and not np.isnan(rows[m, 0])]

        def gap(pose: Floats) -> float:
            gaps = [
                footprint_gaps(vehicles[n].half, pose[None], vehicles[m].half, rows[[m]])[0][0]
                for m in others
            ]
            return float(min(gaps, default=np.inf))

        state = request.states(end)[name]
        if gap(np.array(state[:3])) > 0.0:
            return request
        ahead = np.array([np.cos(state[2]), np.sin(state[2]), 0.0])
        for offset in (sign * step for step in _OFFSETS for sign in (1.0, -1.0)):
            tried = moved(state, np.array(state[:3]) + offset * ahead)
            pose = np.array(tried[:3])
            fits = footprint_fits(
                ground_for(self.requested.road, vehicles[n]),
                pose[None],
                vehicles[n].length,
                vehicles[n].width,
            )[0]
            if fits and gap(pose) >= self.requested.config.fitting.clearance:
                return with_state(request, end, name, tried)
        return request

    # --- ways to change a request: each a function of the share of the way, 0 (as it is) to 1 ---------------------

    def _paths(self, request: Request, end: str, name: str) -> Iterator[Path]:
        """The speed towards the template's, the pose along the drawn route, the pose towards where the fitting has it."""
        n = vehicle_index(self.requested.encounter, name, end)
        state = request.states(end)[name]
        base = self.base[end][n] if self.base else None
        if len(state) == 4:
            target = 0.0 if base is None else float(base[3])
            yield lambda share: with_state(
                request, end, name, (*state[:3], round(state[3] + share * (target - state[3]), 2))
            )
        route = self._route(request, n, name)
        if route is not None:
            yield lambda share: with_state(
                request,
                end,
                name,
                moved(state, route.at((1.0 - share if end == "goals" else share) * route.length)),
            )
        if base is not None:
            turn = angle_between(base[2], state[2])
            step = np.array([base[0] - state[0], base[1] - state[1], turn])
            yield lambda share: with_state(
                request, end, name, moved(state, np.array(state[:3]) + share * step)
            )

    def _all_towards_base(self, request: Request, share: float) -> Request:
        """Every asked state on its way to where the fitting has it: poses, then speeds."""
        for end, name in elements(request):
            *_, pose = self._paths(request, end, name)
            request = pose(share)
            if len(request.states(end)[name]) == 4:
                speed, *_ = self._paths(request, end, name)
                request = speed(share)
        return request

    def _route(self, request: Request, n: int, name: str) -> Curve | None:
        """The route of line, arc and line from the vehicle's start to its goal, where there is one."""
        ends = []
        for end in ENDS:
            requested = request.states(end).get(name)
            if requested is None and not self.base:
                return None
            ends.append(self.base[end][n, :3] if requested is None else np.array(requested[:3]))
        vehicle = self.requested.encounter.vehicles[n]
        road = ground_for(self.requested.road, vehicle)
        return draw_route(
            ends[0],
            ends[1],
            lambda poses: bool(footprint_fits(road, poses, vehicle.length, vehicle.width).all()),
        )

    def _bisected(self, path: Path) -> Request | None:
        """The least change along `path` that is possible, to 1/128 of it; None if even most of it is not enough."""
        far = next((share for share in _FAR_ENDS if self.possible(path(share))), None)
        if far is None:
            return None
        near, best = 0.0, far
        for _ in range(BISECTIONS):
            middle = 0.5 * (near + best)
            near, best = (near, middle) if self.possible(path(middle)) else (middle, best)
        return path(best)

    def _stretched(self, request: Request) -> Suggestion | None:
        """The same states on a longer clock."""
        for stretch in _STRETCHES:
            if stretch > self.requested.config.sampling.max_stretch and self.possible(
                request, stretch
            ):
                before = self.requested.encounter.duration
                message = f"sampling.max_stretch:={stretch:g} (up to {before * (1.0 + stretch):.1f} s instead of {before:.1f} s)"
                other = (
                    ""
                    if request == self.requested.request
                    else f" with {self._difference(request)}"
                )
                return Suggestion(request, message + other, stretch)
        return None

    def _difference(self, request: Request) -> str:
        """What differs from what was asked, as parameters to be set, and by how much."""
        messages = []
        for end in ENDS:
            before, after = self.requested.request.states(end), request.states(end)
            changes = []
            for name in (name for name in after if after[name] != before[name]):
                a, b = before[name], after[name]
                if (distance := float(np.hypot(b[0] - a[0], b[1] - a[1]))) > 0.0:
                    changes.append(f"vehicle {name} {distance:.2f} m away")
                elif a[2] != b[2]:
                    changes.append(f"vehicle {name} turned by {b[2] - a[2]:+.2f} rad")
                if a[3:] != b[3:]:
                    changes.append(f"vehicle {name} {b[3] - a[3]:+.2f} m/s")
            if changes:
                messages.append(f"{end}:='{getattr(request, end)}' ({', '.join(changes)})")
        return " and ".join(messages)

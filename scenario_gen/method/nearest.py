# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What is possible instead of a refused request; every suggestion is tried before it is made."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
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
from scenario_gen.numerics.plane import angle_between
from scenario_gen.roads import (
    CORRIDOR,
    footprint_fits,
    ground_for,
    nearest_pose_with_room,
    road_and_template,
)
from scenario_gen.situation import Situation
from scenario_gen.types import Encounter, ENDS, Request, Road, State, vehicle_index

MAX_SCENARIOS = 10  # valid scenarios by which a request counts as possible
SEARCH_RADIUS_M = 30.0  # within which a pose with room is searched
LENGTH_STEP_M = 0.25  # between the poses that are tried along a vehicle's heading
ROUNDING_M = 0.02  # poses are rounded to centimetres; this much more keeps their room
SHARES = tuple(
    k / 10.0 for k in range(1, 11)
)  # of the way from a requested state to the road's own placement

PARAMETER_FORMS = {
    "starts": "starts:='{}'",
    "goals": "goals:='{}'",
    "max_stretch": "sampling.max_stretch:={}",
}
"""How suggestions write parameters for nodes."""
OPTION_FORMS = {
    "starts": "--start '{}'",
    "goals": "--goal '{}'",
    "max_stretch": "--set sampling.max_stretch={}",
}
"""How suggestions write parameters for the command line."""

StateKey = tuple[str, str]  # "starts" or "goals", and a vehicle's id


@dataclass(frozen=True)
class Suggestion:
    """A possible request.

    Attributes:
        request: the request.
        message: the change as parameters to set.
        max_stretch: the parameter `sampling.max_stretch` that it needs; None: unchanged.
    """

    request: Request
    message: str
    max_stretch: float | None = None


class ImpossibleError(RefusedError):
    """The request is impossible; `suggestions` are possible."""

    def __init__(self, reason: str, suggestions: tuple[Suggestion, ...]) -> None:
        offers = "; or ".join(suggestion.message for suggestion in suggestions)
        advice = f"Nearest possible: {offers}" if offers else "No similar request is possible"
        super().__init__(f"{reason}. {advice}")
        self.suggestions = suggestions


def suggest_nearest(
    error: RefusedError,
    requested: Chain,
    cancelled: Cancelled = lambda: False,
    forms: Mapping[str, str] = PARAMETER_FORMS,
) -> RefusedError:
    """Return a refusal that names possible requests or roads, for the answer of a node.

    Args:
        error: the refusal.
        requested: the refused request.
        cancelled: whether to stop; then nothing is suggested.
        forms: how parameters are written in the message.

    Returns:
        An ImpossibleError with possible requests if states were requested, a LostEncounterError
        with roads that keep the conflict if the road is the reason, else the error itself.
    """
    if isinstance(error, TargetError):  # the states are possible
        return error
    if requested.request.moves:
        limited = replace(requested, count=min(requested.count, MAX_SCENARIOS))
        search = _Search(limited, cancelled, forms)
        suggestions = tuple(search.run())
        return ImpossibleError(str(error), () if cancelled() else suggestions)
    if isinstance(error, LostEncounterError):
        names = suitable_roads(requested.situation, requested.segmentation, requested.config)
        roads = list(islice(names, 2)) or [CORRIDOR]
        offers = " or ".join(f"road {name}" for name in roads)
        return LostEncounterError(f"{error}. Nearest possible: {offers}")
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
    """Return the answer of a command whose call of `generate` with these arguments was refused."""
    if road == AUTO:
        return error
    if not request.moves and not isinstance(error, LostEncounterError | TargetError):
        return with_suitable_roads(error, encounter, road, config, seed)
    road, encounter = road_and_template(road, encounter, config.road)
    segmentation = segment(encounter, config.segmentation, seed)
    chain = Chain(Situation.of(encounter), segmentation, road, config, request, count, seed)
    return suggest_nearest(error, chain, forms=OPTION_FORMS)


def _with_state(request: Request, key: StateKey, state: State) -> Request:
    """Return the request with another state of one vehicle at one end."""
    end, name = key
    return request.with_states(end, request.states(end) | {name: state})


def _rounded(pose: Floats) -> State:
    """Return a pose in whole centimetres and tenths of a milliradian."""
    x, y, yaw = pose.tolist()
    return round(x, 2), round(y, 2), round(yaw, 4)


class _Search:
    """A search for possible requests."""

    def __init__(self, requested: Chain, cancelled: Cancelled, forms: Mapping[str, str]) -> None:
        self._forms = forms
        self._requested = requested
        self._cancelled = cancelled
        self._vehicles = requested.encounter.vehicles
        request = requested.request
        self._keys = [(end, name) for end in ENDS for name in request.states(end)]
        self._placement = self._find_placement()

    def run(self) -> Iterator[Suggestion]:
        """Yield the smallest sufficient repair, else single changes, else all changes at once."""
        repaired = self._repair()
        if repaired != self._requested.request and self._is_possible(repaired):
            yield Suggestion(repaired, self._describe(repaired))
            return
        changes = [self._towards_placement(repaired, [key]) for key in self._keys]
        changed = [suggestion for suggestion in changes if suggestion is not None]
        yield from changed
        stretched = self._stretch(repaired)
        if stretched is not None:
            yield stretched
        elif not changed and (suggestion := self._towards_placement(repaired, self._keys)):
            yield suggestion

    def _find_placement(self) -> dict[str, Floats]:
        """The states (N, 4) at both ends without a request; empty if that is impossible too."""
        try:
            _, fit = replace(self._requested, request=Request()).plan().road_and_fit()
        except ScenarioGenError:
            return {}
        return {"starts": fit.requested.start, "goals": fit.requested.end}

    def _is_possible(self, request: Request, max_stretch: float | None = None) -> bool:
        """Whether enough scenarios of a request are valid."""
        if self._cancelled():
            return False
        config = self._requested.config
        if max_stretch is not None:
            config = replace(config, sampling=replace(config.sampling, max_stretch=max_stretch))
        try:
            result = replace(self._requested, request=request, config=config).run()
        except ScenarioGenError:
            return False
        return len(result.generated.scenarios) == self._requested.count

    def _repair(self) -> Request:
        """Move each state to the nearest pose with room, and limit its speed."""
        request = self._requested.request
        limits = self._requested.config.limits
        for end, name in self._keys:
            vehicle = self._vehicles[vehicle_index(self._requested.encounter, name, end)]
            state = request.states(end)[name]
            pose = np.array(state[:3])
            ground = ground_for(self._requested.road, vehicle)
            nearest = nearest_pose_with_room(
                ground, pose, vehicle.length, vehicle.width, SEARCH_RADIUS_M
            )
            if nearest is not None and nearest[1] > 0.0:
                shift = nearest[0] - pose
                pose = nearest[0] + ROUNDING_M * shift / np.hypot(*shift[:2])
                state = _rounded(pose) + state[3:]
            speed = [min(value, limits.of(vehicle.type).planned.max_speed) for value in state[3:]]
            request = _with_state(request, (end, name), (*state[:3], *speed))
        for key in self._keys:
            request = self._separate(request, key)
        return request

    def _separate(self, request: Request, key: StateKey) -> Request:
        """Move a footprint along its heading until it overlaps no other, if that is possible."""
        end, name = key
        n = vehicle_index(self._requested.encounter, name, end)
        vehicle = self._vehicles[n]
        rows = request.rows(end, self._requested.encounter)[:, :3]
        if self._placement:
            rows = np.where(np.isnan(rows), self._placement[end][:, :3], rows)
        others = [m for m in range(len(rows)) if m != n and not np.isnan(rows[m, 0])]

        def gap(pose: Floats) -> float:
            gaps = [
                footprint_gaps(vehicle.half, pose[None], self._vehicles[m].half, rows[[m]])[0][0]
                for m in others
            ]
            return float(min(gaps, default=np.inf))

        state = request.states(end)[name]
        pose = np.array(state[:3])
        if gap(pose) > 0.0:
            return request
        ground = ground_for(self._requested.road, vehicle)
        clearance = self._requested.config.fitting.clearance
        ahead = np.array([np.cos(pose[2]), np.sin(pose[2]), 0.0])
        steps = np.arange(LENGTH_STEP_M, SEARCH_RADIUS_M, LENGTH_STEP_M)
        for offset in np.column_stack([steps, -steps]).ravel():
            moved = _rounded(pose + offset * ahead)
            tried = np.array(moved)
            fits = footprint_fits(ground, tried[None], vehicle.length, vehicle.width)[0]
            if fits and gap(tried) >= clearance:
                return _with_state(request, key, moved + state[3:])
        return request

    def _towards_placement(self, request: Request, keys: Sequence[StateKey]) -> Suggestion | None:
        """Move states towards the road's own placement, as little as suffices."""
        for share in SHARES if self._placement else ():
            changed = request
            for end, name in keys:
                n = vehicle_index(self._requested.encounter, name, end)
                state = np.array(request.states(end)[name])
                change = self._placement[end][n, : len(state)] - state
                change[2] = angle_between(self._placement[end][n, 2], state[2])
                moved = state + share * change
                speed = [round(value, 3) for value in moved[3:].tolist()]
                changed = _with_state(changed, (end, name), (*_rounded(moved[:3]), *speed))
            if self._is_possible(changed):
                return Suggestion(changed, self._describe(changed))
        return None

    def _stretch(self, request: Request) -> Suggestion | None:
        """Keep the states, and let scenarios last longer."""
        current = self._requested.config.sampling.max_stretch
        duration = self._requested.encounter.duration
        for stretch in (0.25, 0.5, 0.75, 1.0):  # of the recorded duration
            if stretch > current and self._is_possible(request, stretch):
                longer = f"up to {duration * (1.0 + stretch):.1f} s instead of {duration:.1f} s"
                message = f"{self._forms['max_stretch'].format(stretch)} ({longer})"
                if request != self._requested.request:
                    message += f" with {self._describe(request)}"
                return Suggestion(request, message, stretch)
        return None

    def _describe(self, request: Request) -> str:
        """Return the changed parameters, and by how much they differ from the requested ones."""
        messages = []
        for end in ENDS:
            before, after = self._requested.request.states(end), request.states(end)
            changes = [
                change
                for name in after
                if (change := _describe_change(name, before[name], after[name]))
            ]
            if changes:
                states = self._forms[end].format(getattr(request, end))
                messages.append(f"{states} ({', '.join(changes)})")
        return " and ".join(messages)


def _describe_change(name: str, before: State, after: State) -> str:
    """Return how two states of a vehicle differ; "" if they do not."""
    distance = float(np.hypot(after[0] - before[0], after[1] - before[1]))
    changes = []
    if distance > 0.0:
        changes.append(f"{distance:.2f} m away")
    elif before[2] != after[2]:
        changes.append(f"turned by {after[2] - before[2]:+.2f} rad")
    if before[3:] != after[3:]:
        changes.append(f"{after[3] - before[3]:+.2f} m/s")
    return f"vehicle {name} {' and '.join(changes)}" if changes else ""

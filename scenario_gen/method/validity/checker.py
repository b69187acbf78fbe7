# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The checker: proves a scenario valid at every instant, or reports each fault."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.method.validity.collision import contact_violations
from scenario_gen.method.validity.containment import exit_violations, Ground
from scenario_gen.method.validity.dynamics import is_motion, LARGEST_VALUE_RATIO, motion_violations
from scenario_gen.method.validity.limits import Limits
from scenario_gen.method.validity.template_checks import (
    broken_reactions,
    clearance_violations,
    light_violations,
    order_violations,
    presence_violations,
    state_violations,
    tailgaters,
    wait_violations,
)
from scenario_gen.numerics import Bools, Floats
from scenario_gen.numerics.hermite import control_points
from scenario_gen.roads import drives_against, ground_for, RuleCheck
from scenario_gen.situation import (
    Abreast,
    Conflict,
    conflicts_by_pair,
    find_conflicts,
    lane_gaps,
    LaneGaps,
    red_runners,
    required_orders,
    Situation,
    Wait,
)
from scenario_gen.types import (
    at_ends,
    BoundaryStates,
    Cause,
    Reaction,
    Road,
    Scenario,
    SignalStop,
    Vehicle,
    Verdict,
    Violation,
)

_ARRAYS = ("time", "position", "heading", "speed", "acceleration")


@dataclass(eq=False, repr=False)
class Checker:
    """Checks scenarios against a road, requested states, a template and limits.

    Proven at every instant of the motion that `Scenario` defines, not at samples only:
    footprints do not overlap, and each lies inside drivable cells. A scenario is refused if
    that is not proven at `limits.time_resolution`. The other guarantees are listed in
    docs/method.md. Any of road,
    requested, conflicts and waits may be None: those checks are left out, and `not_applicable`
    names them. One checker serves many scenarios of one request.

    Attributes:
        road: the target road.
        requested: start and end states, one per vehicle.
        conflicts: the template's conflicts, whose order must be kept unless `first` differs.
        waits: the template's waits; in every scenario the vehicle stands, or moves slowly, as
            often, one after the other.
        limits: the limits; the default ones if None.
        first: the vehicle that must go first at each conflict, None for either
        (`required_orders`); a conflict whose order is swapped must exist.
        reactions: of the template, which every scenario keeps.
        ends: (N, 2) whether each vehicle is present at the template's first and last instant, as
            it then must be at the scenario's; None if that is not known.
        lane_gaps: the gaps of the template's followers, as `lane_gaps` returns them; None if they
            are not known.
        stops: the template's stops for lights.
        at_red: vehicles that cross a line at red in the template, and so may do it.
        abreast: who shares a lane side by side, at the offset that is kept.

    Examples:
        >>> import scenario_gen as sg
        >>> checker = sg.Checker(None, None, None, None)
        >>> checker.not_applicable[0]
        'off_road: no road is known'
    """

    road: Road | None
    requested: BoundaryStates | None
    conflicts: Sequence[Conflict] | None
    waits: Sequence[Wait] | None
    limits: Limits | None = None
    first: Sequence[int | None] | None = None
    reactions: Sequence[Reaction] = ()
    ends: Bools | None = None
    lane_gaps: LaneGaps | None = None
    stops: Sequence[SignalStop] = ()
    at_red: Collection[int] = ()
    abreast: Sequence[Abreast] = ()

    def __post_init__(self) -> None:
        recorded = tuple(conflict.first for conflict in self.conflicts or ())
        self._first = recorded if self.first is None else tuple(self.first)
        self._limits = self.limits or Limits()
        self._grounds: dict[frozenset[str], Ground] = {}
        lanes = self.road.lanes if self.road is not None else None
        self._rules = None
        if lanes is not None and lanes.rules:
            # the signs of a drawn road follow the template's order, so a swapped order breaks them
            follows_template = not lanes.drawn or self._first == recorded
            self._rules = RuleCheck(lanes) if follows_template else None

    @classmethod
    def of_template(
        cls,
        situation: Situation,
        road: Road,
        requested: BoundaryStates,
        waits: Sequence[Wait],
        limits: Limits | None = None,
        order: str = "keep",
        reactions: Sequence[Reaction] = (),
    ) -> "Checker":
        """Return the checker for scenarios of a template with all of its vehicles.

        Args:
            situation: the template's, whose conflicts are kept.
            road: the target road.
            requested: start and end states of all vehicles.
            waits: the template's waits that are kept.
            limits: the limits; the default ones if None.
            order: the order of passing, see `required_orders`.
            reactions: the template's reactions that are kept.

        Raises:
            RefusedError: the order is to be swapped, and there is none.
        """
        encounter = situation.encounter
        return cls(
            road,
            requested,
            situation.conflicts,
            waits,
            (limits or Limits()).for_template(situation),
            required_orders(situation.conflicts, order),
            reactions,
            at_ends(encounter.present, len(encounter.time)),
            situation.lane_gaps,
            situation.reactions.stops,
            red_runners(encounter),
        )

    @property
    def not_applicable(self) -> tuple[str, ...]:
        """The checks that cannot be made, each with the reason."""
        missing = {
            "off_road: no road is known": self.road,
            "boundary_state: the requested states are not known": self.requested,
            "passing_order: the recording has no known conflicts": self.conflicts,
            "stop_not_kept: the recording has no known waits": self.waits,
        }
        sentences = tuple(sentence for sentence, known in missing.items() if known is None)
        lanes = self.road.lanes if self.road is not None else None
        if lanes is not None and lanes.rules and not lanes.rules_kept:
            sentences += ("traffic_rule: the request ignores the map's rules",)
        return sentences

    def check(
        self,
        scenarios: Sequence[Scenario],
        is_enough: Callable[[Violation], bool] = lambda _: False,
    ) -> list[Verdict]:
        """Return one verdict per scenario.

        Args:
            scenarios: of the request.
            is_enough: whether a violation decides, so that later ones are not looked for.

        Raises:
            InputError: the arrays of a scenario disagree in shape, or its vehicles or its frame
                are not those of the request.
        """
        return [self._check(scenario, is_enough) for scenario in scenarios]

    def _check(self, scenario: Scenario, is_enough: Callable[[Violation], bool]) -> Verdict:
        self._refuse_misfits(scenario)
        recorded = self.conflicts or ()
        unusable = _unusable_value(scenario)
        if unusable is not None:
            return Verdict((unusable,), not_applicable=len(recorded))
        met = find_conflicts(scenario)
        by_pair = conflicts_by_pair(met)
        conflicts = [by_pair.get(conflict.pair) for conflict in recorded]
        present = sum(conflict is not None for conflict in conflicts)
        violations = []
        for violation in self._violations(scenario, met, conflicts):
            violations.append(violation)
            if is_enough(violation):
                break
        return Verdict(tuple(violations), present, len(recorded) - present)

    def _violations(
        self, scenario: Scenario, met: Sequence[Conflict], conflicts: Sequence[Conflict | None]
    ) -> Iterator[Violation]:
        """Yield the violations of a scenario whose values are usable.

        Args:
            scenario: of the request.
            met: all its conflicts.
            conflicts: those of the template, None for one that it does not have.
        """
        if self.ends is not None and not scenario.all_present:
            yield from presence_violations(scenario, self.ends)
        if self.requested is not None:
            yield from state_violations(scenario, self.requested, self._limits)
        yield from motion_violations(scenario, self._limits)
        yield from self._footprint_faults(scenario)
        yield from self._wrong_ways(scenario)
        yield from self._broken_rules(scenario, met)
        yield from light_violations(scenario, self.at_red, self.stops)
        yield from wait_violations(scenario, self.waits or (), self.requested, self._limits)
        yield from order_violations(self.conflicts or (), self._first, conflicts)
        gaps = lane_gaps(scenario)
        yield from broken_reactions(scenario, conflicts, self.reactions, self._limits, gaps)
        yield from clearance_violations(scenario, self.abreast)
        if self.lane_gaps is not None:
            yield from tailgaters(scenario, gaps, self.lane_gaps, self._limits)

    def _refuse_misfits(self, scenario: Scenario) -> None:
        """Refuse a scenario that cannot be compared with the request."""
        label = f"scenario {scenario.index} of seed {scenario.seed}"
        n = len(scenario.vehicles)
        counts = f"{label} has {n} vehicle(s)"
        _refuse_shapes(scenario, label)
        if self.road is not None and scenario.frame_id != self.road.frame_id:
            raise InputError(
                f"{label} is in frame {scenario.frame_id!r}, its road in {self.road.frame_id!r}"
            )
        requested = self.requested
        tables: list[Floats | Bools | None] = [self.ends]
        if requested is not None:
            tables += [requested.start, requested.end, requested.relaxed]
        for table in tables:
            if table is not None and len(table) != n:
                raise InputError(f"{counts}, but states were requested for {len(table)}")
        named = [wait.vehicle for wait in self.waits or ()]
        for conflict in self.conflicts or ():
            named += [conflict.first, conflict.second]
        for edge in self.reactions:
            named += [edge.who, edge.whom]
        for i in named:
            if not 0 <= i < n:
                raise InputError(
                    f"{counts}, but the recording's waits, conflicts and reactions "
                    f"name vehicle {i}"
                )

    def _footprint_faults(self, scenario: Scenario) -> Iterator[Violation]:
        """Yield overlaps, and footprints that leave the road; a trailer is its vehicle's part."""
        bodies = scenario.with_trailers()
        n, t = bodies.heading.shape
        half = np.array([vehicle.half for vehicle in bodies.vehicles])
        control = np.empty((n, t - 1, 4, 2))
        control_points(bodies.time, bodies.position, bodies.heading, bodies.speed, control)
        faults = contact_violations(bodies, control, half, self._limits)
        if self.road is not None:
            resolution = self._limits.time_resolution
            exits = exit_violations(bodies, control, half, self._ground_of, resolution)
            faults = chain(faults, exits)
        owners = bodies.owners
        for fault in faults:
            vehicles = sorted({owners[n] for n in fault.vehicles})
            if len(vehicles) == len(fault.vehicles):
                yield replace(fault, vehicles=tuple(vehicles))

    def _ground_of(self, vehicle: Vehicle) -> Ground:
        """Return the cells in which vehicles of this type may be."""
        users = vehicle.kind.lane_user
        if users not in self._grounds:
            assert self.road is not None
            self._grounds[users] = Ground.of(ground_for(self.road, vehicle))
        return self._grounds[users]

    def _wrong_ways(self, scenario: Scenario) -> Iterator[Violation]:
        """Yield vehicles that, at a sample, drive against all lanes in their place."""
        if self.road is None or self.road.map_lanes is None:
            return
        for i, vehicle in enumerate(scenario.vehicles):
            if vehicle.kind.walks:
                continue
            ground = ground_for(self.road, vehicle)
            against = drives_against(ground, scenario.position[i], scenario.heading[i])
            against &= scenario.is_present[i]
            if against.any():
                k = int(np.argmax(against))
                x, y = scenario.position[i, k].tolist()
                message = (
                    f"vehicle {i}: drives against its lane near ({x:.2f}, {y:.2f}), "
                    f"at {int(against.sum())} samples"
                )
                yield Violation(Cause.WRONG_WAY, float(scenario.time[k]), (i,), message)

    def _broken_rules(
        self, scenario: Scenario, conflicts: Sequence[Conflict]
    ) -> Iterator[Violation]:
        """Yield stop lines that are run, and rights of way that are violated."""
        if self._rules is None or not self._rules.rules:
            return
        for breach in self._rules.breaches(scenario, conflicts):
            message = f"vehicle {scenario.vehicles[breach.vehicles[0]].id}: {breach.message}"
            yield Violation(Cause.TRAFFIC_RULE, breach.time, breach.vehicles, message)


def _refuse_shapes(scenario: Scenario, label: str) -> None:
    """Refuse a scenario whose arrays disagree in shape, or that is empty."""
    n, t = len(scenario.vehicles), scenario.time.shape[0]
    shapes = {scenario.heading.shape, scenario.speed.shape, scenario.acceleration.shape}
    if scenario.position.shape != (n, t, 2) or shapes != {(n, t)}:
        raise InputError(
            f"{label}: arrays disagree in shape with {n} vehicle(s) and {t} sample(s)"
        )
    if n == 0 or t < 2:
        raise InputError(
            f"{label} has {n} vehicle(s) and {t} sample(s); at least 1 and 2 are needed"
        )
    if not all(vehicle.length > 0.0 and vehicle.width > 0.0 for vehicle in scenario.vehicles):
        raise InputError(f"{label}: the length or width of a vehicle is not positive")


def _unusable_value(scenario: Scenario) -> Violation | None:
    """Return the first value that is not finite or too large, or a time that does not increase."""
    arrays = {name: getattr(scenario, name) for name in _ARRAYS}
    if is_motion(*arrays.values()):
        return None
    for name, values in arrays.items():
        usable = np.abs(values) <= LARGEST_VALUE_RATIO
        if usable.all():
            continue
        place = tuple(np.argwhere(~usable)[0].tolist())
        vehicles = () if name == "time" else place[:1]
        k = place[0] if name == "time" else place[1]
        finite = np.isfinite(values[place])
        fault = f"beyond {LARGEST_VALUE_RATIO:g}" if finite else "not finite"
        message = f"{name} is {fault} at sample {k}"
        time = float(np.nan_to_num(scenario.time[k]))
        return Violation(Cause.NOT_FINITE, time, vehicles, message)
    k = int(np.argmax(np.diff(scenario.time) <= 0.0))
    message = f"time does not increase after sample {k}"
    return Violation(Cause.NOT_FINITE, float(scenario.time[k]), (), message)

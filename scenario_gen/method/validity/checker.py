# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The checker: proves a scenario valid at every instant, or says what is wrong with it, when and by how much."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, groupby

import numpy as np

from scenario_gen.base.errors import InputError
from scenario_gen.method.validity import collision as apart
from scenario_gen.method.validity import containment as inside
from scenario_gen.method.validity import dynamics
from scenario_gen.method.validity.dynamics import control_points, is_motion
from scenario_gen.method.validity.limits import Limits
from scenario_gen.method.validity.presence import driven_on
from scenario_gen.method.validity.reactions import broken_reactions, tailgaters
from scenario_gen.numerics import Bools, Floats, runs
from scenario_gen.numerics.plane import edge_lengths
from scenario_gen.roads import drives_against, ground_for, RuleCheck
from scenario_gen.situation import (
    Conflict,
    conflicts_by_pair,
    conflicts_in,
    lane_gaps,
    LaneGaps,
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
    together,
    Vehicle,
    Verdict,
    Violation,
)


@dataclass(eq=False, repr=False)
class Checker:
    """Checks scenarios against a road, the states asked for, a template's conflicts and waits, and limits.

    Proven at every instant of the motion that `Scenario` defines, not on a grid of instants: footprints do not overlap,
    and each lies inside drivable cells. What cannot be proven at `limits.time_resolution` is refused. The other
    guarantees are listed in docs/validity.md. Any of road, requested, conflicts and waits may be None: those checks are
    left out, and `not_applicable` names them. One checker serves many scenarios of one request.

    Attributes:
        road: the road they drive on.
        requested: start and end states, one per vehicle.
        conflicts: the template's conflicts, whose order must be kept, unless `first` says otherwise.
        waits: the template's waits; in every scenario the vehicle stands, or moves slowly, as often, one after the other.
        limits: the limits; the default ones if None.
        first: who must go first at each of the conflicts, by index, None for anyone (`required_orders`); a conflict whose order
            is not the template's must be there.
        reactions: of the template, which every scenario keeps.
        ends: (N, 2) whether each vehicle is there at the template's first and last instant, as it then must be at the
            scenario's; None if that is not known.
        lane_gaps: how near the template's vehicles come to one ahead of them, as of `lane_gaps`; None if that is not known.
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

    def __post_init__(self) -> None:
        self._first = (
            tuple(conflict.first for conflict in self.conflicts or ())
            if self.first is None
            else tuple(self.first)
        )
        self._limits = self.limits or Limits()
        self._dynamics_limits: dict[str, Floats] = {}
        if self.road is not None:
            self._grounds: dict[frozenset[str], inside.Ground] = {}
        lanes = self.road.lanes if self.road is not None else None
        swapped = self._first != tuple(conflict.first for conflict in self.conflicts or ())
        against = (
            lanes is not None and lanes.drawn and swapped
        )  # the signs of a drawn road say who went first in the template
        self._rules = (
            RuleCheck(lanes) if lanes is not None and lanes.rules and not against else None
        )

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
        """Return the checker of scenarios of a template, with all of its vehicles.

        Args:
            situation: of the template, whose conflicts are kept.
            road: the road they drive on.
            requested: start and end states of all vehicles.
            waits: the template's waits that are kept.
            limits: the limits; the default ones if None.
            order: who goes first, see `required_orders`.
            reactions: of the template, that are kept.

        Raises:
            RefusedError: an order is to be swapped, and there is none.
        """
        encounter, conflicts = situation.encounter, situation.conflicts
        own = (limits or Limits()).for_template(situation)
        ends = at_ends(encounter.present, len(encounter.time))
        return cls(
            road,
            requested,
            conflicts,
            waits,
            own,
            required_orders(conflicts, order),
            reactions,
            ends,
            situation.lane_gaps,
        )

    @property
    def not_applicable(self) -> tuple[str, ...]:
        """Sentences naming the checks that cannot be made, and why."""
        missing = {
            "off_road: no road is known": self.road,
            "boundary_state: the requested states are not known": self.requested,
            "passing_order: the recording has no known conflicts": self.conflicts,
            "stop_not_kept: the recording has no known waits": self.waits,
        }
        sentences = tuple(sentence for sentence, given in missing.items() if given is None)
        lanes = self.road.lanes if self.road is not None else None
        if lanes is not None and lanes.rules and not lanes.rules_kept:
            sentences += ("traffic_rule: the request ignores the map's rules",)
        return sentences

    def check(self, scenarios: Sequence[Scenario]) -> list[Verdict]:
        """Return one verdict per scenario.

        Raises:
            InputError: a scenario's arrays disagree in shape, or it does not suit the request (vehicles, frame).
        """
        return [self._check(scenario) for scenario in scenarios]

    def _check(self, scenario: Scenario) -> Verdict:
        self._refuse_misfits(scenario)
        broken = _not_finite(scenario)
        if broken is not None:
            return Verdict((broken,), not_applicable=len(self.conflicts or ()))
        time, heading = scenario.time, scenario.heading
        n, t = heading.shape
        half = np.array([vehicle.half for vehicle in scenario.vehicles])
        control = np.empty((n, t - 1, 4, 2))
        control_points(time, scenario.position, heading, scenario.speed, control)
        conflicts = conflicts_in(scenario)
        gaps_in_lane = lane_gaps(scenario)
        violations = [
            *self._ends(scenario),
            *self._boundary_states(scenario),
            *self._dynamics(scenario),
            *self._contacts(scenario, control, half),
            *self._exits(scenario, control, half),
            *self._wrong_ways(scenario),
            *self._broken_rules(scenario, conflicts),
            *self._waits(scenario),
        ]
        by_pair = conflicts_by_pair(conflicts)
        recorded = [by_pair.get(conflict.pair) for conflict in self.conflicts or ()]
        wrong, present, absent = self._passing_orders(recorded)
        reactions = [
            *broken_reactions(scenario, recorded, self.reactions, self._limits, gaps_in_lane)
        ]
        if self.lane_gaps is not None:
            reactions += tailgaters(scenario, gaps_in_lane, self.lane_gaps, self._limits)
        return Verdict((*violations, *wrong, *reactions), present, absent)

    def _refuse_misfits(self, scenario: Scenario) -> None:
        n, where = len(scenario.vehicles), f"scenario {scenario.index} of seed {scenario.seed}"
        t = scenario.time.shape[0]
        shapes = (scenario.heading.shape, scenario.speed.shape, scenario.acceleration.shape)
        if scenario.position.shape != (n, t, 2) or any(shape != (n, t) for shape in shapes):
            raise InputError(
                f"{where}: arrays disagree in shape with {n} vehicle(s) and {t} sample(s)"
            )
        if n == 0 or t < 2:
            raise InputError(
                f"{where} has {n} vehicle(s) and {t} sample(s); at least 1 and 2 are needed"
            )
        if not all(vehicle.length > 0.0 and vehicle.width > 0.0 for vehicle in scenario.vehicles):
            raise InputError(f"{where}: a vehicle's length or width is not positive")
        if self.road is not None and scenario.frame_id != self.road.frame_id:
            raise InputError(
                f"{where} is in frame {scenario.frame_id!r}, its road in {self.road.frame_id!r}"
            )
        known = (
            ()
            if self.requested is None
            else (self.requested.start, self.requested.end, self.requested.relaxed)
        )
        counts = sorted(
            {len(states) for states in (*known, *(() if self.ends is None else (self.ends,)))}
            - {n}
        )
        if counts:
            raise InputError(
                f"{where} has {n} vehicle(s), but states were requested for {counts[0]}"
            )
        indices = [i for c in self.conflicts or () for i in (c.first, c.second)] + [
            w.vehicle for w in self.waits or ()
        ]
        indices += [i for edge in self.reactions for i in (edge.who, edge.whom)]
        strangers = [i for i in indices if not 0 <= i < n]
        if strangers:
            raise InputError(
                f"{where} has {n} vehicle(s), but the recording's waits, conflicts and reactions name vehicle {strangers[0]}"
            )

    def _ends(self, scenario: Scenario) -> Iterator[Violation]:
        """Vehicles that come or go within the scenario, though the template has them from its start or to its end.

        Who stands could else vanish at once: its first and last state are as requested, and nobody meets it.
        """
        if self.ends is None or scenario.all_present:
            return
        for i, k in np.argwhere(
            self.ends & ~at_ends(scenario.present, len(scenario.time))
        ).tolist():
            what, where = ("goes", "to its end") if k else ("comes", "from its start on")
            time = float(scenario.time[scenario.present[i, k]])
            message = f"vehicle {i}: {what} at {time:.3f} s; the recording has it {where}"
            yield Violation(Cause.BOUNDARY_STATE, time, (i,), message)

    def _boundary_states(self, scenario: Scenario) -> Iterator[Violation]:
        if self.requested is None:
            return
        limits = self._limits
        relaxed = self.requested.relaxed.tolist()
        for name, k, states in (
            ("start", 0, self.requested.start),
            ("end", -1, self.requested.end),
        ):  # too few numbers for arrays
            # a vehicle's row is held outside of its presence: its first or last value is that at its own first or last instant
            ends = zip(
                scenario.position[:, k].tolist(),
                scenario.speed[:, k].tolist(),
                states.tolist(),
                strict=True,
            )
            for i, ((x, y), speed, (x_requested, y_requested, _, speed_requested)) in enumerate(
                ends
            ):
                distance, difference = (
                    np.hypot(x - x_requested, y - y_requested),
                    abs(speed - speed_requested),
                )
                far, off = self._within_a_step(scenario, i, k)
                free, faster = relaxed[i][k]
                far, off = (
                    far + free + limits.position_tolerance,
                    off + faster + limits.speed_tolerance,
                )
                if not (distance <= far + 1e-9 and difference <= off + 1e-9):  # NaN is not near
                    bounds = (
                        f" (free are {free:.3f} m and {faster:.3f} m/s)" if free or faster else ""
                    )
                    message = f"vehicle {i}: {name} is {distance:.3f} m and {difference:.3f} m/s from the request{bounds}"
                    yield Violation(
                        Cause.BOUNDARY_STATE,
                        float(scenario.time[scenario.present[i, k]]),
                        (i,),
                        message,
                    )

    @staticmethod
    def _within_a_step(scenario: Scenario, i: int, k: int) -> tuple[float, float]:
        """Metres and m/s that vehicle i drives and changes in one step where it comes or goes within the scenario, else 0.

        It comes and goes between two instants, and is shown from the first one after it came to the last one before it went.
        """
        at = int(scenario.present[i, k])
        if at in {0, len(scenario.time) - 1}:
            return 0.0, 0.0
        step = (
            float(scenario.time[at + 1] - scenario.time[at])
            if k
            else float(scenario.time[at] - scenario.time[at - 1])
        )
        return step * float(scenario.speed[i, at]), step * abs(float(scenario.acceleration[i, at]))

    def _dynamics(self, scenario: Scenario) -> Iterator[Violation]:
        out = np.full((len(scenario.vehicles), len(dynamics.Check), 4), np.nan)
        names = ("position", "heading", "speed", "acceleration")
        for rows, at in spans(scenario):
            position, heading, speed, acceleration = (
                np.ascontiguousarray(getattr(scenario, name)[rows, at]) for name in names
            )
            limits = self._limits_of(scenario.vehicles[rows.start].type)
            dynamics.worst_excess(
                scenario.time[at], position, heading, speed, acceleration, limits, out[rows]
            )
        for i, row in zip(
            *(index.tolist() for index in np.nonzero(~(out[..., 0] <= 0.0))), strict=True
        ):  # NaN, too
            _, value, limit, time = out[i, row].tolist()
            cause, sentence = dynamics.MESSAGES[dynamics.Check(row)]
            named = dynamics.parameter_of(dynamics.Check(row), scenario.vehicles[i].type)
            yield Violation(
                cause,
                time,
                (i,),
                f"vehicle {i}: {sentence.format(value=value, limit=limit)}{named}",
            )

    def _limits_of(self, name: str) -> Floats:
        """Return the limits of a type as `worst_excess` takes them."""
        if name not in self._dynamics_limits:
            own = [getattr(self._limits.of(name), each) for each in dynamics.OF_TYPE]
            self._dynamics_limits[name] = np.array(
                [*own, *(getattr(self._limits, each) for each in dynamics.OF_ALL)]
            )
        return self._dynamics_limits[name]

    def _contacts(self, scenario: Scenario, control: Floats, half: Floats) -> Iterator[Violation]:
        n, limits = len(half), self._limits
        out = np.full(
            (n * (n - 1) // 2, 3), np.nan
        )  # NaN is no proof: a pair that nothing looks at is refused
        bounds = (limits.clearance, limits.time_resolution)
        if scenario.all_present:
            apart.first_contacts(scenario.time, control, scenario.heading, half, *bounds, out)
        else:
            self._contacts_of_those_there(scenario, half, out)
        if (out[:, 0] == apart.PROVEN).all():
            return
        for pair, (status, time, gap) in zip(combinations(range(n), 2), out.tolist(), strict=True):
            if status != apart.PROVEN:
                beyond = self._beyond_presence(scenario, pair, time)
                if status not in {apart.FOUND, apart.UNPROVEN}:
                    what = "were not compared"
                elif status == apart.UNPROVEN:
                    what = f"cannot be proven more than {limits.clearance:g} m apart (gap {gap:.6f} m)"
                elif gap <= 0.0:
                    what = f"overlap by {-gap:.3f} m"
                else:
                    what = f"come within {gap:.3f} m; {limits.clearance:g} m must be exceeded"
                message = (
                    f"vehicles {pair[0]} and {pair[1]}: footprints {what} at {time:.3f} s{beyond}"
                )
                yield Violation(Cause.OVERLAP, float(np.nan_to_num(time)), pair, message)

    def _contacts_of_those_there(self, scenario: Scenario, half: Floats, out: Floats) -> None:
        """Fill `out` as `first_contacts` does, of vehicles that come and go; each is there a little longer than it is shown."""
        time, bounds = scenario.time, (self._limits.clearance, self._limits.time_resolution)
        position, heading, speed, present = driven_on(scenario, self._limits.presence_margin)
        control = np.empty((len(half), len(time) - 1, 4, 2))
        control_points(time, position, heading, speed, control)
        for k, (a, b) in enumerate(combinations(range(len(half)), 2)):
            at, two, row = together(present, a, b), [a, b], out[k : k + 1]
            if at.stop - at.start >= 2:
                curves = np.ascontiguousarray(control[two, at.start : at.stop - 1])
                apart.first_contacts(
                    time[at],
                    curves,
                    np.ascontiguousarray(heading[two, at]),
                    half[two],
                    *bounds,
                    row,
                )
            elif at.stop - at.start == 1:  # one instant: both stand still for a second
                still = np.repeat(position[two, at], 4, axis=1)[:, None]
                apart.first_contacts(
                    np.array([0.0, 1.0]),
                    still,
                    np.repeat(heading[two, at], 2, axis=1),
                    half[two],
                    *bounds,
                    row,
                )
                row[0, 1] = time[at.start]
            else:  # never there together
                row[0, 0] = apart.PROVEN

    def _beyond_presence(self, scenario: Scenario, pair: tuple[int, int], time: float) -> str:
        """Say so where a vehicle of a pair is not shown at the time of a contact."""
        first, last = scenario.time[scenario.present[list(pair)]].T
        if np.isnan(time) or ((time >= first) & (time <= last)).all():
            return ""
        return f"; who comes or goes is there for {self._limits.presence_margin:g} s more than it is shown"

    def _exits(self, scenario: Scenario, control: Floats, half: Floats) -> Iterator[Violation]:
        if self.road is None:
            return
        out = np.full((len(half), 2), np.nan)  # NaN is no proof
        for rows, at in spans(scenario):
            inside.first_exits(
                scenario.time[at],
                np.ascontiguousarray(control[rows, at.start : at.stop - 1]),
                np.ascontiguousarray(scenario.heading[rows, at]),
                half[rows],
                self._ground_of(scenario.vehicles[rows.start]),
                self._limits.time_resolution,
                out[rows],
            )
        for i, (status, time) in enumerate(out.tolist()):
            if status != inside.PROVEN:
                what = (
                    "leaves drivable space"
                    if status == inside.FOUND
                    else "cannot be proven inside drivable space"
                )
                x, y = (
                    float(np.interp(time, scenario.time, scenario.position[i, :, axis]))
                    for axis in range(2)
                )
                yield Violation(
                    Cause.OFF_ROAD,
                    time,
                    (i,),
                    f"vehicle {i}: footprint {what} at {time:.3f} s near ({x:.2f}, {y:.2f})",
                )

    def _ground_of(self, vehicle: Vehicle) -> inside.Ground:
        """Return where those of a vehicle's type may be."""
        users = vehicle.kind.lane_user
        if users not in self._grounds:
            assert self.road is not None
            self._grounds[users] = inside.Ground.of(ground_for(self.road, vehicle))
        return self._grounds[users]

    def _wrong_ways(self, scenario: Scenario) -> Iterator[Violation]:
        """Vehicles that drive against all lanes where they are, at the samples."""
        if self.road is None or self.road.map_lanes is None:
            return
        for i, vehicle in enumerate(scenario.vehicles):
            if vehicle.kind.walks:
                continue
            ground = ground_for(self.road, vehicle)
            against = (
                drives_against(ground, scenario.position[i], scenario.heading[i])
                & scenario.there[i]
            )
            if not against.any():
                continue
            k = int(np.argmax(against))
            x, y = scenario.position[i, k].tolist()
            message = f"vehicle {i}: drives against its lane near ({x:.2f}, {y:.2f}), {int(against.sum())} samples in all"
            yield Violation(Cause.WRONG_WAY, float(scenario.time[k]), (i,), message)

    def _broken_rules(
        self, scenario: Scenario, conflicts: Sequence[Conflict]
    ) -> Iterator[Violation]:
        """Stop lines that are run, and rights of way that are taken."""
        if self._rules is None or not self._rules.rules:
            return
        for breach in self._rules.breaches(scenario, conflicts):
            message = f"vehicle {scenario.vehicles[breach.vehicles[0]].id}: {breach.message}"
            yield Violation(Cause.TRAFFIC_RULE, breach.time, breach.vehicles, message)

    def _passing_orders(
        self, conflicts: Sequence[Conflict | None]
    ) -> tuple[list[Violation], int, int]:
        """Violations, and how many of the template's conflicts are present and absent in the scenario, which has `conflicts`."""
        wrong, present = [], 0
        for recorded, first, conflict in zip(
            self.conflicts or (), self._first, conflicts, strict=True
        ):
            a, b = sorted((recorded.first, recorded.second))
            present += conflict is not None
            swapped = first == recorded.second
            expected = "requested is that" if swapped else "in the recording"
            if conflict is not None and first is not None and conflict.first != first:
                message = (
                    f"vehicle {conflict.first} goes first ({conflict.entry_first:.2f} s, vehicle {conflict.second} "
                    f"{conflict.entry_second:.2f} s); {expected} vehicle {first} does"
                )
                wrong.append(
                    Violation(
                        Cause.PASSING_ORDER,
                        conflict.entry_first,
                        (conflict.first, conflict.second),
                        message,
                    )
                )
            elif conflict is None and swapped:
                message = (
                    f"vehicles {a} and {b} do not meet; {expected} vehicle {first} goes first"
                )
                wrong.append(Violation(Cause.PASSING_ORDER, 0.0, (a, b), message))
        return wrong, present, len(self.conflicts or ()) - present

    def _waits(self, scenario: Scenario) -> Iterator[Violation]:
        waits = self.waits or ()
        for i in sorted({wait.vehicle for wait in waits}):
            recorded = [wait for wait in waits if wait.vehicle == i]
            throughout = [tuple(scenario.present[i].tolist())]
            if (
                self._never_moves(i, recorded[0].start, scenario)
                and self._slow(scenario, i, self._limits.stand_speed) != throughout
            ):
                k = int(np.argmax(scenario.speed[i]))
                message = f"vehicle {i}: waits throughout in the recording, but reaches {scenario.speed[i, k]:.3f} m/s"
                yield Violation(Cause.STOP_NOT_KEPT, float(scenario.time[k]), (i,), message)
                continue
            standing = [wait for wait in recorded if not wait.moves_slowly]
            for required, limit, verb in (
                (standing, self._limits.stand_speed, "stands"),
                (recorded, self._limits.creep_speed, "waits"),
            ):
                # a stand serves as many consecutive waits as it is long: the template's may be parted by a short twitch
                lengths = [
                    float(scenario.time[b] - scenario.time[a])
                    for a, b in self._slow(scenario, i, limit)
                ]
                served = sum(
                    int((length + 1e-9) / self._limits.stand_duration) for length in lengths
                )
                if served < len(required):
                    message = (
                        f"vehicle {i}: {verb} {len(required)} time(s) in the recording; is below {limit:g} m/s for "
                        f"{', '.join(f'{length:.1f} s' for length in lengths) or 'less than two samples'}"
                    )
                    yield Violation(
                        Cause.STOP_NOT_KEPT,
                        required[min(served, len(required) - 1)].start,
                        (i,),
                        message,
                    )
                    break

    def _slow(self, scenario: Scenario, i: int, limit: float) -> list[tuple[int, int]]:
        """First and last sample of each stretch in which neither published speed nor displacement reaches the limit [m/s]."""
        slow = scenario.speed[i] < limit
        moved = edge_lengths(scenario.position[i])
        still = slow[:-1] & slow[1:] & (moved < limit * np.diff(scenario.time))
        still &= scenario.there[i, :-1] & scenario.there[i, 1:]
        return runs(still)  # of T - 1 steps: a step's end is a sample

    def _never_moves(self, i: int, begins: float, scenario: Scenario) -> bool:
        """Whether vehicle i, whose first wait `begins` when it arrives, is requested to end where it starts."""
        if self.requested is None or begins > float(scenario.time[scenario.present[i, 0]]):
            return False
        off = self.requested.end[i, :2] - self.requested.start[i, :2]
        return bool(np.hypot(off[0], off[1]) <= self._limits.position_tolerance)


def spans(scenario: Scenario) -> Iterator[tuple[slice, slice]]:
    """Yield rows of neighbouring vehicles of one type that come and go together, and the instants at which they are there."""
    alike = zip(
        scenario.present.tolist(), (vehicle.type for vehicle in scenario.vehicles), strict=True
    )
    row = 0
    for ((first, last), _), group in groupby(alike):
        count = len(list(group))
        yield slice(row, row + count), slice(first, last + 1)
        row += count


def _not_finite(scenario: Scenario) -> Violation | None:
    """A violation if a value is not finite, or too large to be reckoned with, or time does not increase."""
    names = ("time", "position", "heading", "speed", "acceleration")
    if is_motion(*(getattr(scenario, name) for name in names)):
        return None
    for name in names:
        values = getattr(scenario, name)
        usable = np.abs(values) <= dynamics.LARGEST
        if not usable.all():
            where = np.argwhere(~usable)[0]
            vehicles = () if name == "time" else (int(where[0]),)
            k = int(where[0]) if name == "time" else int(where[1])
            what = (
                f"beyond {dynamics.LARGEST:g}"
                if np.isfinite(values[tuple(where)])
                else "not finite"
            )
            return Violation(
                Cause.NOT_FINITE,
                float(np.nan_to_num(scenario.time[k])),
                vehicles,
                f"{name} is {what} at sample {k}",
            )
    steps = np.diff(scenario.time)
    if (steps <= 0.0).any():
        k = int(np.argmax(steps <= 0.0))
        return Violation(
            Cause.NOT_FINITE,
            float(scenario.time[k]),
            (),
            f"time does not increase after sample {k}",
        )
    return None

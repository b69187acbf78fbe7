"""Is every scenario of a bag valid? For any bag of the conventions, ours or not.

A scenario is checked against what bears its stamp in its own namespace: the states asked of it (`fit`), the conflicts and waits
of its template (`tracks`; waits if there are `changepoints`), and the road (`map`; the newest one where none bears the stamp).
What is not there is not checked, and said. Vehicles are matched by id, so one may be left out for an ego.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from msg_conventions import trajectory
from msg_conventions.cdr import CdrReader
from msg_conventions.changepoints import decode_changepoints
from msg_conventions.names import tokens
from msg_conventions.roads import decode_map
from msg_conventions.scenarios import decode_scenario
from msg_conventions.tracks import decode_tracks
from scenario_gen.arrays import Floats
from scenario_gen.bags.contents import Contents, read_namespaces
from scenario_gen.errors import InputError
from scenario_gen.interaction import Conflict, Wait, find_conflicts, find_waits
from scenario_gen.roads.road import Road
from scenario_gen.scenario import BoundaryStates, Scenario
from scenario_gen.validity import Checker, Limits

TOPICS = ("tracks", "changepoints", "map", "fit", "scenarios")
UNUSABLE = "unusable_message"  # damaged, not finite, in another frame than its road: beside the checker's causes


@dataclass
class Found:
    """How many scenarios have violations of one cause, and the first of them."""

    count: int
    scenario: int
    message: str


@dataclass
class Validation:
    """What was found in one namespace: `found` by cause; `left_out` says what could not be checked, and of how many scenarios."""

    namespace: str
    scenarios: int = 0
    invalid: int = 0
    found: dict[str, Found] = field(default_factory=dict)
    left_out: dict[str, int] = field(default_factory=dict)

    def add(self, index: int, violations: Sequence[tuple[str, str]], left_out: Collection[str]) -> None:
        """Count one scenario with its violations (cause, sentence)."""
        self.scenarios += 1
        self.invalid += bool(violations)
        for cause in dict.fromkeys(cause for cause, _ in violations):
            first = next(message for other, message in violations if other == cause)
            self.found.setdefault(cause, Found(0, index, first)).count += 1
        for sentence in left_out:
            self.left_out[sentence] = self.left_out.get(sentence, 0) + 1


@dataclass(frozen=True, eq=False)
class Reference:
    """What the scenarios of one stamp are held against; vehicles by id."""

    road: Road | None
    asked: dict[str, tuple[Floats, Floats]] | None
    template: tuple[str, ...] | None
    conflicts: tuple[Conflict, ...]
    waits: tuple[Wait, ...] | None

    def checker(self, scenario: Scenario, limits: Limits | None) -> Checker:
        """Return the checker of scenarios with this one's vehicles."""
        ids = tokens(vehicle.id for vehicle in scenario.vehicles)
        asked = None
        if self.asked is not None and all(name in self.asked for name in ids):
            start, end = zip(*(self.asked[name] for name in ids), strict=True)
            asked = BoundaryStates(np.array(start), np.array(end))
        if self.template is None or not set(ids) <= set(self.template):
            return Checker(self.road, asked, None, None, limits)
        at = {self.template.index(name): k for k, name in enumerate(ids)}
        conflicts = [replace(c, first=at[c.first], second=at[c.second]) for c in self.conflicts if {c.first, c.second} <= set(at)]
        waits = None if self.waits is None else [replace(w, vehicle=at[w.vehicle]) for w in self.waits if w.vehicle in at]
        return Checker(self.road, asked, conflicts, waits, limits)


def validate_bag(path: Path, limits: Limits | None = None) -> tuple[Validation, ...]:
    """Check every scenario of every namespace that holds any.

    Raises:
        InputError: the bag is missing or damaged, holds no scenarios, or one of its tracks, maps, … cannot be read.
    """
    found = {name: topics for name, topics in read_namespaces(path, TOPICS).items() if topics["scenarios"]}
    if not found:
        raise InputError(f"{path}: no topic `scenarios` in any namespace; there is nothing to check")
    return tuple(_validate(namespace, topics, limits) for namespace, topics in found.items())


def _validate(namespace: str, topics: Contents, limits: Limits | None) -> Validation:
    result = Validation(namespace)
    references: dict[int, Reference] = {}
    checkers: dict[tuple[int, tuple[str, ...]], Checker] = {}
    for index, data in enumerate(topics["scenarios"]):
        try:
            stamp, scenario = decode_scenario(data, index=index, what=f"{namespace}/scenarios, message {index}")
            if stamp not in references:
                references[stamp] = _reference(namespace, topics, stamp)
            key = (stamp, tuple(vehicle.id for vehicle in scenario.vehicles))
            if key not in checkers:
                checkers[key] = references[stamp].checker(scenario, limits)
        except _ReferenceError as error:
            raise InputError(str(error)) from error
        except InputError as error:
            result.add(index, [(UNUSABLE, str(error))], ())
            continue
        try:
            (verdict,) = checkers[key].check([scenario])
        except InputError as error:
            result.add(index, [(UNUSABLE, str(error))], ())
            continue
        result.add(index, [(v.cause.value, v.message) for v in verdict.violations], checkers[key].not_applicable)
    return result


class _ReferenceError(Exception):
    """What the scenarios are to be held against cannot be read itself."""


def _reference(namespace: str, topics: Contents, stamp: int) -> Reference:
    """Return what bears the stamp.

    Raises:
        _ReferenceError: a message of it is damaged.
    """
    try:
        newest = {topic: _of_stamp(topics[topic], stamp, f"{namespace}/{topic}") for topic in TOPICS[:-1]}
        grid = newest["map"] or (topics["map"][-1] if topics["map"] else None)
        road = decode_map(grid, name=f"{namespace}/map")[1] if grid else None
        asked, template, conflicts, waits = None, None, [], None
        if newest["fit"]:
            asked = _asked(newest["fit"], f"{namespace}/fit")
        if newest["tracks"]:
            encounter = decode_tracks(newest["tracks"], f"{namespace}/tracks")
            template = tokens(vehicle.id for vehicle in encounter.vehicles)
            conflicts = list(find_conflicts(encounter.vehicles, encounter.time, encounter.position, encounter.heading))
            if newest["changepoints"]:  # without changepoints there is no dwell to hold: its waits are not asked for
                segmentation = decode_changepoints(newest["changepoints"], encounter, f"{namespace}/changepoints")
                waits = find_waits(encounter) if segmentation.changepoints.size else ()
    except InputError as error:
        raise _ReferenceError(str(error)) from error
    return Reference(road, asked, template, tuple(conflicts), waits)


def _of_stamp(messages: Sequence[bytes], stamp: int, what: str) -> bytes | None:
    return next((data for data in reversed(messages) if CdrReader(data, what).stamp() == stamp), None)


def _asked(data: bytes, what: str) -> dict[str, tuple[Floats, Floats]]:
    """Return start and end (x, y, yaw, speed) by vehicle id."""
    fit = trajectory.decode(data, what)
    if len(fit.time_ns) < 2:
        raise InputError(f"{what}: {len(fit.time_ns)} point(s); a start and an end are needed")
    state = np.concatenate([fit.position, fit.heading[..., None], fit.speed[..., None]], axis=-1)
    return {vehicle.id: (state[k, 0], state[k, -1]) for k, vehicle in enumerate(fit.vehicles)}

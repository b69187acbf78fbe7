# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Checks of a scenario against its template and request: presence, states, waits and order."""

from collections.abc import Iterator, Sequence

import numpy as np

from scenario_gen.method.validity.limits import Limits
from scenario_gen.numerics import Bools, edge_lengths, runs
from scenario_gen.numerics.rounding import ROUNDING_M, ROUNDING_S
from scenario_gen.situation import Abreast, Conflict, MAX_CLEARANCE_CHANGE_M, Wait
from scenario_gen.types import at_ends, BoundaryStates, Cause, Scenario, Violation


def presence_violations(scenario: Scenario, ends: Bools) -> Iterator[Violation]:
    """Yield vehicles that enter or leave, though the template has them at its start or end.

    Otherwise a standing vehicle could vanish at once: its first and last state would be as
    requested, and no other vehicle would meet it.

    Args:
        scenario: the vehicles.
        ends: (N, 2) whether each is present at the template's first and last instant.
    """
    missing = ends & ~at_ends(scenario.present, len(scenario.time))
    for i, k in np.argwhere(missing).tolist():
        time = float(scenario.time[scenario.present[i, k]])
        fault = f"enters at {time:.3f} s; in the recording it is present from the start"
        if k == 1:
            fault = f"leaves at {time:.3f} s; in the recording it is present until the end"
        yield Violation(Cause.BOUNDARY_STATE, time, (i,), f"vehicle {i}: {fault}")


def state_violations(
    scenario: Scenario, requested: BoundaryStates, limits: Limits
) -> Iterator[Violation]:
    """Yield the start and end states that differ from the requested ones by too much."""
    for name, k, states in (("start", 0, requested.start), ("end", -1, requested.end)):
        # outside of its presence the first or last state of a vehicle is repeated
        position, speed = scenario.position[:, k], scenario.speed[:, k]
        distance = np.hypot(*(position - states[:, :2]).T)
        difference = np.abs(speed - states[:, 3])
        for i in range(len(states)):
            step_m, step_mps = _change_in_a_step(scenario, i, k)
            free_m, free_mps = requested.relaxed[i, k].tolist()
            far = step_m + free_m + limits.position_tolerance + ROUNDING_M
            fast = step_mps + free_mps + limits.speed_tolerance + ROUNDING_M
            if distance[i] <= far and difference[i] <= fast:  # NaN fails
                continue
            message = (
                f"vehicle {i}: {name} is {distance[i]:.3f} m and {difference[i]:.3f} m/s "
                "from the request"
            )
            if free_m or free_mps:
                message += f" ({free_m:.3f} m and {free_mps:.3f} m/s are free)"
            time = float(scenario.time[scenario.present[i, k]])
            yield Violation(Cause.BOUNDARY_STATE, time, (i,), message)


def _change_in_a_step(scenario: Scenario, i: int, k: int) -> tuple[float, float]:
    """Metres and m/s by which vehicle i changes in a step, where it enters or leaves; else 0.

    It enters and leaves between two samples, and is shown from the first sample after it entered
    until the last one before it left.
    """
    at = int(scenario.present[i, k])
    if at in {0, len(scenario.time) - 1}:
        return 0.0, 0.0
    beyond = at - 1 if k == 0 else at + 1
    step = abs(float(scenario.time[beyond] - scenario.time[at]))
    return step * float(scenario.speed[i, at]), step * abs(float(scenario.acceleration[i, at]))


def order_violations(
    recorded: Sequence[Conflict],
    required: Sequence[int | None],
    conflicts: Sequence[Conflict | None],
) -> Iterator[Violation]:
    """Yield the conflicts that are passed in another order than required.

    Args:
        recorded: the template's conflicts.
        required: the vehicle that must go first at each of them; None: either one.
        conflicts: the same conflicts in the scenario; None where the vehicles do not meet.
    """
    for template, first, conflict in zip(recorded, required, conflicts, strict=True):
        swapped = first == template.second
        expected = "the request is that" if swapped else "in the recording"
        if conflict is None:
            if swapped:
                a, b = template.pair
                message = (
                    f"vehicles {a} and {b} do not meet; {expected} vehicle {first} goes first"
                )
                yield Violation(Cause.PASSING_ORDER, 0.0, (a, b), message)
        elif first is not None and conflict.first != first:
            message = (
                f"vehicle {conflict.first} goes first ({conflict.entry_first:.2f} s, "
                f"vehicle {conflict.second} {conflict.entry_second:.2f} s); "
                f"{expected} vehicle {first} does"
            )
            pair = (conflict.first, conflict.second)
            yield Violation(Cause.PASSING_ORDER, conflict.entry_first, pair, message)


def clearance_violations(scenario: Scenario, abreast: Sequence[Abreast]) -> Iterator[Violation]:
    """Yield the pairs side by side in one lane that are nearer, farther or on the other side.

    A pair is not compared where it hardly shares a lane.
    """
    for each in abreast:
        a, b = each.pair
        first, second = (scenario.poses[n][scenario.is_present[n]] for n in each.pair)
        change = (each.offset_on(first, second) - each.offset) * np.sign(each.offset)
        if abs(change) > MAX_CLEARANCE_CHANGE_M:  # NaN passes
            message = (
                f"vehicle {b}: drives {each.clearance + change:.2f} m beside vehicle {a}; "
                f"{each.clearance:.2f} ± {MAX_CLEARANCE_CHANGE_M:g} m is allowed"
            )
            time = float(scenario.time[scenario.present[b, 0]])
            yield Violation(Cause.SIDE_CLEARANCE, time, each.pair, message)


def wait_violations(
    scenario: Scenario, waits: Sequence[Wait], requested: BoundaryStates | None, limits: Limits
) -> Iterator[Violation]:
    """Yield the vehicles that wait less often than in the template."""
    for i in sorted({wait.vehicle for wait in waits}):
        recorded = [wait for wait in waits if wait.vehicle == i]
        throughout = [tuple(scenario.present[i].tolist())]
        if (
            _waits_throughout(scenario, recorded[0], requested, limits)
            and _slow_spans(scenario, i, limits.stand_speed) != throughout
        ):
            k = int(np.argmax(scenario.speed[i]))
            message = (
                f"vehicle {i}: waits throughout in the recording, "
                f"but reaches {scenario.speed[i, k]:.3f} m/s"
            )
            yield Violation(Cause.STOP_NOT_KEPT, float(scenario.time[k]), (i,), message)
            continue
        standing = [wait for wait in recorded if not wait.moves_slowly]
        violation = _missing_wait(scenario, standing, "stands", limits.stand_speed, limits)
        if violation is None:
            violation = _missing_wait(scenario, recorded, "waits", limits.creep_speed, limits)
        if violation is not None:
            yield violation


def _missing_wait(
    scenario: Scenario, waits: Sequence[Wait], verb: str, speed: float, limits: Limits
) -> Violation | None:
    """Return the first of one vehicle's waits for which it is not below a speed [m/s].

    A stand serves as many consecutive waits as it is long: a short twitch may separate those of
    the template.
    """
    if not waits:
        return None
    i = waits[0].vehicle
    spans = _slow_spans(scenario, i, speed)
    lengths = [float(scenario.time[b] - scenario.time[a]) for a, b in spans]
    served = sum(int((length + ROUNDING_S) / limits.stand_duration) for length in lengths)
    if served >= len(waits):
        return None
    durations = ", ".join(f"{length:.1f} s" for length in lengths) or "less than two samples"
    message = (
        f"vehicle {i}: {verb} {len(waits)} time(s) in the recording, "
        f"but is below {speed:g} m/s for {durations}"
    )
    return Violation(Cause.STOP_NOT_KEPT, waits[served].start, (i,), message)


def _slow_spans(scenario: Scenario, i: int, limit: float) -> list[tuple[int, int]]:
    """First and last sample of each time in which neither speed nor displacement reach a limit."""
    slow = (scenario.speed[i] < limit) & scenario.is_present[i]
    moved = edge_lengths(scenario.position[i])
    still = slow[:-1] & slow[1:] & (moved < limit * np.diff(scenario.time))
    return runs(still)  # of steps, so the end of a run is a sample


def _waits_throughout(
    scenario: Scenario, wait: Wait, requested: BoundaryStates | None, limits: Limits
) -> bool:
    """Whether a vehicle waits from its arrival, and its request is to end where it starts."""
    i = wait.vehicle
    if requested is None or wait.start > float(scenario.time[scenario.present[i, 0]]):
        return False
    offset = requested.end[i, :2] - requested.start[i, :2]
    return bool(np.hypot(*offset) <= limits.position_tolerance + ROUNDING_M)

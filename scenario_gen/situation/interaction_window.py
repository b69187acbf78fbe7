# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""When each vehicle is needed for the interaction, so that the rest of a recording can be cut."""

from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import chain

import numpy as np

from scenario_gen.numerics import Floats
from scenario_gen.situation.situation import Situation
from scenario_gen.situation.tracks import is_same_turn, manoeuvre_of, Track, turn_of
from scenario_gen.types import YIELD

LEAD_S = 2.0  # kept before the first event of a vehicle
FOLLOW_UP_S = 1.0  # kept after its last one
MIN_FOLLOWING_S = 4.0  # of a vehicle that follows another one after a merge
MIN_LOSS_S = 0.5  # a recording that can lose less is not shortened
TURN_ENDS_SHARE = 0.05  # of a turn that may be missing at each end


def interaction_windows(
    situation: Situation,
    lead: float = LEAD_S,
    follow_up: float = FOLLOW_UP_S,
    *,
    whole_braking: bool = True,
) -> Floats:
    """Return (N, 2) from when to when [s] each vehicle is needed.

    It is needed from `lead` before to `follow_up` [s] after all its conflicts, reactions and
    waits, and while it turns. A vehicle that only stands or follows has no such event: it is
    needed for 2 s in which it comes nearest to another one.

    Args:
        situation: of the recording.
        lead: [s] kept before the first event of a vehicle.
        follow_up: [s] kept after its last one.
        whole_braking: whether who gives way is needed from the beginning of its braking.
    """
    encounter = situation.encounter
    present = encounter.time[encounter.present]
    windows = np.tile([np.inf, -np.inf], (len(present), 1))

    events = list(_events(situation, whole_braking=whole_braking))
    others = set(range(len(present))) - {vehicle for vehicle, *_ in events}
    for vehicle, begin, end in chain(events, _nearest(situation, others)):
        windows[vehicle, 0] = min(windows[vehicle, 0], begin - lead)
        windows[vehicle, 1] = max(windows[vehicle, 1], end + follow_up)
    for vehicle, track in enumerate(situation.tracks):
        if windows[vehicle, 0] < np.inf and manoeuvre_of(turn_of(track)) != "straight":
            begin, end = encounter.time[_turning(track)]
            windows[vehicle] = min(windows[vehicle, 0], begin), max(windows[vehicle, 1], end)
    needed = np.isfinite(windows[:, :1])
    return np.where(needed, np.clip(windows, present[:, :1], present[:, 1:]), present)


def _events(situation: Situation, *, whole_braking: bool) -> Iterator[tuple[int, float, float]]:
    """Yield the vehicle, begin and end [s] of each event."""
    for conflict in situation.conflicts:
        first, second, entry = conflict.first, conflict.second, conflict.entry_first
        if not conflict.following:
            yield first, entry, conflict.exit_first
            yield second, entry, conflict.exit_second
        elif entry > situation.tracks[first].present[0] * situation.encounter.dt:
            yield first, conflict.entry_second, conflict.entry_second  # it merges
            yield second, conflict.entry_second, conflict.entry_second
    for edge in situation.reactions.edges:
        if edge.kind == YIELD:
            yield edge.who, edge.since if whole_braking else edge.until, edge.until
        elif edge.since > situation.encounter.dt:  # after a merge
            shown = min(edge.since + MIN_FOLLOWING_S, edge.until)
            yield edge.who, edge.since, shown
            yield edge.whom, edge.since, shown
    for wait in situation.waits:
        if not situation.tracks[wait.vehicle].still:
            yield wait.vehicle, wait.start, wait.end


def _nearest(situation: Situation, vehicles: Iterable[int]) -> Iterator[tuple[int, float, float]]:
    """Yield two seconds in which vehicles come nearest to others, as events of both."""
    encounter = situation.encounter
    centres = np.stack([track.poses[:, :2] for track in situation.tracks])
    for vehicle in vehicles:
        both = encounter.is_present & encounter.is_present[vehicle]
        both[vehicle] = False
        distance = np.where(both, np.hypot(*(centres - centres[vehicle]).T).T, np.inf)
        other, sample = np.unravel_index(np.argmin(distance), distance.shape)
        first, last = encounter.time[encounter.present[vehicle]]
        middle = max(min(encounter.time[sample], last - 2.0), first + 3.0)
        for each in (vehicle, int(other)):
            yield each, middle - 1.0, middle + 1.0


def _turning(track: Track) -> list[int]:
    """Return the first and the last sample between which a track does 90 % of its turn."""
    yaw = track.poses[:, 2]
    share = (yaw - yaw[0]) / (yaw[-1] - yaw[0])
    begun = np.flatnonzero(share > TURN_ENDS_SHARE)[0]
    unfinished = np.flatnonzero(share < 1.0 - TURN_ENDS_SHARE)[-1]
    return [int(begun), int(max(unfinished, begun))]


def keeps_interaction(recorded: Situation, cut: Situation, *, whole_braking: bool = True) -> bool:
    """Return whether a cut recording has the same conflicts, reactions, waits and turns.

    Without the whole braking, it may have fewer vehicles that give way.
    """
    before, after = (
        {(edge.kind, edge.who, edge.whom) for edge in each.reactions.edges}
        for each in (recorded, cut)
    )
    lost = {kind for kind, _, _ in before - after}
    turns = zip(recorded.tracks, cut.tracks, strict=True)
    return (
        {(each.first, each.second) for each in recorded.conflicts}
        == {(each.first, each.second) for each in cut.conflicts}
        and Counter(wait.vehicle for wait in recorded.waits)
        == Counter(wait.vehicle for wait in cut.waits)
        and after <= before
        and lost <= (set() if whole_braking else {YIELD})
        and all(is_same_turn(turn_of(whole), turn_of(part)) for whole, part in turns)
    )

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One way of placing a recording on lanes, and what the encounter loses there."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
import math

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics import ahead_and_left, frozen, place
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads.vector.hypotheses import Hypothesis
from scenario_gen.roads.vector.lane_graph import LaneGraph
from scenario_gen.roads.vector.match import Match
from scenario_gen.roads.vector.rules import RuleCheck
from scenario_gen.situation import (
    Conflict,
    drivers_of,
    find_conflicts,
    find_losses,
    follows_bend,
    is_same_turn,
    LOSABLE,
    PairConflicts,
    separate,
    Separation,
    smallest_gaps,
    Track,
    track_conflicts,
    turn_of,
)
from scenario_gen.types import LEVEL_SPACING_M, Loss, Motion

_TRIED_SCALES_RATIO = (1.0, 0.9, 1.1, 0.8, 1.2)
_MAX_FORCED_LATERAL_MPS2 = (
    4.2  # a little less than scenarios may have; else other scales are tried
)
_MIN_CLEARANCE_M = 0.1  # between placed footprints, if the recorded ones are as near
_BENT_SHARE = 0.5  # of a recorded turn that a path has; with less, other scales do not help
_SIDEWAYS_SHARE = 0.1  # of a shift, if moving vehicles along their lanes is not enough
_OVERLAP_M = 5.0  # between two vehicles of which one may be above the other
_SCALED_LOSSES = frozenset(("conflict", "order", "following"))


@dataclass(frozen=True)
class PlaceLimits:
    """What may change where a recording is placed.

    Attributes:
        scale_low: smallest accepted s of eq 9.
        scale_high: largest one.
        clearance: [m] between footprints, unless the recorded ones are nearer.
        max_move: [m] by which vehicles may be moved to keep it, or to have room.
        allowed: kinds of losses.
    """

    scale_low: float = 0.8
    scale_high: float = 1.25
    clearance: float = 0.5
    max_move: float = 3.0
    allowed: frozenset[str] = frozenset()

    @property
    def scales(self) -> tuple[float, ...]:
        """The scales that are tried, the best first."""
        return tuple(s for s in _TRIED_SCALES_RATIO if self.scale_low <= s <= self.scale_high)


@dataclass(frozen=True, eq=False)
class PlacingTask:
    """A recording and the lanes on which it is placed.

    Attributes:
        graph: of a map, a part of it, or a drawn road.
        tracks: the recording.
        limits: what may change.
    """

    graph: LaneGraph
    tracks: tuple[Track, ...]
    limits: PlaceLimits

    @cached_property
    def drivers(self) -> tuple[Track, ...]:
        """The tracks of all but pedestrians."""
        return drivers_of(self.tracks)

    @cached_property
    def check(self) -> RuleCheck:
        """The traffic rules."""
        return RuleCheck(self.graph.network)

    @cached_property
    def met(self) -> PairConflicts:
        """The recorded conflicts."""
        return track_conflicts(self.drivers)

    @cached_property
    def clearance(self) -> float:
        """[m] between footprints."""
        recorded = float(smallest_gaps(self.tracks).min())
        return min(self.limits.clearance, max(recorded, _MIN_CLEARANCE_M))

    @cached_property
    def has_reserved(self) -> bool:
        """Whether a vehicle has lanes that are closed to cars."""
        return any(map(self.graph.reserved_for, self.drivers))

    def separated(self, placed: tuple[Track, ...]) -> Separation:
        """Shift vehicles that are too near to each other along their lanes, or also sideways.

        Raises:
            RefusedError: no accepted shift suffices.
        """
        try:
            return separate(placed, self.clearance, self.limits.max_move, sideways=0.0)
        except RefusedError:
            sideways = _SIDEWAYS_SHARE
            return separate(placed, self.clearance, self.limits.max_move, sideways=sideways)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A lane path and a start on it for every driver, and the motion that this gives.

    Attributes:
        match: the lane paths.
        hypothesis: near which they are.
        task: what is placed where.
    """

    match: Match
    hypothesis: Hypothesis
    task: PlacingTask

    @property
    def rank(self) -> tuple[float, ...]:
        """Order before all losses are known: reserved lanes, right of way, and cost."""
        off_reserved = self.task.graph.network.drawn and self.match.off_reserved_cost > 0.0
        cost = round(self.match.cost + self.match.off_reserved_cost, 3)
        return self.surely_lost, off_reserved, not (self.surely_lost or self.yields), cost

    @property
    def score(self) -> tuple[float, ...]:
        """Order of candidates: losses, uncomfortable bends, `rank`."""
        lost = len(self.refused_losses), not self.is_comfortable, len(self.shared_lanes)
        return *lost, *self.rank

    @property
    def scale(self) -> float:
        """S of eq 9."""
        return self.hypothesis.scale

    @property
    def is_good(self) -> bool:
        """Whether it loses nothing, and its bends can be driven at the recorded end speeds."""
        good = self.is_comfortable and not self.surely_lost and not self.refused_losses
        return good and not self.shared_lanes

    @property
    def shared_lanes(self) -> list[Loss]:
        """The vehicles in one lane that were recorded in two."""
        return [loss for loss in self.losses if loss.kind == "lanes"]

    @property
    def depends_on_scale(self) -> bool:
        """Whether another scale may lose nothing: it changes times and turns, not lanes."""
        if self.surely_lost:
            bent = (abs(turn) > _BENT_SHARE * abs(recorded) for recorded, turn in self._lost_turns)
            return not self.match.lost_crossings and all(bent)
        return all(loss.kind in _SCALED_LOSSES for loss in self.refused_losses)

    @property
    def is_comfortable(self) -> bool:
        """Whether the bends can be driven at the first and last recorded speeds."""
        return self.match.forced_lateral <= _MAX_FORCED_LATERAL_MPS2

    @cached_property
    def surely_lost(self) -> int:
        """How many crossings and turns are lost; other losses are expensive to find."""
        turns = len(self._lost_turns) * ("turn" not in self.task.limits.allowed)
        return self.match.lost_crossings + turns

    @cached_property
    def _lost_turns(self) -> list[tuple[float, float]]:
        """The recorded turns [rad] that are lost, and those of their paths."""
        driven = zip(self.task.drivers, self.match.paths, strict=True)
        turns = [(turn_of(track), path.turn) for track, path in driven if not follows_bend(track)]
        return [each for each in turns if not is_same_turn(*each)]

    @cached_property
    def losses(self) -> tuple[Loss, ...]:
        """The losses of the encounter."""
        return find_losses(self.task.tracks, self.separation.tracks)

    @property
    def refused_losses(self) -> list[Loss]:
        """The losses for which a fit is refused."""
        refused = LOSABLE.keys() - self.task.limits.allowed
        return [loss for loss in self.losses if loss.kind in refused]

    @cached_property
    def separation(self) -> Separation:
        """All recorded tracks on the lanes, so far apart from each other as is needed.

        Pedestrians stay next to the driver that comes nearest to them.

        Raises:
            RefusedError: vehicles are too near to each other.
        """
        return self.task.separated(self._placed)

    @cached_property
    def _placed(self) -> tuple[Track, ...]:
        """All recorded tracks on the lanes."""
        drivers = self.task.drivers
        driven = _tracks_on(self.match, drivers)
        placed_of = {track.vehicle.id: track for track in driven}
        return tuple(
            placed_of.get(track.vehicle.id) or _moved_with_nearest(track, drivers, driven)
            for track in self.task.tracks
        )

    @cached_property
    def _motion(self) -> Motion:
        """The motion of the drivers, unchecked."""
        placed = drivers_of(self._placed)
        poses = np.stack([track.poses for track in placed])
        return Motion(
            vehicles=tuple(track.vehicle for track in placed),
            time=frozen(np.arange(poses.shape[1]) * placed[0].dt),
            position=poses[..., :2],
            heading=poses[..., 2],
            speed=np.stack([track.speed for track in placed]),
            present=np.stack([track.present for track in placed]),
        )

    @cached_property
    def _conflicts(self) -> tuple[Conflict, ...]:
        """The conflicts in this motion."""
        return find_conflicts(self._motion)

    @cached_property
    def yields(self) -> bool:
        """Whether a vehicle gives way that has to by the rules."""
        check = self.task.check
        return bool(check.rules) and bool(check.kept_orders(self._motion, self._conflicts))

    @cached_property
    def refusal(self) -> str:
        """Why it cannot be used; "" if it can."""
        if self.task.graph.network.has_levels and (above := self._stacked_vehicles()):
            return above
        try:
            _ = self.separation
        except RefusedError as error:
            return f"{error}: more lanes side by side are needed"
        check = self.task.check
        breaches = check.breaches(self._motion, self._conflicts) if check.rules else []
        if not breaches:
            return ""
        vehicle = self._motion.vehicles[breaches[0].vehicles[0]].id
        return f"vehicle {vehicle} {breaches[0].message}; road.traffic_rules=ignored allows it"

    def _stacked_vehicles(self) -> str:
        """Return which two vehicles would be above each other, as on a bridge; "" if none."""
        lanes = self.task.graph.network.lanes
        driven = []
        for path in self.match.paths:
            count = max(math.ceil((path.end - path.start) / 2.0), 1) + 1  # every two metres
            places = path.curve.at(np.linspace(path.start, path.end, count))[:, :2]
            centres = KDTree(np.concatenate([lanes[k].centre for k in path.lanes]))
            heights = np.concatenate([lanes[k].height for k in path.lanes])
            driven.append((places, heights[centres.query(places)[1]]))
        for i, j in combinations(range(len(driven)), 2):
            (places, height), (other_places, other_height) = driven[i], driven[j]
            on_two_levels = np.abs(height[:, None] - other_height) > LEVEL_SPACING_M
            if (on_two_levels & (cdist(places, other_places) < _OVERLAP_M)).any():
                first, second = (self.task.drivers[n].vehicle.id for n in (i, j))
                return (
                    f"vehicles {first} and {second} would be above each other, as on a bridge, "
                    "and not meet"
                )
        return ""


def _tracks_on(match: Match, tracks: Sequence[Track]) -> tuple[Track, ...]:
    """Return the recorded tracks on their lane paths."""
    placed = []
    for path, track in zip(match.paths, tracks, strict=True):
        driven = float(path.progress[-1])
        curve = path.curve.cut(path.start, path.start + max(driven, 1.0), 0.25)
        progress = path.progress * (curve.length / driven if driven > 1.0 else 1.0)
        on_curve = frozen(np.minimum(progress, curve.length))
        placed.append(replace(track, curve=curve, progress=on_curve, lane=path.curve))
    return tuple(placed)


def _moved_with_nearest(
    track: Track, drivers: tuple[Track, ...], placed: tuple[Track, ...]
) -> Track:
    """Return a pedestrian's track, moved like the nearest driver where it comes nearest."""
    points = track.curve.points
    distances = [cdist(points[:, :2], driver.poses[:, :2]) for driver in drivers]
    n = int(np.argmin([float(each.min()) for each in distances]))
    k = int(np.argmin(distances[n].min(axis=0)))
    before, after = drivers[n].poses[k], placed[n].poses[k]
    moved = place(after, *ahead_and_left(points[:, :2] - before[:2], before[2]))
    yaw = points[:, 2] + after[2] - before[2]
    return replace(track, curve=Curve(np.column_stack((moved, yaw))))

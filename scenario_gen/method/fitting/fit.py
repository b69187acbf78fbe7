# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The fitting: how a recording is placed on a road, and what of the encounter it loses there.

Each vehicle follows a chain of lanes, if the road has lanes.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
import math

import numpy as np

from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting.config import allowed_losses, FittingConfig
from scenario_gen.method.fitting.placement import (
    end_speeds,
    place_given,
    place_in_own_frame,
    Placement,
    STANDING_SPEED_MPS,
)
from scenario_gen.method.fitting.search import place_by_search
from scenario_gen.method.fitting.state_check import refuse_impossible, refuse_misfits
from scenario_gen.numerics import Bools, Floats, frozen_ints, Ints, runs
from scenario_gen.roads import (
    best_place,
    ground_for,
    lane_graph,
    LanePath,
    lights_of,
    nearest_pose_with_room,
    share_with_room,
    users_of,
)
from scenario_gen.situation import (
    drivers_of,
    find_losses,
    LOSABLE,
    manoeuvre_of,
    refuse_reversing,
    Situation,
    Track,
    turn_of,
)
from scenario_gen.types import (
    BoundaryStates,
    Encounter,
    Fit,
    FittedVehicle,
    LaneNetwork,
    Loss,
    Note,
    NoteKind,
    Request,
    Road,
    Segmentation,
    SignalStop,
    TypeLimits,
)

_EXTRAPOLATION_M = 30.0  # beyond the end of a path, straight on


class LostEncounterError(RefusedError):
    """The recording fits the road, but a part of its encounter would be lost there."""


def refuse_lost(losses: Iterable[Loss], allow: str, road: str) -> None:
    """Refuse a fit with losses that `allow` does not name.

    Raises:
        LostEncounterError: it has some; the message names the vehicles and the parameter.
    """
    allowed = allowed_losses(allow)
    refused = [loss for loss in losses if loss.kind in LOSABLE and loss.kind not in allowed]
    if refused:
        kinds = sorted(allowed | {loss.kind for loss in refused})
        names = ",".join(f"lost_{kind}" for kind in kinds)
        reasons = "; ".join(loss.message for loss in refused)
        raise LostEncounterError(
            f"road {road} has nowhere this encounter fits unchanged: {reasons}; "
            f"fitting.allow={names} accepts this"
        )


def find_unused(network: LaneNetwork, used: Iterable[int]) -> tuple[Loss, ...]:
    """Return the loss of arms of a drawn junction without vehicles, given the used lanes."""
    arms = network.arms
    arm_of = {k: arm for arm, lanes in arms.items() for k in lanes}
    unused = len(arms) - len({arm_of[k] for k in used if k in arm_of})
    if len(arms) < 3 or not unused:
        return ()
    are = "is" if unused == 1 else "are"
    message = (
        f"{unused} of the {len(arms)} arms of road {network.name} {are} unused: no recorded "
        "vehicle enters or leaves there"
    )
    return (Loss("arm", (), message),)


def lost_lights(
    stops: Iterable[SignalStop], placed: tuple[Track, ...], road: Road
) -> Iterator[Loss]:
    """Yield the stops at red of a recording where a road has no light."""
    network = road.lanes
    lights = lights_of(network) if network is not None and network.rules_kept else ()
    for stop in stops:
        curve, name = placed[stop.who].curve, placed[stop.who].vehicle.id
        points = curve.at(np.arange(0.0, curve.length + _EXTRAPOLATION_M, 0.5))
        if stop.stands and not any(light.leads_over(points[:, :2]) for light in lights):
            message = f"vehicle {name} stops at red, and the road has no light there"
            yield Loss("light", (name,), message)


def place_on_lanes(tracks: tuple[Track, ...], road: Road, config: FittingConfig) -> Placement:
    """Place a recording on a road's lanes at the best place with room for all vehicles.

    Raises:
        RefusedError: there is no place; the message has the reason of the best attempt.
    """
    drivers = drivers_of(tracks)
    if road.lanes is None:
        raise RefusedError(f"road {road.name} has no lanes; choose another fitting.placement")
    if drivers[0].vehicle.kind.walks:
        raise RefusedError(
            "no recorded vehicle drives, so the encounter cannot be placed on the lanes of road "
            f"{road.name}"
        )
    network = lane_graph(road.lanes, users_of(drivers)).network
    place = best_place(road, tracks, config.place_limits)
    paths = place.match.paths
    notes = [*network.notes]
    notes += [_note(path, track, network) for path, track in zip(paths, drivers, strict=True)]
    if place.scale != 1.0:
        notes.append(Note.of(NoteKind.SCALED, scale=place.scale))
    placement = Placement.separated(place.separation, place.scale, notes)
    return replace(placement, unused=find_unused(network, [k for p in paths for k in p.lanes]))


def _note(path: LanePath, track: Track, network: LaneNetwork) -> Note:
    """Return the note on the lanes of a vehicle, and on a speed above their limit."""
    lanes = ", ".join(network.lanes[k].id for k in path.lanes)
    limit = max((network.lanes[k].speed_limit for k in path.lanes), default=math.nan)
    fastest = float(track.speed.max())
    if fastest > limit + 0.5:
        lanes += f"; its {fastest:.1f} m/s exceed their limit of {limit:.1f} m/s"
    return Note.of(NoteKind.ON_LANES, vehicle=track.vehicle.id, lanes=lanes)


def assemble_fit(
    situation: Situation,
    segmentation: Segmentation,
    road: Road,
    placement: Placement,
    config: FittingConfig,
    given: Floats | None = None,
) -> Fit:
    """Return the fit of a placement, with anchors at the changepoints.

    Args:
        situation: of the recording.
        segmentation: its changepoints.
        road: the target.
        placement: the recording on the road.
        config: how far anchors may be moved.
        given: (N, 2, 4) start and end states to be met exactly, NaN for those that are free.

    Source: eq 9.

    Raises:
        RefusedError: an anchor is farther than `max_move` from the nearest pose with room.
    """
    encounter = situation.encounter
    last = encounter.speed.shape[1] - 1
    index = frozen_ints(np.concatenate(([0], segmentation.changepoints, [last])))
    if given is None:
        given = np.full((len(placement.tracks), 2, 4), np.nan)
    speeds = end_speeds(encounter, placement.scale[:, None])
    notes = list(placement.notes)
    fitted, states = [], []
    for i, track in enumerate(placement.tracks):
        stands = _standing_primitives(track, index)
        progress = _progress_at_anchors(track, index, stands)
        anchors, moved, moves = _repaired(
            ground_for(road, track.vehicle),
            track,
            _with_given_ends(track.curve.at(progress), progress, given[i], still=track.still),
            progress,
            (index * encounter.dt).tolist(),
            config,
        )
        notes += moves
        moved = moved + placement.moved[i]
        if moved.max() > config.max_move:
            raise RefusedError(
                f"vehicle {track.vehicle.id} would be moved by {moved.max():.2f} m, away from "
                f"others and onto road {road.name}; fitting.max_move accepts {config.max_move:g} m"
            )
        turns = turn_of(situation.tracks[i]), turn_of(track)
        scale = float(placement.scale[i])
        manoeuvre = "wait" if track.still else manoeuvre_of(turns[1])
        path = _path(track)
        fitted.append(FittedVehicle(anchors, moved, stands, scale, manoeuvre, turns, path))

        requested = np.where(np.isfinite(given[i, :, 0]), given[i, :, 3], speeds[i])
        states.append(np.column_stack((anchors[[0, -1]], requested * (not track.still))))
    start, end = np.stack(states, axis=1)
    ends = BoundaryStates(start=start, end=end)
    losses = (
        *find_losses(situation.tracks, placement.tracks),
        *lost_lights(situation.reactions.stops, placement.tracks, road),
        *placement.unused,
    )
    return Fit(encounter.vehicles, tuple(fitted), index, ends, tuple(notes), losses)


def _with_given_ends(anchors: Floats, progress: Floats, given: Floats, *, still: bool) -> Floats:
    """Return anchors (K + 2, 3) with the given start and end states (2, 4) in their places."""
    anchors = anchors.copy()
    if np.isfinite(given[0, 0]):
        anchors[progress == progress[0]] = given[0, :3]
    if np.isfinite(given[1, 0]) and not still:
        anchors[progress == progress[-1]] = given[1, :3]
    return anchors


def _path(track: Track) -> Floats:
    """Return poses (M, 3) every half metre along the placed path from start to end."""
    if track.still:
        return track.curve.points[:1]
    first, last = float(track.progress[0]), float(track.progress[-1])
    count = max(int(np.ceil((last - first) / 0.5)), 1) + 1
    return track.curve.at(np.linspace(first, last, count))


def _standing_primitives(track: Track, index: Ints) -> Bools:
    """Return (K + 1,) in which primitives the vehicle stands: slow, and nearly without a path."""
    if track.still:
        return np.ones(len(index) - 1, dtype=np.bool_)
    primitives = list(pairwise(index))
    driven = np.array([track.progress[b] - track.progress[a] for a, b in primitives])
    fastest = np.array([track.speed[a : b + 1].max() for a, b in primitives])
    slow = (driven < 0.5) & (fastest < STANDING_SPEED_MPS)
    stands = slow | (driven < 1e-3)
    if stands.all():  # it does move a little
        stands[int(np.argmax(driven))] = False
    return np.asarray(stands)


def _progress_at_anchors(track: Track, index: Ints, stands: Bools) -> Floats:
    """Return the progress (K + 2,) [m] at the anchors; both ends of a dwell are one place.

    The start and the end of the path do not move.
    """
    progress = track.progress[index].copy()
    for first, last in runs(stands):
        until_end = last == len(stands) and first > 0
        progress[first : last + 1] = progress[last if until_end else first]
    return progress


def _repaired(
    road: Road,
    track: Track,
    anchors: Floats,
    progress: Floats,
    times: list[float],
    config: FittingConfig,
) -> tuple[Floats, Floats, list[Note]]:
    """Move anchors (K + 2, 3) to where they have room.

    Returns:
        The anchors, how far each was moved (K + 2,) [m], and notes on it.

    Raises:
        RefusedError: an anchor would be moved by more than `max_move`.
    """
    anchors = anchors.copy()
    moved = np.zeros(len(anchors))
    notes = []
    vehicle = track.vehicle
    for k in range(len(anchors)):
        if k and progress[k] == progress[k - 1]:
            anchors[k], moved[k] = anchors[k - 1], moved[k - 1]
            continue
        name = {0: "start", len(anchors) - 1: "end"}.get(k, f"changepoint at {times[k]:.1f} s")
        nearest = nearest_pose_with_room(
            road, anchors[k], vehicle.length, vehicle.width, config.max_move
        )
        if nearest is None:
            x, y = anchors[k, :2]
            raise RefusedError(
                f"vehicle {vehicle.id}: its {name} (x {x:.1f}, y {y:.1f}) is more than "
                f"{config.max_move:g} m from the nearest pose with room on road {road.name}"
            )
        anchors[k], moved[k] = nearest
        if moved[k] > 0.0:
            notes.append(
                Note.of(NoteKind.ANCHOR_MOVED, vehicle=vehicle.id, anchor=name, distance=moved[k])
            )
    return anchors, moved, notes


# The share of footprints with room in the recording's own frame, with which it is placed there;
# recorded cars leave recorded maps now and then.
_MIN_ROOM_AT_HOME_SHARE = 0.98
_MIN_ROOM_WITHOUT_LANES_SHARE = 0.5


def fit_template(
    encounter: Encounter | Situation,
    segmentation: Segmentation,
    road: Road,
    config: FittingConfig = FittingConfig(),
    *,
    request: Request = Request(),
    limits: TypeLimits = TypeLimits(),
) -> Fit:
    """Place a recording on a road (paper III-A, eqs 7-9 corrected).

    Args:
        encounter: the recording, or its situation.
        segmentation: its changepoints; they decide which anchors are reported, and never the
            start and the end.
        road: the target.
        config: how the recording is placed, and how far it may be scaled and moved.
        request: the start and end states that are requested for some vehicles.
        limits: of motion; no requested state may exceed a planned speed.

    Raises:
        LostEncounterError: the best place on the road has a loss that `config.allow` does not
            name.
        RefusedError: the recording does not fit, or a requested state is impossible.
        InputError: a named vehicle does not exist.

    Examples:
        >>> import scenario_gen as sg
        >>> (encounter,) = sg.read_log("examples/my_log.csv").encounters
        >>> road = sg.build_road("four_way", encounter)
        >>> fit = sg.fit_template(encounter, sg.segment(encounter), road)
        >>> fit.losses
        ()
    """
    situation = Situation.of(encounter)
    encounter = situation.encounter
    refuse_reversing(encounter)
    request.ego_of(encounter)  # refuses an unknown vehicle
    if request.moves:
        return _fit_request(situation, segmentation, road, config, request, limits)
    placement = _place(situation, road.cleared, config)
    fit = assemble_fit(situation, segmentation, road, placement, config)
    losses = [loss for loss in fit.losses if loss.kind == "light" or not placement.at_home]
    refuse_lost(losses, config.allow, road.name)
    return fit


def _fit_request(
    situation: Situation,
    segmentation: Segmentation,
    road: Road,
    config: FittingConfig,
    request: Request,
    limits: TypeLimits,
) -> Fit:
    """Return the fit with requested states; lanes are as requested, so only conflicts count."""
    encounter = situation.encounter
    starts, goals = (request.rows(end, encounter) for end in ("starts", "goals"))
    refuse_impossible(encounter, road, starts, goals, limits)
    base = None
    if np.isnan(starts).any() or np.isnan(goals).any():
        base = _place(situation, road.cleared, config)
    placement, given = place_given(situation, road, config, starts, goals, base)
    fit = assemble_fit(situation, segmentation, road, placement, config, given)
    refuse_misfits(fit, starts, goals)
    conflicts = [loss for loss in fit.losses if loss.kind == "conflict"]
    refuse_lost(conflicts, config.allow, road.name)
    return fit


@lru_cache(maxsize=1)  # the references have the same placement with other changepoints
def _place(situation: Situation, road: Road, config: FittingConfig) -> Placement:
    tracks = situation.tracks
    if config.placement == "search":
        return place_by_search(tracks, road, config)
    if config.placement == "identity":
        return place_in_own_frame(situation, road, config)
    if config.placement == "lanes" or road.map_lanes is not None:
        return place_on_lanes(tracks, road, config)

    placed, home_refusal = tracks, ""
    try:
        at_home = place_in_own_frame(situation, road, config)
        placed = at_home.tracks
    except RefusedError as error:
        home_refusal = str(error)
    share = float(np.mean([share_with_room(road, track) for track in placed]))
    enough = _MIN_ROOM_WITHOUT_LANES_SHARE if road.lanes is None else _MIN_ROOM_AT_HOME_SHARE
    if not home_refusal and share >= enough:
        return at_home
    try:
        if road.lanes is None:
            return place_by_search(tracks, road, config)
        return place_on_lanes(tracks, road, config)
    except RefusedError as error:
        if share < _MIN_ROOM_WITHOUT_LANES_SHARE or not home_refusal:
            raise
        raise RefusedError(
            f"where it was recorded, {home_refusal}; elsewhere on road {road.name}, {error}"
        ) from error

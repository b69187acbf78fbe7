"""The template's own frame: a map recorded in it, or a corridor drawn around it."""

import numpy as np

from scenario_gen.arrays import frozen
from scenario_gen.encounter import Encounter
from scenario_gen.errors import RefusedError
from scenario_gen.fitting.config import FittingConfig
from scenario_gen.fitting.placement import Placement, room
from scenario_gen.roads.own_paths import own_paths
from scenario_gen.roads.repair import nearest_pose_with_room
from scenario_gen.roads.road import Road


def place_in_own_frame(encounter: Encounter, road: Road, config: FittingConfig) -> tuple[Placement, float]:
    """Leave the template where it was recorded (only pulled apart where the record has vehicles overlap).

    Returns:
        The placement, and the share of sampled footprints that have room as they are.

    Raises:
        RefusedError: a sampled pose is farther than `max_move` from the nearest with room.
    """
    separation = own_paths(encounter)
    shares = []
    for track in separation.tracks:
        share = float(room(road, track))
        shares.append(share)
        if share == 1.0:
            continue
        poses = track.poses
        for t in sorted({0, len(poses) - 1, *range(0, len(poses), 5)}):
            if nearest_pose_with_room(road, poses[t], track.vehicle.length, track.vehicle.width, config.max_move) is None:
                x, y = poses[t, :2]
                raise RefusedError(
                    f"in its own frame vehicle {track.vehicle.id} is more than {config.max_move:g} m from any pose with room "
                    f"on road {road.name} at {encounter.time[t]:.1f} s (x {x:.1f}, y {y:.1f})"
                )
    n = len(separation.tracks)
    placement = Placement(
        tracks=separation.tracks,
        scale=frozen(np.ones(n)),
        manoeuvre=tuple("wait" if track.still else "own path" for track in separation.tracks),
        moved=separation.moved,
        notes=(f"placed on road {road.name} in the template's own frame", *separation.notes),
    )
    return placement, float(np.mean(shares))

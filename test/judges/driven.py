# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Judge drives in closed loop by commonroad-drivability-checker, in the environment of requirements/judges-commonroad.lock.

`python driven.py FILE`: a line of JSON for each drive, a list of vehicles with the ego first; each has `size`, length and width
[m], and `poses`, x, y [m], yaw [rad] at each instant, null where it is not on the scene. One JSON object on the last line: the
first instant at which the ego meets another, null where it meets nobody, for each drive.
"""

import json
from pathlib import Path
import sys

from commonroad_dc.pycrcc import CollisionChecker, RectOBB, TimeVariantCollisionObject


def occupancy(vehicle, instants):
    """Return a vehicle as the checker has it at some instants in a row at which it is there."""
    found = TimeVariantCollisionObject(instants[0])
    length, width = vehicle["size"]
    for k in instants:
        x, y, yaw = vehicle["poses"][k]
        found.append_obstacle(RectOBB(0.5 * length, 0.5 * width, yaw, x, y))
    return found


def stretches(vehicle):
    """Yield the instants of each time that a vehicle is on the scene."""
    here, instants = [k for k, pose in enumerate(vehicle["poses"]) if pose is not None], []
    for k in here:
        if instants and k != instants[-1] + 1:
            yield instants
            instants = []
        instants.append(k)
    if instants:
        yield instants


def first_contact(drive):
    """Return the first instant at which the ego meets another."""
    ego, *others = drive
    checker = CollisionChecker()
    for other in others:
        for instants in stretches(other):
            checker.add_collision_object(occupancy(other, instants))
    if not checker.collide(occupancy(ego, range(len(ego["poses"])))):
        return None
    return next(k for k in range(len(ego["poses"])) if checker.collide(occupancy(ego, [k])))


if __name__ == "__main__":
    drives = map(json.loads, Path(sys.argv[1]).read_text().splitlines())
    print(json.dumps({"contacts": [first_contact(drive) for drive in drives]}), flush=True)

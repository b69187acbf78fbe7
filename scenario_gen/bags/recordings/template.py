# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A template from its messages: tracks, changepoints, road and plan."""

from collections.abc import Mapping

import numpy as np

from msg_conventions.changepoints import decode_changepoints
from msg_conventions.documents import LANES, PLAN
from msg_conventions.fits import decode_plan
from msg_conventions.roads import decode_map
from msg_conventions.tracks import decode_tracks
from scenario_gen.base.errors import InputError
from scenario_gen.types import Planned

NEEDED = ("tracks", "changepoints", "map", PLAN)


def decode_template(messages: Mapping[str, bytes]) -> Planned:
    """Return the fitted template in messages by topic: `NEEDED`, and `road/lanes` if there is one.

    Raises:
        InputError: a message is damaged, or does not belong to the others.
    """
    encounter = decode_tracks(messages["tracks"])
    segmentation = decode_changepoints(messages["changepoints"], encounter)
    _, road = decode_map(messages["map"], messages.get(LANES))
    plan = decode_plan(messages[PLAN])
    if not np.array_equal(plan.anchors[1:-1], segmentation.changepoints):
        raise InputError(f"{PLAN}: its anchors are not those of the changepoints")
    if plan.frame_id != road.frame_id:
        raise InputError(
            f"{PLAN}: frame {plan.frame_id!r} is not that of the map, {road.frame_id!r}"
        )
    return Planned(encounter, segmentation, road, plan.fit(encounter), plan.routes)

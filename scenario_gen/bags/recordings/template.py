# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A template from its messages: tracks, changepoints, road, plan and diagnostics."""

from collections.abc import Iterable, Mapping

import numpy as np

from msg_conventions.changepoints import decode_changepoints
from msg_conventions.diagnostics import decode_diagnostics, TEMPLATE, template_of
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


def template_statuses(
    messages: Iterable[bytes], stamp_ns: int, nodes: str = "/"
) -> dict[str, Mapping[str, str]]:
    """Return the key-values of diagnostics about one template, by subject; the last ones count.

    The subject of "/planner: fit" is "fit".

    Args:
        messages: those of /diagnostics.
        stamp_ns: stamp of the template.
        nodes: prefix of the full names of the nodes.
    """
    by_subject: dict[str, Mapping[str, str]] = {}
    for data in messages:
        try:
            stamp, statuses = decode_diagnostics(data)
        except InputError:
            continue
        for status in statuses:
            if template_of(status, stamp) == stamp_ns and status.name.startswith(nodes):
                values = {key: value for key, value in status.values.items() if key != TEMPLATE}
                by_subject[status.name.partition(": ")[2]] = values
    return by_subject

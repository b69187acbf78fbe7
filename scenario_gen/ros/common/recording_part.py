# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""`tracks/part`: where a recording does not fit a road as a whole, a stage requests its part.

The node that sent the tracks sends that part in their place, so all stages continue with it.
"""

from collections.abc import Callable

import numpy as np

from msg_conventions.diagnostics import Level
from msg_conventions.tracks import decode_tracks, encode_tracks
from scenario_gen.base.cancelling import stop_if_cancelled
from scenario_gen.base.errors import RefusedError
from scenario_gen.method.fitting import FittingConfig
from scenario_gen.method.shortening import cut, fitting_part
from scenario_gen.ros.common.stage_node import StageNode
from scenario_gen.types import Encounter

TOPIC = "tracks/part"


def request_part(
    node: StageNode,
    attempt: Callable[[Encounter], object],
    encounter: Encounter,
    refusal: RefusedError,
    config: FittingConfig,
) -> None:
    """Request the part of a recording that fits with the smallest loss.

    It begins at least a sample later than the recording: stages pair messages by their stamps.

    Args:
        node: the stage.
        attempt: raises a RefusedError if a recording does not fit.
        encounter: the recording.
        refusal: why the whole does not fit.
        config: what is kept before and after the interaction.

    Raises:
        RefusedError: no part fits, or none is wanted.
    """
    if not config.shorten:
        raise refusal

    def unless_cancelled(part: Encounter) -> object:
        stop_if_cancelled()
        return attempt(part)

    part, _, note = fitting_part(unless_cancelled, encounter, refusal, config)
    if part.start_ns == encounter.start_ns:
        part = cut(part, np.maximum(part.time[part.present], part.dt))
    node.outputs.send(TOPIC, encode_tracks(part))
    node.status(Level.WARN, str(note), "part", encounter.start_ns)


def send_part(node: StageNode, whole: Encounter | None, data: bytes) -> None:
    """Send a requested part as tracks if it is one of the recording that the node sent."""
    part = decode_tracks(data)
    if whole is None or part.ids != whole.ids:
        return
    offset = (part.start_ns - whole.start_ns) * 1e-9
    if 0.0 < offset < whole.duration:
        sent = cut(whole, part.time[part.present] + offset)
        if encode_tracks(sent) == data:
            node.outputs.send("tracks", data)

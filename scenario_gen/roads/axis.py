# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The dividing line of a main road that is shaped to its template's bends."""

from scenario_gen.base.errors import RefusedError
from scenario_gen.numerics.curve import Curve
from scenario_gen.roads.config import RoadConfig
from scenario_gen.roads.shaped import bends, main_axis
from scenario_gen.template import main_line, to_frenet, Track


def bent_axis(name: str, tracks: tuple[Track, ...], config: RoadConfig) -> Curve | None:
    """The dividing line of the main road that `draw_bent` draws for a template; None if the road `name` is not drawn so."""
    try:
        main = main_line(to_frenet(tracks), tracks)
    except RefusedError:  # a junction's template
        return None
    return main_axis(name, main, config) if bends(name, main) else None

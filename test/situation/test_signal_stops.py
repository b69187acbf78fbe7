# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A stop at red is a stop for the light, not for the vehicles that cross."""

from dataclasses import replace

import numpy as np
import pytest
from support.signalised import signalised

from scenario_gen import read_log
from scenario_gen.situation import Situation
from scenario_gen.types import FOLLOW, SignalSchedule


@pytest.mark.parametrize(("lag", "queue"), [(0.8, 1), (1.4, 2), (2.2, 3)])
def test_queue_stops_for_the_light(lag, queue):
    (encounter,) = read_log(signalised(lag=lag, queue=queue)).encounters
    graph = Situation.of(encounter).reactions
    assert {edge.kind for edge in graph.edges} <= {FOLLOW}
    assert len(graph.edges) == queue - 1
    assert [encounter.ids[stop.who] for stop in graph.stops] == ["2", "3", "4"][:queue]
    assert [stop.queue for stop in graph.stops] == list(range(queue))
    assert graph.stops[0].lag == pytest.approx(lag, abs=0.25)
    assert "vehicle 2 stops at red, leaves" in graph.sentences(encounter.vehicles)[queue - 1]


def test_no_lights_without_states():
    (encounter,) = read_log(signalised(lights=False)).encounters
    assert encounter.lights == () and Situation.of(encounter).reactions.stops == ()


@pytest.mark.parametrize(("lag", "green"), [(-0.5, [13.0]), (1.4, [13.0]), (-2.5, [np.inf])])
def test_cycle_turns_green_as_recorded(lag, green):
    """Its first phase begins while the vehicle departs, at most 1 s before; who departs earlier sees no green."""
    (recorded,) = read_log(signalised(lag=lag)).encounters
    start = 13.0 - recorded.start_ns * 1e-9
    cycle = SignalSchedule.cycle((15.0, 15.0), ("green", "red"), start)
    lights = tuple(
        replace(light, schedule=cycle) if light.id == "B" else light for light in recorded.lights
    )
    stops = Situation.of(replace(recorded, lights=lights)).reactions.stops
    assert [stop.green - start + 13.0 for stop in stops] == pytest.approx(green)

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Streams with one gap: from recorded encounters; who insists on his turn does not wait."""

import numpy as np
import pytest
from support.motions import as_scenario

from scenario_gen.base.errors import RefusedError
from scenario_gen.closed_loop.ego import Command
from scenario_gen.closed_loop.planners import RouteFollower
from scenario_gen.closed_loop.simulation import ClosedLoop
from scenario_gen.closed_loop.streams import CLOSED_S, SPARE_S, Stream
from scenario_gen.closed_loop.verdict import judge
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.situation import Situation


class Departs(RouteFollower):
    """Stands for some seconds, then drives 8 m/s, whoever comes."""

    def __init__(self, wait):
        self.wait = wait

    def act(self, observation):
        wanted = 8.0 * (observation.time >= self.wait)
        return Command(2.0 * (wanted - observation.ego.speed), self.steer(observation.ego)[0])


@pytest.fixture(scope="module")
def stream():
    """Return the stream of a recorded crossing in which vehicle 2 yields."""
    encounter = read_log("examples/my_log.csv").encounters[0]
    return Stream.of(encounter, encounter.ids.index("2"))


@pytest.mark.parametrize("queue", (0.0, 4.0))
def test_stream_has_one_gap_on_time(stream, queue):
    encounter = stream.open_at(8.0, queue, 0.1)
    stream_rows = [row for row, name in enumerate(encounter.ids) if name.startswith("1-")]
    found = Situation.of(encounter).conflicts
    conflicts = [c for c in found if c.pair[0] == 0 and c.pair[1] in stream_rows]
    before = [c for c in conflicts if c.second == 0]
    after = [c for c in conflicts if c.first == 0]
    assert len(before) >= 4 and len(after) >= 3
    last, following = before[-1], after[0]
    assert last.entry_second == pytest.approx(8.0, abs=0.3)
    assert last.encroachment == pytest.approx(SPARE_S[0], abs=0.3)
    assert following.encroachment == pytest.approx(SPARE_S[1], abs=0.4)
    exits = [c.exit_first for c in before]
    entries = [c.entry_first for c in before]
    assert max(np.subtract(entries[1:], exits[:-1])) < CLOSED_S + 0.1  # closed before the gap


def test_insisting_vehicle_awaits_no_late_ego(stream):
    loop = ClosedLoop(as_scenario(stream.open_at(8.0, 0.0, 0.1)), 0)
    assert loop.insists.sum() == len(loop.conflicts)
    verdicts = {wait: judge(loop, loop.drive(Departs(wait))) for wait in (3.0, 6.2, 10.0)}
    assert verdicts[6.2].passed and not verdicts[6.2].took_turn
    for wait in (3.0, 10.0):
        assert not verdicts[wait].passed
        assert verdicts[wait].collision is not None or verdicts[wait].took_turn


def test_vehicle_meeting_nobody_has_no_stream():
    encounter = read_log(bundled("b")).encounters[0]
    with pytest.raises(RefusedError, match="waits for nobody"):
        Stream.of(encounter, Situation.of(encounter).conflicts[0].first)

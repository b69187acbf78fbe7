# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Signs of the three formats are read alike; a template goes where its yielder has to yield; runs of stop lines are found."""

from dataclasses import replace

import numpy as np
import pytest
from support.map_builders import ARMS, at, FORMATS, HALF, write

from scenario_gen.base.errors import RefusedError
from scenario_gen.roads import places, read_network, RuleCheck
from scenario_gen.situation import clean_tracks, find_conflicts
from scenario_gen.types import Encounter, NoteKind, RuleKind, Scenario, Vehicle

DT = 0.1
KINDS = {
    "206": RuleKind.STOP,
    "205": RuleKind.GIVE_WAY,
    "306": RuleKind.PRIORITY,
    "light": RuleKind.TRAFFIC_LIGHT,
}


def drive(arm, speeds, start):
    """Return positions (T, 2), headings (T,) and speeds (T,) of who goes straight over the crossroads from `start` [m] on."""
    along = start + np.concatenate(([0.0], np.cumsum(DT * (speeds[1:] + speeds[:-1]) / 2.0)))
    heading = float(np.arctan2(*ARMS[arm][::-1]))
    return np.array([at(arm, s, 1.75) for s in along]), np.full(len(along), heading), speeds


def crossing(first="w", second="s", stands=True):
    """Return the motion of two: the second one waits before the crossroads for the first one, or slows down for it."""
    steps = np.arange(120)
    slow = np.interp(
        steps * DT,
        [0.0, 2.0, 5.0, 5.5, 9.0, 12.0],
        [7.0, 6.0, 0.0 if stands else 3.0, 0.0 if stands else 3.0, 7.0, 7.0],
    )
    drives = [drive(first, np.full(120, 8.0), -35.0), drive(second, slow, -33.5)]
    position, heading, speed = (np.stack(part) for part in zip(*drives, strict=True))
    vehicles = (Vehicle("1", 4.5, 1.8), Vehicle("2", 4.5, 1.8))
    return Scenario(vehicles, steps * DT, position, heading, speed, np.gradient(speed, DT, axis=1))


def template(motion):
    return Encounter(
        motion.vehicles, motion.time, motion.position, motion.heading, motion.speed, "crossing"
    )


def network_with(folder, suffix, signs):
    return read_network(write(folder, suffix, FORMATS[suffix](signs=signs)))


def broken(network, motion):
    return RuleCheck(network).breaches(motion, find_conflicts(motion))


def arm_of(point):
    """The arm from which a point (2,) [m] is seen ahead."""
    return min(ARMS, key=lambda arm: np.square(np.array(at(arm, -30.0, 0.0)) - point).sum())


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("sign", KINDS)
def test_sign_has_its_lane_and_priority(tmp_path, suffix, sign):
    network = network_with(tmp_path, suffix, {"s": sign})
    (rule,) = network.rules
    assert rule.kind == KINDS[sign]
    (lane,) = (network.lanes[k] for k in rule.lanes)
    assert arm_of(lane.centre[0]) == "s" and not lane.junction
    over = {arm_of(network.lanes[k].centre[0]) for k in rule.over}
    assert over == ({"w", "e", "n"} if sign in ("205", "206") else set())
    if len(rule.line):
        assert np.allclose(rule.line.mean(axis=0), at("s", -HALF, 1.75), atol=1.1)
    assert (sign == "206") <= len(rule.line)
    assert NoteKind.TRAFFIC_RULES in {note.kind for note in network.notes}


@pytest.mark.parametrize("suffix", FORMATS)
def test_map_without_signs_has_no_rules(tmp_path, suffix):
    network = read_network(write(tmp_path, suffix))
    assert network.rules == () and not RuleCheck(network).rules


@pytest.mark.parametrize("sign", ["205", "206"])
@pytest.mark.parametrize("arm", ARMS)
def test_yielder_goes_where_it_must_yield(tmp_path, sign, arm):
    network = network_with(tmp_path, ".xodr", {arm: sign})
    best = next(places(network, clean_tracks(template(crossing()))))
    yielder = best.paths[1]
    assert arm_of(yielder[np.argmin(np.square(yielder).sum(axis=1)) - 60]) == arm
    other = next(places(replace(network, rules_kept=False), clean_tracks(template(crossing()))))
    assert round(other.cost, 6) <= round(best.cost, 6)


def test_rounding_does_not_choose_places(tmp_path):
    """As another CPU would round: all four arms are alike, and the template lies on the edges of cells."""
    network, motion = network_with(tmp_path, ".xodr", {"s": "205"}), crossing()
    paths = []
    for seed in range(4):
        rounded = motion.position + 1e-12 * np.random.default_rng(seed).standard_normal(
            motion.position.shape
        )
        paths.append(
            [
                place.paths[1][0]
                for place in places(
                    network, clean_tracks(template(replace(motion, position=rounded)))
                )
            ]
        )
    assert all(np.abs(np.subtract(other, paths[0])).max() < 1e-6 for other in paths[1:])


def test_map_with_broken_rules_is_refused(tmp_path):
    network = network_with(tmp_path, ".xodr", dict.fromkeys(ARMS, "206"))
    with pytest.raises(RefusedError, match=r"crosses the stop line.*traffic_rules=ignored"):
        next(places(network, clean_tracks(template(crossing()))))


def test_stopping_at_the_line_runs_nothing(tmp_path):
    network = network_with(tmp_path, ".xodr", {"s": "206"})
    assert broken(network, crossing()) == []
    (breach,) = broken(network, crossing(stands=False))
    assert breach.vehicles == (1,) and "stop line of s" in breach.message
    assert broken(replace(network, rules_kept=False), crossing(stands=False)) == []


def test_going_first_takes_right_of_way(tmp_path):
    network = network_with(tmp_path, ".xodr", {"w": "205"})
    for stands in (True, False):
        (breach,) = broken(network, crossing(stands=stands))
        assert breach.vehicles == (0, 1) and "rule w" in breach.message
    assert broken(network_with(tmp_path, ".xodr", {"s": "205"}), crossing()) == []


def test_going_long_before_takes_nothing(tmp_path):
    network = network_with(tmp_path, ".xodr", {"w": "205"})
    motion = crossing(stands=False)
    late = replace(
        motion,
        position=motion.position - np.array([[[0.0, 0.0]], [[0.0, 40.0]]]),
        speed=np.full((2, 120), 7.0),
    )
    assert broken(network, late) == []


def test_part_keeps_rules_of_its_lanes(tmp_path):
    from scenario_gen.roads import build_road

    path = write(tmp_path, ".xodr", FORMATS[".xodr"](signs={"s": "206", "n": "206"}))
    road = build_road(f"{path}#box=-30,-30,30,5")
    assert [rule.id for rule in road.lanes.rules] == ["s"]
    (lane,) = (road.lanes.lanes[k] for k in road.lanes.rules[0].lanes)
    assert arm_of(lane.centre[0]) == "s"
    assert {arm_of(road.lanes.lanes[k].centre[0]) for k in road.lanes.rules[0].over} == {"w", "e"}

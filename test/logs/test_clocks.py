# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Clocks of logs against pandas and closed forms: times of the day, counters, parts in turn, topics, and who meets whom when."""

import numpy as np
import pandas as pd
import pytest
from support.log_builders import crossing, save
from support.motions import encounter_of

from scenario_gen.logs import Meeting, read_log, Streams
from scenario_gen.logs.bag_names import clock_doubts, TopicClock
from scenario_gen.logs.checks import copies_in
from scenario_gen.logs.clock import in_turn
from scenario_gen.logs.column import Column
from scenario_gen.logs.columns import column_notes, MAX_LISTED_COUNT
from scenario_gen.logs.config import LogConfig
from scenario_gen.logs.extract import encounter_quality
from scenario_gen.logs.growing import Growth
from scenario_gen.logs.stamps import time_of_day
from scenario_gen.logs.table_parts import apart_by_scene

S_TO_NS = 10**9
TIMES = pd.Series(pd.date_range("2026-05-01 08:58:50.5", periods=140, freq="1s"))


@pytest.mark.parametrize(
    ("layout", "unit"), [("%H:%M:%S.%f", ""), ("%H%M%S.%f", "hhmmss"), ("%H%M%S.%f", "")]
)
def test_times_of_day_are_seconds(layout, unit):
    """Over the end of minutes and of an hour."""
    found = time_of_day(TIMES.dt.strftime(layout), Column("t", unit=unit))
    expected = (TIMES - TIMES.dt.normalize()).dt.total_seconds()
    np.testing.assert_allclose(found, expected, atol=1e-6)


@pytest.mark.parametrize("step", [1.0, 25.0, 41.0])
def test_numbers_without_minutes_are_no_times(step):
    """Seconds that reach 60 or more in the last two digits, or that do not jump by 40."""
    numbers = pd.Series(90_000.0 + step * np.arange(200) % 5000)
    assert time_of_day(numbers, Column("t")) is None


@pytest.mark.parametrize(
    "period_s", [4.294967296, 60.0, 65.536, 3600.0, 4294.967296, 86_400.0, 4_294_967.296]
)
def test_counter_that_begins_again_goes_on(tmp_path, period_s):
    """Of 16 and 32 bits in ms, µs or ns, of a minute, an hour or a day; it begins again after 6 s or less."""
    rows = crossing()
    rows["t_s"] = (rows["t_s"] - 1006.0) % period_s
    result = read_log(save(rows, tmp_path))
    (encounter,) = result.encounters
    assert encounter.duration > 11.8
    np.testing.assert_allclose(np.diff(encounter.position[0, :, 0]), 0.8, atol=0.02)
    assert f"begins again after {period_s:g} s" in " ".join(result.quality.notes)


@pytest.mark.parametrize("gap", [3.0, 30.5])
@pytest.mark.parametrize("seed", range(4))
def test_parts_follow_in_turn(seed, gap):
    """Each begins the gap after the last one, or less than 1 s more, unless it does anyway; by whole seconds."""
    rng = np.random.default_rng(seed)
    first = rng.integers(0, 60 * S_TO_NS, 8)
    spans = np.stack([first, first + rng.integers(1, 20 * S_TO_NS, 8)], axis=-1)
    shifts = np.array(in_turn(spans.tolist(), round(gap * S_TO_NS)))
    moved = spans + shifts[:, None]
    gaps = (moved[1:, 0] - moved[:-1, 1]) / S_TO_NS
    assert shifts[0] == 0 and not (shifts % S_TO_NS).any()
    assert (gaps >= gap).all() and ((gaps < gap + 1.0) | (shifts[1:] == shifts[:-1])).all()


@pytest.mark.parametrize(("shared_count", "is_apart"), [(19, False), (20, True)])
def test_scenes_of_single_vehicles_are_trips(shared_count, is_apart):
    """Of 40 scenes at one time, half or more have two vehicles."""
    rows = [
        (time, scene, vehicle)
        for scene in range(40)
        for vehicle in range(1 + (scene < shared_count))
        for time in (0, S_TO_NS)
    ]
    table, notes = apart_by_scene(pd.DataFrame(rows, columns=["time", "scene", "vehicle"]))
    assert bool(notes) == is_apart and (table["time"].nunique() == 80) == is_apart


@pytest.mark.parametrize(
    ("begin", "end", "told", "stops"),
    [(0.0, 0.19, 0, []), (0.0, 0.21, 1, [False]), (0.3, 0.0, 1, [False]), (1.1, 1.1, 1, [True])],
)
def test_clocks_differ_by_the_larger_end(begin, end, told, stops):
    """Of two topics, one ahead of its reception by so much at the beginning and the end."""
    received = np.arange(400) * S_TO_NS
    ahead = (np.interp(np.arange(400), [40, 360], [begin, end]) * S_TO_NS).astype(np.int64)
    clocks = [
        TopicClock("/a", "a", received + 1, received),
        TopicClock("/b", "b", received + ahead + 1, received),
    ]
    doubts = clock_doubts(clocks, is_part=False)
    assert len(doubts) == told and [doubt.stops for doubt in doubts] == stops


@pytest.mark.parametrize("stamps", [(5, 9, 7), (7, 5, 9), (9, 7, 5)])
def test_streams_span_all_their_stamps(stamps):
    streams = Streams(LogConfig())
    for stamp in stamps:
        streams.put_fix("a", stamp * S_TO_NS, 48.0, 11.0)
    assert streams.seconds == 4.0


def test_equal_meetings_join_with_the_earlier():
    meetings = [Meeting(1.0, 0, 1, 2, 20), Meeting(2.0, 0, 1, 3, 5), Meeting(2.0, 10, 2, 3, 15)]
    (group,) = Growth(shortest=1, least=1, most=9).groups(meetings)
    assert group.spans == {1: (0, 20), 2: (0, 20), 3: (0, 5)}
    assert all(len(one.spans) == 2 for one in Growth(shortest=1, least=1, most=2).groups(meetings))


def test_largest_group_has_most_members():
    platoon = [Meeting(float(b), 0, 1, b, 20) for b in range(2, 9)]
    platoon += [Meeting(10.0, 0, a, b, 20) for b in range(3, 9) for a in range(2, b)]
    first, *_ = Growth(shortest=1, least=1, most=5).groups(platoon)
    assert sorted(first.spans) == [1, 2, 3, 4, 5]


def two(offset, present=((0, 60), (0, 60)), speed=2.0):
    """Two vehicles that drive east for 6 s, at an offset (2,) [m]."""
    x = 0.1 * speed * np.arange(61)
    position = np.stack([np.stack([x, 0.0 * x], axis=-1) + at for at in ((0.0, 0.0), offset)])
    return encounter_of(position, speed=speed, present=np.array(present))


@pytest.mark.parametrize(
    ("offset", "speed", "count"),
    [
        ((-3.7, 0.0), 2.0, 1),
        ((-4.0, 0.0), 2.0, 0),
        ((-1.0, 1.8), 2.0, 1),
        ((-1.0, 2.0), 2.0, 0),
        ((-2.0, 0.0), 1.7, 1),
        ((-2.0, 0.0), 1.6, 0),
    ],
)
def test_two_sensors_are_one_vehicle(offset, speed, count):
    """Within 0.8 of its length of 4.8 m, less than its width beside each other, over 10 m."""
    assert len(copies_in([two(offset, speed=speed)])) == count


def test_partly_present_vehicles_are_named():
    whole = encounter_quality(two((0.0, 9.0)))
    partly = encounter_quality(two((0.0, 9.0), ((0, 60), (5, 60))))
    assert whole.partly == () and whole.seconds == pytest.approx(6.0)
    assert partly.partly == (("2", pytest.approx(0.5), pytest.approx(6.0)),)


@pytest.mark.parametrize("more", [0, 1, 5])
def test_columns_beyond_the_list_are_counted(more):
    unused = [f"c{k}" for k in range(MAX_LISTED_COUNT + more)]
    columns = {name: Column(name) for name in ("vehicle", "x", "speed")}
    (note,) = column_notes(columns, "", [*columns, *unused])
    assert (f" and {more} more" in note) == (more > 0) and unused[MAX_LISTED_COUNT - 1] in note

# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""An hour of messages -> which vehicles meet: candidates by a join of half-second bins, then every 0.1 s of those.

Vehicles are not sampled at the same instants, so nothing is joined by exact time. All messages of a vehicle in a half second give
one row, driven on to the middle of it with its speed and heading. Rows of the same half second meet in cells as wide as the
proximity and what a vehicle drives in between: each looks into its own cell and into half of those around it. The database only
proposes: what decides is computed from the messages with `scenario_gen.exact`.
"""

from collections.abc import Iterator
from dataclasses import dataclass
import json
from pathlib import Path
from typing import Any

import numpy as np

from scenario_gen import exact
from scenario_gen.arrays import Bools, Floats, Ints, runs
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.kinds import kind_of, Motion, space_time_gap
from scenario_gen.corpus.messages import database, HOUR
from scenario_gen.corpus.tasks import arriving
from scenario_gen.geodesy import local_frame
from scenario_gen.logs.groups import APART, shortest, ticks, windows

BIN = 500_000  # µs
FASTEST = 35.0  # m/s: what a vehicle drives in a bin widens the cells
METRES = 110_574.0  # of a degree of latitude, at the least
LONGITUDE = 111_320.0  # m of a degree of longitude at the equator
SPREAD = 0.0006  # degrees of latitude between two messages of one vehicle in one bin: further, and there are two of them
ROW = 1 << 24  # cells in a row around the globe, at the most
SHARED = 3  # such bins make an id one that is shared
ELSEWHERE = 1 << 40  # added to a shared id for each further vehicle that bears it
MEDIAN, OUTLIER = 2, 15.0  # messages on both sides, and m from their median: further is no position


@dataclass(frozen=True)
class HourTask:
    """Hours to search: (hour since 2004, the files that hold it or a neighbour), and where `meetings` are written."""

    name: str
    hours: tuple[tuple[int, tuple[Path, ...]], ...]
    folder: Path
    config: CorpusConfig


def overlap(config: CorpusConfig) -> int:
    """Microseconds before and after an hour that its task sees: an encounter at its longest, with what windows may add."""
    return round(1e6 * (config.log.max_duration + config.log.min_duration + APART + config.log.longest_gap + 1.0))


def search_hours(task: HourTask) -> None:
    """Write the meetings of each hour and the messages of those who meet; hours whose table is there are done.

    Raises:
        InputError: the database fails.
    """
    for hour, files in task.hours:
        target = task.folder / f"hour-{hour}.parquet"
        if target.exists():
            continue
        with database(task.folder.parent, task.config.memory, f"hour {hour} of {task.folder.parent}") as base:
            _search(base, hour, files, target, task.config)


def _search(base: Any, hour: int, files: tuple[Path, ...], target: Path, config: CorpusConfig) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    edge = overlap(config)
    begin, end = hour * HOUR - edge, (hour + 1) * HOUR + edge
    names = [str(path) for path in files]
    base.execute(f"CREATE TEMP VIEW messages AS SELECT * FROM read_parquet({names!r}) WHERE t >= {begin} AND t < {end}")
    shared = _bins(base)
    _candidates(base, config)
    found: list[dict[str, Any]] = []
    for component in _components(base, config):
        found += [meeting for meeting in component if hour * HOUR <= meeting["start"] < (hour + 1) * HOUR]
    found.sort(key=lambda one: (one["start"], one["a"], one["b"]))
    numbers = dict.fromkeys(("gap", "distance", "travel", "lat", "lon"), pa.float64())
    kinds = {**dict.fromkeys(("a", "b", "start", "end"), pa.int64()), **numbers, "kind": pa.string()}
    schema = pa.schema(list(kinds.items()))
    table = pa.Table.from_pylist(found, schema=schema).replace_schema_metadata({"shared": json.dumps(shared)})
    base.register("found", table)
    source = "messages" if not shared else "told_apart"
    with arriving(target.with_suffix(".rows.parquet")) as part:
        base.execute(
            'COPY (WITH span AS (SELECT device, min(start) AS low, max(finish) AS high FROM (SELECT a AS device, start, "end" AS '
            'finish FROM found UNION ALL SELECT b, start, "end" FROM found) GROUP BY device, start // 60000000) '
            f"SELECT DISTINCT m.* FROM {source} m JOIN span ON m.device = span.device AND m.t >= span.low - 3000000 AND "
            f"m.t <= span.high + 3000000 ORDER BY m.device, m.t, m.lat, m.lon, m.speed, m.heading) TO '{part}' "
            "(FORMAT parquet, COMPRESSION zstd)"
        )
    with arriving(target) as part:
        parquet.write_table(table, part, compression="zstd")


MEAN = f"""
    SELECT device, t // {BIN} AS bin, avg(t % {BIN}) AS late, avg(lat) AS lat, avg(lon) AS lon, avg(speed) AS speed,
           any_value(heading) AS heading, max(lat) - min(lat) AS high, max(lon) - min(lon) AS wide
    FROM {{source}} GROUP BY ALL"""


def _bins(base: Any) -> dict[str, int]:
    """Make the table `binned`; return which ids are shared, and by how many vehicles."""
    base.execute("CREATE TEMP TABLE means AS " + MEAN.format(source="messages"))
    ids = base.execute(
        f"SELECT device FROM means WHERE high > {SPREAD} OR wide > {1.5 * SPREAD} GROUP BY device HAVING count(*) >= {SHARED} "
        "ORDER BY device"
    ).fetchnumpy()["device"]
    shared: dict[str, int] = {}
    if len(ids):
        parts = []
        for device in ids.tolist():
            rows = base.sql(
                f"SELECT * FROM messages WHERE device = {device} ORDER BY t, lat, lon, speed, heading"
            ).to_arrow_table()
            who = tell_apart(*(rows.column(name).to_numpy() for name in ("t", "lat", "lon", "speed")))
            shared[str(device)] = int(who.max()) + 1
            parts.append(rows.set_column(0, "device", [device + who * ELSEWHERE]))
        import pyarrow as pa

        base.register("split", pa.concat_tables(parts))
        listed = f"({', '.join(map(str, ids.tolist()))})"
        base.execute(
            f"CREATE TEMP VIEW told_apart AS SELECT * FROM messages WHERE device NOT IN {listed} UNION ALL SELECT * FROM split"
        )
        base.execute(f"DELETE FROM means WHERE device IN {listed}")
        base.execute("INSERT INTO means " + MEAN.format(source="split"))
    side = 117.5
    row = f"floor(lat * {METRES} / {side})"
    base.execute(
        f"CREATE TEMP TABLE binned AS SELECT device, bin, lat + cos(radians(heading)) * rest / {METRES} AS lat, "
        f"lon + sin(radians(heading)) * rest / ({LONGITUDE} * cos(radians(lat))) AS lon FROM "
        f"(SELECT device, bin, lat, lon, heading, speed * ({BIN // 2} - late) * 1e-6 AS rest FROM means)"
    )
    base.execute("DROP TABLE means")
    column = f"{side} / ({LONGITUDE} * cos(radians(greatest(abs({{row}}), abs({{row}} + 1)) * {side} / {METRES})))"
    base.execute(
        f"CREATE TEMP TABLE cells AS SELECT device, bin, lat, lon, r, floor(lon / w)::BIGINT AS c, floor(lon / v)::BIGINT AS d "
        f"FROM (SELECT *, {column.format(row='r')} AS w, {column.format(row='(r + 1)')} AS v FROM "
        f"(SELECT *, {row}::BIGINT AS r FROM binned))"
    )
    return shared


def _candidates(base: Any, config: CorpusConfig) -> None:
    """Make the table `candidates`: pairs and the bins from which to which they are near, roughly."""
    reach = config.log.proximity + config.slack
    least = max(int(shortest(config.log) * config.log.period / 0.5) - 2, 1)
    key, above = f"r * {ROW} + c", f"(r + 1) * {ROW} + d"
    probes = f"[{key}, {key} + 1, {above} - 1, {above}, {above} + 1]"
    base.execute(
        f"CREATE TEMP TABLE near AS SELECT least(p.device, q.device) AS a, greatest(p.device, q.device) AS b, p.bin FROM "
        f"(SELECT device, bin, lat, lon, {key} AS own, unnest({probes}) AS key FROM cells) p "
        f"JOIN (SELECT device, bin, lat, lon, {key} AS key FROM cells) q ON p.bin = q.bin AND p.key = q.key "
        f"WHERE p.device <> q.device AND (p.key <> p.own OR p.device < q.device) AND "
        f"pow((p.lat - q.lat) * {METRES}, 2) + pow((p.lon - q.lon) * {LONGITUDE} * cos(radians(p.lat)), 2) < {reach * reach}"
    )
    base.execute(
        "CREATE TEMP TABLE candidates AS SELECT a, b, min(bin) AS first, max(bin) AS last FROM (SELECT *, sum(new) OVER "
        "(PARTITION BY a, b ORDER BY bin) AS part FROM (SELECT a, b, bin, "
        "(bin - lag(bin, 1, -99) OVER (PARTITION BY a, b ORDER BY bin) > 4)::INTEGER AS new FROM near)) "
        f"GROUP BY a, b, part HAVING count(*) >= {max(least // 2, 1)} ORDER BY a, b, first"
    )


def _components(base: Any, config: CorpusConfig) -> Iterator[list[dict[str, Any]]]:
    """Yield the meetings of each pair of candidates."""
    told = base.execute("SELECT count(*) FROM duckdb_views() WHERE view_name = 'told_apart'").fetchone()[0]
    pairs = base.execute("FROM candidates").fetchnumpy()
    if not len(pairs["a"]):
        return
    rows = base.execute(
        "WITH wanted AS (SELECT DISTINCT device, unnest(range(first // 20 - 1, last // 20 + 2)) AS span FROM "
        "(SELECT a AS device, first, last FROM candidates UNION ALL SELECT b, first, last FROM candidates)) "
        f"SELECT m.* FROM {'told_apart' if told else 'messages'} m SEMI JOIN wanted ON m.device = wanted.device AND "
        f"m.t // {20 * BIN} = wanted.span ORDER BY m.device, m.t, m.lat, m.lon, m.speed, m.heading"
    ).fetchnumpy()
    device = rows["device"]
    edges = np.flatnonzero(np.diff(device)) + 1
    slices = dict(
        zip(device[[0, *edges]].tolist(), zip([0, *edges.tolist()], [*edges.tolist(), len(device)], strict=True), strict=True)
    )
    tracks: dict[int, Track] = {}
    for a, b, first, last in zip(*(pairs[name].tolist() for name in ("a", "b", "first", "last")), strict=True):
        for who in (a, b):
            if who not in tracks:
                own = slice(*slices[who])
                tracks[who] = Track.of(who, *(rows[name][own] for name in ("t", "lat", "lon", "speed", "heading")))
        yield meetings(tracks[a], tracks[b], (first * BIN - 2 * BIN, (last + 3) * BIN), config)


@dataclass(frozen=True, eq=False)
class Track:
    """A vehicle's messages (M,) in order of time, one for each stamp: t [µs since 2004], degrees, m/s, rad from east."""

    device: int
    t: Ints
    lat: Floats
    lon: Floats
    speed: Floats
    heading: Floats

    @classmethod
    def of(cls, device: int, t: Ints, lat: Floats, lon: Floats, speed: Floats, heading: Floats) -> "Track":
        """Take messages in order of time; what is repeated or far from the messages about it is left out.

        Args:
            device: its number.
            t: (M,) µs since 2004.
            lat: (M,) degrees.
            lon: (M,) degrees.
            speed: (M,) m/s.
            heading: (M,) degrees clockwise from north.
        """
        new = np.concatenate([[True], np.diff(t) > 0])
        t, lat, lon = np.asarray(t[new]), np.asarray(lat[new]), np.asarray(lon[new])
        good = np.ones(len(t), dtype=bool)
        if len(t) > 2 * MEDIAN:
            for values, metres in ((lat, METRES), (lon, LONGITUDE * exact.cos(float(np.median(lat)) * np.pi / 180.0))):
                windowed = np.lib.stride_tricks.sliding_window_view(np.pad(values, MEDIAN, mode="edge"), 2 * MEDIAN + 1)
                good &= np.abs(values - np.median(windowed, axis=1)) * metres < OUTLIER + 2.0 * FASTEST * _reach(t)
        facing = (np.pi / 2.0 - np.asarray(heading[new], dtype=np.float64) * (np.pi / 180.0))[good]
        return cls(device, t[good], lat[good], lon[good], np.asarray(speed[new], dtype=np.float64)[good], facing)


def _reach(t: Ints) -> Floats:
    """(M,) seconds from the message before last to the one after next, at the ends as far as there are any."""
    padded = np.pad(t, MEDIAN, mode="edge")
    seconds: Floats = np.minimum((padded[2 * MEDIAN :] - padded[: -2 * MEDIAN]) * 1e-6, 2.0)
    return seconds


def meetings(a: Track, b: Track, span: tuple[int, int], config: CorpusConfig) -> list[dict[str, Any]]:
    """Return the meetings of two vehicles within a span of time [µs since 2004], each as a row of the table.

    Both near each other for long enough, one of them moves, and they have to do with each other.
    """
    period = round(config.log.period * 1e6)
    first, last = -(-max(span[0], int(a.t[0]), int(b.t[0])) // period), min(span[1], int(a.t[-1]), int(b.t[-1])) // period + 1
    if last - first < shortest(config.log):
        return []
    at = np.arange(first, last) * period
    inside = (a.t >= at[0]) & (a.t <= at[-1])
    origin = (float(a.lat[inside].mean()), float(a.lon[inside].mean())) if inside.any() else (float(a.lat[0]), float(a.lon[0]))
    one, other = (_at(track, at, origin, config) for track in (a, b))
    apart = exact.hypot(*(one[0].position - other[0].position).T)
    near = one[1] & other[1] & (apart < config.log.proximity)
    found = []
    for low, high in runs(near, ticks(APART, config.log)):
        for begin, end in _windows(first + low, first + high, config):
            if end - begin < shortest(config.log):
                continue
            there = np.flatnonzero(one[1][begin - first : end - first] & other[1][begin - first : end - first]) + begin - first
            p, q = (Motion(m.position[there], m.heading[there], m.speed[there]) for m, _ in (one, other))
            travel = max(float(m.speed.sum()) for m in (p, q)) * config.log.period
            if travel < config.log.travel:
                continue
            gap, _, _ = space_time_gap(p, q, config.log.period)
            if gap > config.interaction:
                continue
            found.append({
                "a": a.device, "b": b.device, "start": begin * period, "end": (end - 1) * period, "gap": gap,
                "distance": float(apart[there].min()), "travel": travel, "lat": origin[0], "lon": origin[1],
                "kind": kind_of(p, q, config.log.period),
            })  # fmt: skip
    return found


def _windows(first: int, last: int, config: CorpusConfig) -> list[tuple[int, int]]:
    """Cut as `logs.groups.windows` does, at whole multiples of `max_duration`, of ticks that count from 2004."""
    longest = ticks(config.log.max_duration, config.log)
    base = max(first // longest - 1, 0) * longest
    return [(begin + base, end + base) for begin, end in windows(first - base, last - base, config.log)]


def _at(track: Track, at: Ints, origin: tuple[float, float], config: CorpusConfig) -> tuple[Motion, Bools]:
    """A vehicle's motion at stamps (T,) [µs], and whether it is there: between messages no further apart than gaps may be."""
    low, high = np.searchsorted(track.t, [at[0], at[-1]])
    own = slice(max(int(low) - 1, 0), int(high) + 1)
    t = track.t[own]
    place = local_frame(track.lat[own], track.lon[own], origin)
    seconds, when = (t - at[0]) * 1e-6, (at - at[0]) * 1e-6
    position = np.stack([np.interp(when, seconds, place[:, 0]), np.interp(when, seconds, place[:, 1])], axis=1)
    after = np.clip(np.searchsorted(t, at), 1, len(t) - 1)
    there: Bools = (at >= t[0]) & (at <= t[-1]) & (t[after] - t[after - 1] <= config.log.longest_gap * 1e6 + 1.0)
    heading = np.interp(when, seconds, np.unwrap(track.heading[own]))
    return Motion(position, heading, np.interp(when, seconds, track.speed[own])), there


def tell_apart(t: Ints, lat: Floats, lon: Floats, speed: Floats) -> Ints:
    """Return (M,) which of the vehicles that share an id sent each message: 0, 1, …, in order of their first.

    A message belongs to the vehicle that could have driven there from its message before, the nearest such.
    """
    places: list[tuple[int, float, float, float]] = []
    who = np.zeros(len(t), dtype=np.int64)
    wide = exact.cos(float(lat.mean()) * np.pi / 180.0) * LONGITUDE
    for k, (stamp, north, east, fast) in enumerate(zip(t.tolist(), lat.tolist(), lon.tolist(), speed.tolist(), strict=True)):
        best, nearest = -1, np.inf
        for n, (before, y, x, v) in enumerate(places):
            seconds = (stamp - before) * 1e-6
            away = max(abs(north - y) * METRES, abs(east - x) * wide)
            if away < nearest and away < 20.0 + 1.5 * max(fast, v, 5.0) * seconds and seconds < 600.0:
                best, nearest = n, away
        if best < 0:
            best = len(places)
            places.append((0, 0.0, 0.0, 0.0))
        places[best] = (stamp, north, east, fast)
        who[k] = best
    return who

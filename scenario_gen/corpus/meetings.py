# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""An hour of messages -> which vehicles meet: candidates by a join of half-second bins, then every 0.1 s of those.

Vehicles are not sampled at the same instants, so nothing is joined by exact time. All messages of a vehicle in a half second give
one row, driven on to the middle of it with its speed and heading. Rows of the same half second meet in cells as wide as the
proximity and what a vehicle drives in between: each looks into its own cell and into half of those around it. The database only
proposes: what decides is computed from the messages.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from scenario_gen.base.stores import fetched, Place, workplace
from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.messages import database, DEGREE, GROUP, HOUR_US, quoted, write_messages
from scenario_gen.corpus.tasks import arriving
from scenario_gen.corpus.tracks import (
    FASTEST_MPS,
    LONGITUDE,
    meetings,
    METRES,
    NORTH,
    runs_of,
    tell_apart,
    tracks_of,
)
from scenario_gen.logs import GAP_RATE_MPS, OUT_OF_RANGE_S, shortest
from scenario_gen.numerics import Bools, Floats, Ints
from scenario_gen.numerics.kernels import F, F1, I, I1, kernel, named

BIN = 500_000  # µs
SPREAD = 0.0006  # degrees, 65 m or so, between two messages of one vehicle in one bin: further, and there are two of them
ASKEW = 0.37  # of the longitude, added to the latitude, so that one number tells two places apart
ROW = 1 << 24  # cells in a row around the globe, at the most
SHARED = 3  # such bins make an id one that may be shared
TOGETHER = 10  # bins in which two vehicles send: fewer, and it is one whose fixes jump
MORE = 1.4  # times the messages of one vehicle in a bin: so many are sent by two
ELSEWHERE = 1 << 40  # added to a shared id for each further vehicle that bears it
MARGIN = 3_000_000  # µs of messages that are kept before and after a meeting


@dataclass(frozen=True)
class HourTask:
    """Hours to search: (hour since 2004, the files that hold it or a neighbour), and where `meetings` are written."""

    name: str
    hours: tuple[tuple[int, tuple[Place, ...]], ...]
    folder: Place
    config: CorpusConfig


def overlap(config: CorpusConfig) -> int:
    """Microseconds before and after an hour that its task sees: an encounter at its longest, with what windows may add."""
    return round(
        1e6
        * (
            config.log.max_duration
            + config.log.min_duration
            + OUT_OF_RANGE_S
            + config.log.longest_gap
            + 1.0
        )
    )


def search_hours(task: HourTask) -> None:
    """Write the meetings of each hour and the messages of those who meet; hours whose table is there are done.

    Raises:
        InputError: the database fails.
    """
    left = [one for one in task.hours if not (task.folder / f"hour-{one[0]}.parquet").exists()]
    if not left:
        return
    own = task.folder.parent
    tables = sorted({path for _, files in left for path in files}, key=str)
    with (
        fetched(tables) as here,
        database(workplace(own), task.config.memory, f"{task.name} of {own}") as base,
    ):
        local = dict(zip(tables, here, strict=True))
        for hour, files in left:
            with base.cursor() as cursor:  # its tables end with it
                _search(
                    cursor,
                    hour,
                    [local[path] for path in files],
                    task.folder / f"hour-{hour}.parquet",
                    task.config,
                )


def _search(
    base: Any, hour: int, files: Sequence[Path], target: Place, config: CorpusConfig
) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    edge = overlap(config)
    begin, end = hour * HOUR_US - edge, (hour + 1) * HOUR_US + edge
    names = [str(path) for path in files]
    base.execute(
        f"CREATE TEMP TABLE messages AS SELECT device, t, lat / {DEGREE} AS lat, lon / {DEGREE} AS lon, speed, heading FROM "
        f"read_parquet([{quoted(names)}]) WHERE t >= {begin} AND t < {end} AND cause = 0"
    )
    shared = _bins(base)
    pairs = _candidates(base, config)
    rows = _messages(base, "told_apart" if shared else "messages")
    tracks = tracks_of(rows)
    found = [
        meeting
        for a, b, first, last in zip(
            *(pairs[name].tolist() for name in ("a", "b", "first", "last")), strict=True
        )
        if a in tracks and b in tracks
        for meeting in meetings(
            tracks[a], tracks[b], ((first - 2) * BIN, (last + 3) * BIN), config
        )
        if hour * HOUR_US <= meeting["start"] < (hour + 1) * HOUR_US
    ]
    found.sort(key=lambda one: (one["start"], one["a"], one["b"]))
    numbers = dict.fromkeys(("gap", "distance", "travel", "lat", "lon"), pa.float64())
    kinds = {**dict.fromkeys(("a", "b", "start", "end"), pa.int64()), **numbers}
    table = pa.Table.from_pylist(found, schema=pa.schema(list(kinds.items())))
    wanted = _excerpt(rows, found)
    excerpt = {name: values[wanted] for name, values in rows.items()}
    excerpt |= {
        name: np.rint(excerpt[name] * DEGREE).astype(np.int32) for name in ("lat", "lon")
    }  # exactly what was read
    with arriving(target.with_suffix(".rows.parquet")) as part:
        write_messages(pa.table(excerpt).to_reader(GROUP), part)
    with arriving(target) as part:
        parquet.write_table(
            table.replace_schema_metadata({"shared": json.dumps(shared)}), part, compression="zstd"
        )


def _messages(base: Any, source: str) -> dict[str, Any]:
    """Return the messages (M,) of all candidates by column, in order of vehicle and time, one for each stamp."""
    rows = base.execute(
        f"SELECT * FROM {source} WHERE device IN (SELECT a FROM candidates UNION SELECT b FROM candidates)"
    ).fetchnumpy()
    order = in_order(rows)
    device, t = rows["device"][order], rows["t"][order]
    order = order[
        np.concatenate(
            [np.ones(min(len(t), 1), dtype=bool), (np.diff(t) != 0) | (np.diff(device) != 0)]
        )
    ]
    return {name: np.asarray(values[order]) for name, values in rows.items()}


def in_order(rows: dict[str, Any]) -> Ints:
    """(M,) the order of messages by vehicle and time; of those of one stamp by the rest, whatever order they were read in."""
    order = np.lexsort((rows["t"], rows["device"]))
    device, t = rows["device"][order], rows["t"][order]
    same = np.zeros(len(t) + 1, dtype=bool)
    same[1:-1] = (np.diff(t) == 0) & (np.diff(device) == 0)
    tied = np.flatnonzero(same[1:] | same[:-1])
    own = order[tied]
    order[tied] = own[
        np.lexsort([rows[name][own] for name in ("heading", "speed", "lon", "lat", "t", "device")])
    ]
    return order


def _excerpt(rows: dict[str, Any], found: list[dict[str, Any]]) -> Bools:
    """(M,) which messages are of those who meet, from 3 s before to 3 s after."""
    wanted = np.zeros(len(rows["t"]), dtype=bool)
    own = {int(rows["device"][first]): (first, last) for first, last in runs_of(rows["device"])}
    for one in found:
        for device in (one["a"], one["b"]):
            first, last = own[device]
            low, high = np.searchsorted(
                rows["t"][first:last], [one["start"] - MARGIN, one["end"] + MARGIN + 1]
            )
            wanted[first + low : first + high] = True
    return wanted


MEAN = f"""
    SELECT device, t // {BIN} AS bin, avg(t % {BIN}) AS late, avg(lat) AS lat, avg(lon) AS lon, any_value(speed) AS speed,
           any_value(heading) AS heading, max(lat + {ASKEW} * lon) - min(lat + {ASKEW} * lon) AS spread
    FROM {{source}} GROUP BY ALL"""


def _bins(base: Any) -> dict[str, int]:
    """Make the table `binned`; return which ids are shared, and by how many vehicles."""
    base.execute("CREATE TEMP TABLE means AS " + MEAN.format(source="messages"))
    ids = base.execute(
        f"SELECT device FROM means WHERE spread > {SPREAD} GROUP BY device HAVING count(*) >= {SHARED} ORDER BY device"
    ).fetchnumpy()["device"]
    shared: dict[str, int] = {}
    if len(ids):
        import pyarrow as pa

        who_shares = f"({', '.join(map(str, ids.tolist()))})"
        rows = base.sql(
            f"SELECT * FROM messages WHERE device IN {who_shares} ORDER BY device, t, lat, lon, speed, heading"
        ).to_arrow_table()
        device, *columns = (
            rows.column(name).to_numpy() for name in ("device", "t", "lat", "lon", "speed")
        )
        who = np.zeros(len(device), dtype=np.int64)
        for first, last in runs_of(device):
            own = tell_apart(*(column[first:last] for column in columns))
            if _together(columns[0][first:last], own) < TOGETHER:
                continue  # one vehicle whose fixes jump
            who[first:last] = own
            shared[str(device[first])] = int(own.max()) + 1
        base.register("split", rows.set_column(0, "device", pa.array(device + who * ELSEWHERE)))
        base.execute(
            f"CREATE TEMP VIEW told_apart AS SELECT * FROM messages WHERE device NOT IN {who_shares} "
            "UNION ALL SELECT * FROM split"
        )
        base.execute(f"DELETE FROM means WHERE device IN {who_shares}")
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


def _together(t: Ints, who: Ints) -> int:
    """Return in how many bins more than one of the vehicles of an id sends, and together more than one does; t (M,) µs, who (M,).

    Fixes of one vehicle that jump do not add messages.
    """
    sent = np.unique(np.stack([t, who]), axis=1)  # heard twice, it counts once
    messages = np.unique(sent[0] // BIN, return_counts=True)[1]
    senders = np.unique(
        np.unique(np.stack([sent[0] // BIN, sent[1]]), axis=1)[0], return_counts=True
    )[1]
    alone = messages[senders == 1]
    usual = float(np.quantile(alone, 0.9) if len(alone) >= TOGETHER else np.median(messages) / 2.0)
    return int(((senders > 1) & (messages >= MORE * usual)).sum())


def _candidates(base: Any, config: CorpusConfig) -> dict[str, Ints]:
    """Make the table `candidates`: pairs a, b and the bins first, last from which to which they are near, roughly; return it."""
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
    found: dict[str, Ints] = base.execute("FROM candidates").fetchnumpy()
    kept = _near_in_time(base, found, config)
    found = {name: np.asarray(values[kept]) for name, values in found.items()}
    import pyarrow as pa

    base.register("remaining", pa.table(found))
    base.execute("CREATE OR REPLACE TEMP TABLE candidates AS FROM remaining")
    return found


def _near_in_time(base: Any, pairs: dict[str, Ints], config: CorpusConfig) -> Bools:
    """(C,) which candidates may have to do with each other: somewhere they come near within the seconds that count.

    With bins a half second apart places are missed by what is driven in a quarter of a second, and by the slack of a bin.
    """
    rows = base.execute(
        "SELECT device, bin, lat, lon FROM binned WHERE device IN (SELECT a FROM candidates UNION SELECT b FROM candidates) "
        "ORDER BY device, bin"
    ).fetchnumpy()
    own = {
        int(rows["device"][first]): slice(first, last) for first, last in runs_of(rows["device"])
    }
    steps = int(config.interaction / GAP_RATE_MPS / (BIN * 1e-6)) + 1
    reach = config.interaction + config.slack + FASTEST_MPS * BIN * 0.25e-6
    north = rows["lat"] * NORTH
    kept = np.zeros(len(pairs["a"]), dtype=bool)
    for k, (a, b, first, last) in enumerate(
        zip(*(pairs[name].tolist() for name in ("a", "b", "first", "last")), strict=True)
    ):
        wide = LONGITUDE * np.cos(float(rows["lat"][own[a]][0]) * np.pi / 180.0)
        one, other = (
            _Sent(rows["bin"][own[n]], north[own[n]], rows["lon"][own[n]]) for n in (a, b)
        )
        kept[k] = _least_apart(one, other, wide, first, last, steps) <= reach * reach
    return kept


class _Sent(NamedTuple):
    """Where a vehicle is in bins (M,) in which it sends: how far north [m] and at which longitude [degrees]."""

    bins: Ints
    north: Floats
    lon: Floats


_SENT = named(_Sent, I1, F1, F1)


@kernel(_SENT, _SENT, F, I, I, I)
def _least_apart(
    one: _Sent, other: _Sent, wide: float, first: int, last: int, steps: int
) -> float:
    """Square of how near [m²] one, in bins from first to last, comes to the other, at most `steps` bins away.

    `wide` is the length of a degree of longitude [m].
    """
    bins, others = one.bins, other.bins
    least = np.inf
    begin = 0
    for m in range(len(bins)):
        if bins[m] < first or bins[m] > last:
            continue
        while begin < len(others) and others[begin] < bins[m] - steps:
            begin += 1
        n = begin
        while n < len(others) and others[n] <= bins[m] + steps:
            up, right = one.north[m] - other.north[n], (one.lon[m] - other.lon[n]) * wide
            least = min(least, up * up + right * right)
            n += 1
    return least

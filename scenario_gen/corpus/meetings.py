# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""From an hour of messages to meetings of two vehicles.

Vehicles are not sampled at the same instants, so nothing is joined by exact time. All messages
of a vehicle within a bin (half a second) give one row, moved to the middle of the bin with speed
and heading. The rows of a bin are joined in cells as wide as the proximity plus the distance
driven within a bin: each row is compared with its cell and with half of the neighbouring cells.
The database only proposes candidates; the decision is computed from the messages, every 0.1 s.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import json
from pathlib import Path
from typing import Any

import numpy as np

from scenario_gen.corpus.config import CorpusConfig
from scenario_gen.corpus.grouping import SHARED_ID_STEP_COUNT
from scenario_gen.corpus.messages import (
    database,
    GROUP_ROWS,
    HOUR_US,
    tables,
    UNITS_PER_DEGREE,
    write_messages,
)
from scenario_gen.corpus.tasks import arriving
from scenario_gen.corpus.tracks import (
    LATITUDE_M,
    LONGITUDE_M,
    meetings,
    MICROSECOND_S,
    runs_of,
    separate_senders,
    Track,
    tracks_of,
)
from scenario_gen.logs import OUT_OF_RANGE_S, shortest
from scenario_gen.logs.groups import AROUND_CROSSING_S, LONGEST_EXTENSION_S
from scenario_gen.numerics import Bools, Ints

BIN_US = 500_000
BIN_S = BIN_US * MICROSECOND_S
CELL_M = 117.5  # side of a cell: proximity and slack, and the distance driven within a bin
SPREAD_DEG = 0.0006  # about 65 m; messages of one bin with more are from two vehicles
LONGITUDE_FACTOR = 0.37  # one number, latitude + 0.37 longitude, distinguishes two places
CELLS_PER_ROW_COUNT = 1 << 24  # at most, around the globe
MIN_SPREAD_COUNT = 3  # bins with too large a spread, from which on an id may be shared
MIN_COMMON_COUNT = 10  # bins in which several vehicles send; fewer are fixes that jump
SENDERS_RATIO = 1.4  # of the messages of one vehicle in a bin, from which on two are sending
_SMOOTHING_S = 2.0  # messages before and after an encounter, for smoothing its ends
MESSAGES_BEFORE_US = round(1e6 * (AROUND_CROSSING_S + _SMOOTHING_S))
MESSAGES_AFTER_US = round(1e6 * (LONGEST_EXTENSION_S + AROUND_CROSSING_S + _SMOOTHING_S))
MEETINGS, ROWS = "meetings.parquet", "rows.parquet"
MAX_GAP_COUNT = 4  # bins without candidates, between which a meeting is one

Columns = Mapping[str, Any]  # arrays (M,) by column


@dataclass(frozen=True)
class HourTask:
    """An hour to search.

    Attributes:
        hour: since 2004.
        tables: the messages of this hour and its neighbours.
        target: the folder to write, with the tables `MEETINGS` and `ROWS`.
        config: the parameters.
    """

    hour: int
    tables: tuple[Path, ...]
    target: Path
    config: CorpusConfig

    @property
    def name(self) -> str:
        """The task in messages."""
        return f"hour {self.target.name}"


def overlap(config: CorpusConfig) -> int:
    """Return the microseconds before and after an hour that its task reads.

    It is the longest encounter, with the time that windows may add.
    """
    log = config.log
    seconds = log.max_duration + log.min_duration + OUT_OF_RANGE_S + log.longest_gap + 1.0
    return round(seconds / MICROSECOND_S) + MESSAGES_AFTER_US


def search_hour(task: HourTask) -> None:
    """Write the meetings of an hour, and their messages.

    Raises:
        InputError: the database fails.
    """
    corpus = task.target.parent.parent
    with database(corpus, task.config.memory, f"{task.name} of {corpus}") as base:
        _search(base, task)


def _search(base: Any, task: HourTask) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    config = task.config
    edge = overlap(config)
    begin, end = task.hour * HOUR_US - edge, (task.hour + 1) * HOUR_US + edge
    base.execute(f"""
        CREATE TEMP TABLE messages AS
        SELECT device, t, lat / {UNITS_PER_DEGREE} AS lat, lon / {UNITS_PER_DEGREE} AS lon,
               speed, heading
        FROM {tables(task.tables)}
        WHERE t >= {begin} AND t < {end} AND cause = 0""")
    shared = _fill_bins(base)
    pairs = _candidates(base, config)
    rows = _messages(base, "separated" if shared else "messages")
    in_hour = _meetings_in_hour(pairs, tracks_of(rows), task.hour, config)
    schema = [
        *((name, pa.int64()) for name in ("a", "b", "start", "end")),
        *((name, pa.float64()) for name in ("gap", "distance", "travel", "lat", "lon")),
    ]
    table = pa.Table.from_pylist(in_hour, schema=pa.schema(schema))
    wanted = _excerpt(rows, in_hour)
    excerpt = {name: values[wanted] for name, values in rows.items()}
    for name in ("lat", "lon"):  # exactly the recorded numbers
        excerpt[name] = np.rint(excerpt[name] * UNITS_PER_DEGREE).astype(np.int32)
    with arriving(task.target) as folder:
        folder.mkdir()
        write_messages(pa.table(excerpt).to_reader(GROUP_ROWS), folder / ROWS)
        described = table.replace_schema_metadata({"shared": json.dumps(shared)})
        parquet.write_table(described, folder / MEETINGS, compression="zstd")


def _meetings_in_hour(
    pairs: Columns, tracks: Mapping[int, Track], hour: int, config: CorpusConfig
) -> list[dict[str, Any]]:
    """Return the meetings of candidate pairs that begin in an hour, in order of time."""
    columns = (pairs[name].tolist() for name in ("a", "b", "first", "last"))
    candidates = []
    for a, b, first, last in zip(*columns, strict=True):
        if a in tracks and b in tracks:
            span = ((first - 2) * BIN_US, (last + 3) * BIN_US)
            candidates += meetings(tracks[a], tracks[b], span, config)
    begin, end = hour * HOUR_US, (hour + 1) * HOUR_US
    in_hour = [meeting for meeting in candidates if begin <= meeting["start"] < end]
    return sorted(in_hour, key=lambda meeting: (meeting["start"], meeting["a"], meeting["b"]))


def _messages(base: Any, source: str) -> Columns:
    """Return the messages (M,) of all candidates, by vehicle and time, one for each stamp.

    The other columns order messages with the same stamp, independently of the order of reading.
    """
    rows = base.execute(f"""
        SELECT * FROM {source}
        WHERE device IN (SELECT a FROM candidates UNION SELECT b FROM candidates)
        ORDER BY device, t, lat, lon, speed, heading""").fetchnumpy()
    is_first = np.ones(len(rows["t"]), dtype=bool)
    is_first[1:] = (np.diff(rows["t"]) != 0) | (np.diff(rows["device"]) != 0)
    return {name: np.asarray(values[is_first]) for name, values in rows.items()}


def _excerpt(rows: Columns, meetings_in_hour: Sequence[Mapping[str, Any]]) -> Bools:
    """(M,) which messages belong to a meeting, or to manoeuvres that begin in it."""
    wanted = np.zeros(len(rows["t"]), dtype=bool)
    spans = {int(rows["device"][first]): (first, last) for first, last in runs_of(rows["device"])}
    for meeting in meetings_in_hour:
        window = [meeting["start"] - MESSAGES_BEFORE_US, meeting["end"] + MESSAGES_AFTER_US + 1]
        for device in (meeting["a"], meeting["b"]):
            first, last = spans[device]
            low, high = np.searchsorted(rows["t"][first:last], window)
            wanted[first + low : first + high] = True
    return wanted


def _means_of(source: str) -> str:
    """Return the query for one row per vehicle and bin."""
    place = f"(lat + {LONGITUDE_FACTOR} * lon)"
    return f"""
        SELECT device, t // {BIN_US} AS bin, avg(t % {BIN_US}) AS late,
               avg(lat) AS lat, avg(lon) AS lon,
               any_value(speed) AS speed, any_value(heading) AS heading,
               max({place}) - min({place}) AS spread
        FROM {source} GROUP BY ALL"""


def _fill_bins(base: Any) -> dict[str, int]:
    """Create the tables `binned` and `cells`; return {shared id: number of its vehicles}."""
    base.execute(f"CREATE TEMP TABLE means AS {_means_of('messages')}")
    ids = base.execute(f"""
        SELECT device FROM means WHERE spread > {SPREAD_DEG}
        GROUP BY device HAVING count(*) >= {MIN_SPREAD_COUNT} ORDER BY device""").fetchnumpy()
    shared = _separate_shared(base, ids["device"]) if len(ids["device"]) else {}

    row = f"floor(lat * {LATITUDE_M} / {CELL_M})"
    base.execute(f"""
        CREATE TEMP TABLE binned AS
        SELECT device, bin, lat + cos(radians(heading)) * rest / {LATITUDE_M} AS lat,
               lon + sin(radians(heading)) * rest / ({LONGITUDE_M} * cos(radians(lat))) AS lon
        FROM (SELECT device, bin, lat, lon, heading,
                     speed * ({BIN_US // 2} - late) * 1e-6 AS rest FROM means)""")
    base.execute("DROP TABLE means")

    def width(name: str) -> str:
        highest = f"greatest(abs({name}), abs({name} + 1)) * {CELL_M} / {LATITUDE_M}"
        return f"{CELL_M} / ({LONGITUDE_M} * cos(radians({highest})))"

    base.execute(f"""
        CREATE TEMP TABLE cells AS
        SELECT device, bin, lat, lon, r,
               floor(lon / w)::BIGINT AS c, floor(lon / v)::BIGINT AS d
        FROM (SELECT *, {width("r")} AS w, {width("(r + 1)")} AS v
              FROM (SELECT *, {row}::BIGINT AS r FROM binned))""")
    return shared


def _separate_shared(base: Any, ids: Ints) -> dict[str, int]:
    """Give vehicles that share an id different ids; return {id: number of its vehicles}."""
    import pyarrow as pa

    listed = f"({', '.join(map(str, ids.tolist()))})"
    rows = base.sql(f"""
        SELECT * FROM messages WHERE device IN {listed}
        ORDER BY device, t, lat, lon, speed, heading""").to_arrow_table()
    device, t, lat, lon, speed = (
        rows.column(name).to_numpy() for name in ("device", "t", "lat", "lon", "speed")
    )
    shared: dict[str, int] = {}
    sender = np.zeros(len(device), dtype=np.int64)
    for first, last in runs_of(device):
        span = slice(first, last)
        senders = separate_senders(t[span], lat[span], lon[span], speed[span])
        if _common_bins(t[span], senders) >= MIN_COMMON_COUNT:
            sender[span] = senders
            shared[str(device[first])] = int(senders.max()) + 1
    ids_of_senders = pa.array(device + sender * SHARED_ID_STEP_COUNT)
    base.register("split", rows.set_column(0, "device", ids_of_senders))
    base.execute(f"""
        CREATE TEMP VIEW separated AS
        SELECT * FROM messages WHERE device NOT IN {listed} UNION ALL SELECT * FROM split""")
    base.execute(f"DELETE FROM means WHERE device IN {listed}")
    base.execute(f"INSERT INTO means {_means_of('split')}")
    return shared


def _common_bins(t: Ints, sender: Ints) -> int:
    """Return the number of bins in which an id sends more messages than one vehicle does.

    Fixes of one vehicle that jump do not add messages. `t` (M,) is in µs, `sender` (M,) a number.
    """
    sent = np.unique(np.stack([t, sender]), axis=1)  # a message that is received twice counts once
    messages = np.unique(sent[0] // BIN_US, return_counts=True)[1]
    pairs = np.unique(np.stack([sent[0] // BIN_US, sent[1]]), axis=1)
    senders = np.unique(pairs[0], return_counts=True)[1]
    alone = messages[senders == 1]
    if len(alone) >= MIN_COMMON_COUNT:
        usual = float(np.quantile(alone, 0.9))
    else:
        usual = float(np.median(messages) / 2.0)
    return int(((senders > 1) & (messages >= SENDERS_RATIO * usual)).sum())


def _candidates(base: Any, config: CorpusConfig) -> dict[str, Ints]:
    """Create the table `candidates` and return it.

    Its rows are pairs a, b and the bins first, last in which they are roughly near each other.
    """
    reach = config.log.proximity + config.slack
    least = max(int(shortest(config.log) * config.log.period / BIN_S) - 2, 1)
    key, above = f"r * {CELLS_PER_ROW_COUNT} + c", f"(r + 1) * {CELLS_PER_ROW_COUNT} + d"
    probes = f"[{key}, {key} + 1, {above} - 1, {above}, {above} + 1]"
    north = f"(p.lat - q.lat) * {LATITUDE_M}"
    east = f"(p.lon - q.lon) * {LONGITUDE_M} * cos(radians(p.lat))"
    base.execute(f"""
        CREATE TEMP TABLE near AS
        SELECT least(p.device, q.device) AS a, greatest(p.device, q.device) AS b, p.bin
        FROM (SELECT device, bin, lat, lon, {key} AS home, unnest({probes}) AS key FROM cells) p
        JOIN (SELECT device, bin, lat, lon, {key} AS key FROM cells) q
          ON p.bin = q.bin AND p.key = q.key
        WHERE p.device <> q.device AND (p.key <> p.home OR p.device < q.device)
          AND pow({north}, 2) + pow({east}, 2) < {reach * reach}""")
    begins = f"(bin - lag(bin, 1, -99) OVER (PARTITION BY a, b ORDER BY bin) > {MAX_GAP_COUNT})"
    base.execute(f"""
        CREATE TEMP TABLE candidates AS
        SELECT a, b, min(bin) AS first, max(bin) AS last
        FROM (SELECT *, sum(new) OVER (PARTITION BY a, b ORDER BY bin) AS part
              FROM (SELECT a, b, bin, {begins}::INTEGER AS new FROM near))
        GROUP BY a, b, part HAVING count(*) >= {max(least // 2, 1)} ORDER BY a, b, first""")
    pairs: dict[str, Ints] = base.execute("FROM candidates").fetchnumpy()
    return pairs

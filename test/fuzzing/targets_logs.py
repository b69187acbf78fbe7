# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The readers of logs as targets: tables in text and Parquet, basic safety messages, bags in MCAP and SQLite."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
import json
from pathlib import Path
import struct
import tempfile

from fuzzing.harness import Target
from fuzzing.mutators import BYTES, TEXT, tree
import numpy as np
import pandas as pd
from rosbags.rosbag2 import Reader, StoragePlugin
from support.cut_bags import rosbags_bag
from support.log_builders import crossing

from msg_conventions.autoware import AutowareEncoder
from msg_conventions.ego import encode_state
from msg_conventions.tracks import encode_tracks
from msg_conventions.trajectory import TYPE as TRACKS
from scenario_gen.bags.storage.definitions import TRACKED
from scenario_gen.bags.vehicles import FIX, ODOMETRY, TWIST
from scenario_gen.logs import encounters_of, LogConfig, read_log, Streams
from scenario_gen.logs.bag import log_of, READABLE_TYPES, Topic
from scenario_gen.logs.synthetic import bundled
from scenario_gen.logs.text import SPMD_COLUMNS
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.scenario import Scenario

RECORD = "<BBqdd"  # vehicle, kind, stamp [ns], two values
SHORT = LogConfig(min_duration=1.0, travel=1.0)


def cars() -> pd.DataFrame:
    """Rows of two cars that meet: 6 s at 10 Hz, with headings."""
    rows = crossing(6.0).round(3)
    return rows.assign(heading_rad=np.where(rows["vehicle_id"] == "a", 0.0, 1.57))


def on_globe(rows: pd.DataFrame) -> pd.DataFrame:
    """The same rows with latitude and longitude, stamps in milliseconds since 1970, speeds in km/h and headings as courses."""
    return pd.DataFrame(
        {
            "time_ms": (1_700_000_000_000 + rows["t_s"] * 1000.0).round().astype(np.int64),
            "id": (rows["vehicle_id"] == "a") + 7,
            "latitude": (48.0 + rows["y_m"] / 111_320.0).round(8),
            "longitude": (11.0 + rows["x_m"] / 74_490.0).round(8),
            "speed_kmh": rows["speed_mps"] * 3.6,
            "course": 90.0 - np.degrees(rows["heading_rad"]),
        }
    )


def variants() -> list[pd.DataFrame]:
    """Tables with stamps of different kinds."""
    rows, timeless = cars(), cars().drop(columns="t_s")
    dates = pd.to_datetime(rows["t_s"], unit="s", utc=True)
    stamps = (rows["t_s"] * 1e9).round().astype("Int64")
    timed = (timeless.assign(timestamp=dates.astype(str)), timeless.assign(timestamp=dates))
    return [rows, on_globe(rows), *timed, timeless.assign(time_ns=stamps)]


def texts(_folder: Path) -> list[bytes]:
    """Tables in text with commas, semicolons and tabs."""
    tables = [rows.to_csv(index=False) for rows in variants()[:3]]
    tables += [cars().to_csv(index=False, sep=sep) for sep in ";\t"]
    return [table.encode() for table in tables]


def parquets(_folder: Path) -> list[bytes]:
    """Parquet tables, one of them with its stamps as pandas' index."""
    return [rows.to_parquet() for rows in (*variants(), cars().set_index("t_s"))]


def safety_messages(_folder: Path) -> list[bytes]:
    """Basic safety messages of two units."""
    rows = on_globe(cars())
    table = pd.DataFrame(0, index=rows.index, columns=list(SPMD_COLUMNS)).astype(object)
    table["TxDevice"], table["Gentime"] = (
        rows["id"],
        300_000_000_000_000 + (cars()["t_s"] * 1e6).round().astype(np.int64),
    )
    table["Latitude"], table["Longitude"] = rows["latitude"], rows["longitude"]
    table["Speed"], table["Heading"] = cars()["speed_mps"], rows["course"]
    return [table.to_csv(index=False, header=False).encode()]


def pilots(_folder: Path) -> list[bytes]:
    """Basic safety messages in JSON, of Wyoming and of an event of New York."""
    messages, event = [], []
    for row in cars().itertuples():
        core = {"id": row.vehicle_id, "secMark": round(row.t_s * 1000) % 60_000, "heading": 90.0}
        core["speed"] = row.speed_mps
        place = {"latitude": 48.0 + row.y_m * 1e-5, "longitude": 11.0 + row.x_m * 1e-5}
        metadata = {"recordGeneratedAt": f"{pd.Timestamp(row.t_s, unit='s')}"}
        data = {"coreData": core | {"position": place}}
        messages.append(json.dumps({"metadata": metadata, "payload": {"data": data}}))
        own = {"X_m": row.x_m, "Y_m": row.y_m, "T_s": row.t_s, "speed_mps": row.speed_mps}
        event.append({"bsmRecord": {"bsmMsg": {"coreData": core | own | {"heading_deg": 90.0}}}})
    return ["\n".join(messages).encode(), json.dumps({"bsmList": event}).encode()]


def simulated(_folder: Path) -> list[bytes]:
    """Floating-car data of SUMO."""
    rows = [
        f'<timestep time="{row.t_s}"><vehicle id="{row.vehicle_id}" x="{row.x_m}" y="{row.y_m}" angle="90" speed="8"/></timestep>'
        for row in cars().itertuples()
    ]
    return [f"<fcd-export>{''.join(rows)}</fcd-export>".encode()]


def bags(storage: StoragePlugin, folder: Path) -> list[bytes]:
    """Bags of one storage: streams of fixes and speeds, odometry of two vehicles, a message of tracks, tracked objects."""
    (folder / "log.csv").write_bytes(texts(folder)[0])
    (encounter,) = read_log(folder / "log.csv", SHORT).encounters
    with Reader(bundled("b")) as reader:
        until = reader.start_time + 7 * 10**9
        streams = [
            (c.topic, c.msgtype, stamp, bytes(data))
            for c, stamp, data in reader.messages(stop=until)
        ]
    tracks = [("/tracks", TRACKS, until, encode_tracks(encounter))]
    odometry = []
    states = np.dstack((encounter.position, encounter.heading, encounter.speed))
    for vehicle, track in zip(encounter.vehicles, states, strict=True):
        for k, state in enumerate(track):
            stamp = encounter.start_ns + k * encounter.dt_ns
            message = encode_state(state, "car", "map", stamp)
            odometry.append((f"/vehicle_{vehicle.id}/odom", ODOMETRY, stamp, message))
    perceived = [("/objects", TRACKED, stamp, data) for stamp, data in objects(encounter)]
    contents = {"s": streams, "t": tracks, "o": odometry, "p": perceived}
    return [
        file_of(rosbags_bag(folder / name, content, storage)) for name, content in contents.items()
    ]


def objects(encounter: Encounter) -> Iterator[tuple[int, bytes]]:
    """Yield stamp [ns] and CDR bytes of what Autoware's perception says of an encounter."""
    moved = Scenario(
        vehicles=encounter.vehicles,
        time=encounter.time,
        position=encounter.position,
        heading=encounter.heading,
        speed=encounter.speed,
        acceleration=np.zeros_like(encounter.speed),
        seed=0,
        index=0,
    )
    encoder = AutowareEncoder(moved)
    for k, after in enumerate(encoder.time_ns):
        stamp = encounter.start_ns + int(after)
        yield stamp, encoder.tracked_objects(k, stamp)


def file_of(bag: Path) -> bytes:
    """Return the one file of a bag."""
    (file,) = (file for file in bag.iterdir() if file.suffix in (".mcap", ".db3"))
    return file.read_bytes()


def read_as(name: str, config: LogConfig = SHORT) -> Callable[[bytes, Path], None]:
    """Return a target's `run` that reads the input as a log of this file name."""

    def run(data: bytes, folder: Path) -> None:
        (folder / name).write_bytes(data)
        read_log(folder / name, config)

    return run


@cache
def recorded() -> dict[str, list[tuple[str, int, bytes]]]:
    """Messages by type: (topic, stamp, CDR bytes)."""
    found: dict[str, list[tuple[str, int, bytes]]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for k, data in enumerate(bags(StoragePlugin.MCAP, Path(folder))):
            (Path(folder) / f"{k}.mcap").write_bytes(data)
            with Reader(Path(folder) / f"{k}.mcap") as reader:
                for connection, stamp, message in reader.messages():
                    found.setdefault(connection.msgtype, []).append(
                        (connection.topic, stamp, bytes(message))
                    )
    return found


def payloads(_folder: Path) -> list[bytes]:
    """A number of a type, and CDR bytes of that type."""
    return [
        bytes([k]) + message
        for k, kind in enumerate(READABLE_TYPES)
        for _, _, message in recorded().get(kind, [])[:3]
    ]


def decode(data: bytes, _folder: Path) -> None:
    """Read a log of sound messages, among which some are the input."""
    kind = READABLE_TYPES[data[0] % len(READABLE_TYPES)] if data else READABLE_TYPES[0]
    topics: dict[tuple[str, str], Topic] = {}
    unknown = [("/log", 10**9, b"")]  # a type of which there is no sound message here
    for used in (FIX, TWIST) if kind in (FIX, TWIST) else (kind,):
        for number, (name, stamp, message) in enumerate(recorded().get(used, unknown)):
            topic = topics.setdefault((used, name), Topic(name, used, "log.mcap"))
            topic.stamps.append(stamp)
            topic.data.append(data[1:] if used == kind and number % 7 == 0 else message)
    encounters_of(log_of(list(topics.values()), "log", SHORT), SHORT)


def put(data: bytes, _folder: Path) -> None:
    """Feed records (vehicle, kind, stamp, two values) to streams as they come, and read what they amount to."""
    streams = Streams(SHORT)
    whole = len(data) // struct.calcsize(RECORD) * struct.calcsize(RECORD)
    for vehicle, kind, stamp, a, b in struct.iter_unpack(RECORD, data[:whole]):
        streams.breaks(stamp)
        if kind % 2:
            streams.put_speed(str(vehicle % 5), stamp, a)
        else:
            streams.put_fix(str(vehicle % 5), stamp, a, b)
    log = streams.flush("live")
    if log is not None:
        encounters_of(log, streams.config)


def heard(_folder: Path) -> list[bytes]:
    """Records of two vehicles that drive for 4 s."""
    found = bytearray()
    for row in on_globe(cars()).head(80).itertuples():
        found += struct.pack(RECORD, row.id, 0, row.time_ms * 10**6, row.latitude, row.longitude)
        found += struct.pack(RECORD, row.id, 1, row.time_ms * 10**6, row.speed_kmh / 3.6, 0.0)
    return [bytes(found)]


MCAP_BAGS, SQLITE_BAGS = partial(bags, StoragePlugin.MCAP), partial(bags, StoragePlugin.SQLITE3)
TARGETS = (
    Target("table", texts, read_as("log.csv"), TEXT, ("table/*.csv", "table_*.csv"), "log.csv"),
    Target(
        "spmd", safety_messages, read_as("log.csv"), TEXT, ("spmd/*.csv", "spmd_*.csv"), "log.csv"
    ),
    Target("bsm", pilots, read_as("log.json", replace(SHORT, format="bsm")), TEXT),
    Target(
        "fcd", simulated, read_as("log.xml", replace(SHORT, format="fcd")), (*TEXT, *[tree] * 3)
    ),
    Target(
        "parquet",
        parquets,
        read_as("log.parquet"),
        BYTES,
        ("parquet/*", "*.parquet"),
        "log.parquet",
    ),
    Target(
        "mcap_log", MCAP_BAGS, read_as("log.mcap"), BYTES, ("mcap_reader/*", "*.mcap"), "log.mcap"
    ),
    Target("sqlite_log", SQLITE_BAGS, read_as("log.db3"), BYTES, ("sqlite/*",), "log.db3"),
    Target("payloads", payloads, decode, BYTES, named="log"),
    Target("streams", heard, put, BYTES),
)

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Write an invented archive in the format of the Safety Pilot, whose encounters are known: `mine` has something to find.

    python examples/synthetic_archive.py FOLDER [--seed SEED] [--rows N] [--hours H] [--encounters N] ...

`FOLDER/synthetic.json` tells which vehicles meet, and how. It needs `pip install 'scenario_gen[corpus]'`.

Vehicles drive along straights and arcs in closed form, so that a whole archive is a few operations on arrays. Each encounter has
a tile of its own. Half of those to be found lie just inside one threshold of the miner; further ones lie just outside one. All
other rows are vehicles that meet nobody: some drive on streets 60 m apart, which a search by distance alone would report. Clocks
are asynchronous, rows are lost, repeated, stamped wrongly and damaged, ids repeat.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from datetime import date
import json
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv
import pyproj

from scenario_gen.numerics import Floats, Ints

TRUTH = "synthetic.json"
KINDS = ("crossing", "oncoming", "following", "merging", "left_turn")
THRESHOLDS = ("proximity", "duration", "presence", "travel", "beside", "late")
"""Of the miner, at each of which encounters are planted inside and outside: the distance, how long the pass takes, how long both
are recorded, how far one drives, how far beside each other they pass, how long after each other."""
FIRST_DAY = 3000  # days after 2004-01-01: April 2012
DAY0 = date(1899, 12, 30)  # from which the names of the files count
PLACE = (42.28, -83.74)  # degrees, around which all lies
TILE, STREET, BLOCK, COLUMN = (
    2000.0,
    300.0,
    60.0,
    30_000.0,
)  # m: an encounter's own ground; between lone drives, wide and narrow
ROWS_PER_FILE = 1_000_000
STRAIGHT = dict.fromkeys(("x", "y", "at", "turn", "dip", "dip_at"), 0.0)
STRAIGHT |= {"radius": 1.0, "dip_width": 4.0}
"""What a drive is unless it says otherwise."""


@dataclass(frozen=True)
class ArchiveConfig:
    """What a synthetic archive holds: shares are of rows, `repeated_ids` is of encounters, `noise` in metres of a drive."""

    rows: int = 100_000
    hours: float = 1.0
    encounters: int = 30
    outside: int = 12
    loss: float = 0.03
    duplicates: float = 0.18
    wrong_times: float = 0.001
    damaged: float = 0.0001
    repeated_ids: float = 0.02
    noise: float = 0.3


@dataclass(frozen=True, eq=False)
class Drives:
    """Drives in closed form; each array is (V,).

    A vehicle is at (x, y) at time `at` [s], where its arc of radius `radius` [m] over `turn` [rad] begins; before, it drives
    straight with `heading` [rad]. It drives at `speed` [m/s], but for a dip by the share `dip` about the time `dip_at`,
    `dip_width` [s] wide. It is recorded from `begin` for `lasts` [s]. All times count from the archive's begin, places from
    (`east`, `north`) [m].
    """

    device: Ints
    x: Floats
    y: Floats
    heading: Floats
    radius: Floats
    turn: Floats
    speed: Floats
    at: Floats
    begin: Floats
    lasts: Floats
    dip: Floats
    dip_at: Floats
    dip_width: Floats
    east: Floats
    north: Floats


@dataclass(frozen=True)
class Planted:
    """An encounter in the archive: `threshold` "" or the one that it is close to, `inside` whether it is to be found."""

    kind: str
    devices: tuple[int, ...]
    at: float
    threshold: str = ""
    inside: bool = True


@dataclass
class _Draft:
    """Collects the drives of an archive, as rows, and the encounters planted among them."""

    random: np.random.Generator
    rows: list[dict[str, float]] = field(default_factory=list)
    planted: list[Planted] = field(default_factory=list)
    device: int = 100

    def between(self, low: float, high: float) -> float:
        return low + (high - low) * float(self.random.random())

    def add(
        self, place: tuple[float, float, float, float], drives: list[dict[str, float]]
    ) -> list[int]:
        """Put drives, given about an encounter's own middle, to a place (east, north, turned by, time); return their devices."""
        east, north, turned, when = place
        cos, sin = np.cos(turned), np.sin(turned)
        devices = []
        for drive in drives:
            row = STRAIGHT | drive
            x, y = row["x"], row["y"]
            row |= {
                "x": cos * x - sin * y,
                "y": sin * x + cos * y,
                "heading": row["heading"] + turned,
            }
            row |= {"east": east, "north": north} | {
                name: row[name] + when for name in ("at", "begin", "dip_at")
            }
            self.device += 1
            devices.append(int(row.setdefault("device", self.device)))
            self.rows.append(row)
        return devices


def write_archive(folder: Path, config: ArchiveConfig = ArchiveConfig(), seed: int = 0) -> Path:
    """Write SPMD files of about a million rows and, in `synthetic.json`, what is planted in them; same seed, same bytes.

    Args:
        folder: of the files; it may be there if it is empty.
        config: what it holds.
        seed: of all randomness.

    Raises:
        ValueError: the rows cannot hold that many encounters, or files are there.
    """
    drives, planted = plan(config, seed)
    folder.mkdir(parents=True, exist_ok=True)
    if any(folder.iterdir()):
        raise ValueError(f"{folder} is not empty; name another folder")
    counts = _write(folder, drives, config, np.random.default_rng([seed, 1]))
    document = {
        "synthetic": True,
        "seed": seed,
        **counts,
        "planted": [vars(encounter) for encounter in planted],
    }
    (folder / TRUTH).write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return folder


def read_planted(folder: Path) -> list[Planted]:
    """Return what is planted in an archive that `write_archive` wrote."""
    entries = json.loads((folder / TRUTH).read_text(encoding="utf-8"))["planted"]
    return [Planted(**entry | {"devices": tuple(entry["devices"])}) for entry in entries]


def plan(config: ArchiveConfig, seed: int) -> tuple[Drives, list[Planted]]:
    """Return all drives of an archive, and what is planted among them.

    Raises:
        ValueError: the encounters alone take more than the rows.
    """
    draft = _Draft(np.random.default_rng([seed, 0]))
    wide = int(np.ceil(np.sqrt(config.encounters + config.outside)))
    for k in range(config.encounters + config.outside):
        inside = k < config.encounters
        nth = k // 2 if inside else k - config.encounters
        threshold = THRESHOLDS[nth % len(THRESHOLDS)] if k % 2 or not inside else ""
        when = draft.between(60.0, 3600.0 * config.hours - 60.0)
        if k % 7 == 0 and config.hours >= 2.0:  # across the full hour, where tasks meet
            when = 3600.0 * (1 + k % int(config.hours - 1)) + draft.between(-3.0, 3.0)
        place = ((k % wide) * TILE, (k // wide + 1) * TILE, draft.between(-3.1, 3.1), when)
        kind = KINDS[k % len(KINDS)]
        if threshold:
            kind, drives = _at_threshold(draft, threshold, inside=inside)
        else:
            drives = _OF_KIND[kind](draft)
        devices = draft.add(place, drives)
        draft.planted.append(Planted(kind, tuple(devices), when, threshold, inside))
    used = sum(int(10.0 * row["lasts"]) for row in draft.rows)
    shared = [row for row in draft.rows if draft.random.random() < config.repeated_ids]
    _lone(
        draft, config, config.rows / (1.0 - config.loss) / (1.0 + config.duplicates) - used, shared
    )
    names = Drives.__dataclass_fields__
    columns = {
        name: np.array([row[name] for row in draft.rows], dtype=np.float64) for name in names
    }
    return Drives(columns.pop("device").astype(np.int64), **columns), draft.planted


def _lone(
    draft: _Draft, config: ArchiveConfig, rows: float, shared: list[dict[str, float]]
) -> None:
    """Add vehicles that meet nobody: for ten minutes each, a fifth of them side by side, and somebody for each shared id.

    Raises:
        ValueError: there is no room for any.
    """
    if rows < 0.0:
        raise ValueError(
            f"rows: the encounters alone take {-rows:.0f} rows more than {config.rows}"
        )
    lasts = min(600.0, 3600.0 * config.hours)
    count = int(np.ceil(rows / (10.0 * lasts)))
    north = begin = 0.0
    for k in range(count):
        block = k % 20 < 4  # side by side, at the same time
        north -= BLOCK if block and k % 20 else STREET
        if not block or k % 20 == 0:
            begin = draft.between(0.0, 3600.0 * config.hours - lasts)
        column = k // 2000
        if column and k % 2000 == 0:
            north = -STREET
        drive = {
            "heading": np.pi if k % 3 == 0 else 0.0,
            "speed": draft.between(8.0, 15.0),
            "begin": begin,
            "lasts": lasts,
        }
        drive |= {"at": begin + 300.0, "dip_at": begin + 200.0, "dip_width": 20.0}
        if k < len(shared):
            drive |= {
                "device": shared[k]["device"],
                "begin": max(shared[k]["begin"] - 300.0, 0.0),
                "at": shared[k]["begin"],
            }
        draft.add(
            (column * COLUMN, north, 0.0, 0.0), [drive | {"dip": 0.9 * draft.random.random()}]
        )


def _recorded(draft: _Draft, **drive: float) -> dict[str, float]:
    begin = -draft.between(18.0, 25.0)
    return drive | {"begin": begin, "lasts": draft.between(18.0, 25.0) - begin}


def _crossing(draft: _Draft, late: tuple[float, float] = (1.0, 2.4)) -> list[dict[str, float]]:
    angle = draft.between(1.1, 2.0) * (1.0 if draft.random.random() < 0.5 else -1.0)
    dip = {"dip": draft.between(0.0, 0.5), "dip_at": draft.between(-7.0, -4.0), "dip_width": 2.0}
    first = _recorded(draft, heading=0.0, speed=draft.between(7.0, 14.0))
    speed = draft.between(7.0, 14.0)
    return [first, dip | _recorded(draft, heading=angle, speed=speed, at=draft.between(*late))]


def _oncoming(draft: _Draft, beside: tuple[float, float] = (3.2, 4.5)) -> list[dict[str, float]]:
    first = _recorded(draft, heading=0.0, speed=draft.between(6.0, 14.0))
    speed = draft.between(6.0, 14.0)
    return [first, _recorded(draft, heading=np.pi, speed=speed, y=draft.between(*beside))]


def _following(draft: _Draft) -> list[dict[str, float]]:
    speed = draft.between(7.0, 15.0)
    headway = draft.between(1.1, 2.4)
    same = _recorded(draft, heading=0.0, speed=speed, dip=draft.between(0.0, 0.8))
    count = 3 if draft.random.random() < 0.2 else 2
    return [same | {"at": k * headway, "dip_at": k * headway} for k in range(count)]


def _merging(draft: _Draft) -> list[dict[str, float]]:
    angle = draft.between(0.8, 1.55)
    radius = draft.between(9.0, 14.0)
    same = _recorded(draft, speed=draft.between(6.0, 8.0))
    side = 1.0 if draft.random.random() < 0.5 else -1.0
    x = -radius * np.sin(angle)  # where the arc begins that ends at (0, 0)
    y = side * radius * (1.0 - np.cos(angle))
    at = draft.between(1.2, 2.4) - radius * angle / same["speed"]
    arc = {"heading": -side * angle, "turn": side * angle, "radius": radius}
    return [same | {"heading": 0.0}, same | arc | {"x": x, "y": y, "at": at}]


def _left_turn(draft: _Draft) -> list[dict[str, float]]:
    radius = draft.between(8.0, 11.0)
    lane = 3.5
    speed = draft.between(5.0, 8.0)
    other = draft.between(8.0, 14.0)
    across = float(np.sqrt(2.0 * radius * lane - lane * lane))
    beta = np.arctan2(across, radius - lane)  # where it crosses the other's lane
    passes = -radius * np.sin(beta) / other
    at = passes + draft.between(1.3, 2.4) - radius * beta / speed
    arc = {"y": lane, "radius": radius, "turn": np.pi / 2.0, "at": at}
    first = _recorded(draft, heading=0.0, speed=other)
    return [first, _recorded(draft, heading=np.pi, speed=speed, **arc)]


_OF_KIND = dict(zip(KINDS, (_crossing, _oncoming, _following, _merging, _left_turn), strict=True))


def _at_threshold(
    draft: _Draft, threshold: str, *, inside: bool
) -> tuple[str, list[dict[str, float]]]:
    """Return the kind and the drives of an encounter just inside or just outside of a threshold (the miner's defaults)."""

    def margin(limit: float, by: float) -> float:  # `by` on the side on which it is found
        return limit + (by if inside else -by) * draft.between(1.0, 1.5)

    if threshold == "proximity":  # behind each other, almost 100 m apart
        apart, times = margin(100.0, -4.0), {"begin": -6.0, "lasts": 12.0}
        return "following", [
            {"heading": 0.0, "speed": 38.0, "at": k * apart / 38.0, **times} for k in range(2)
        ]
    if threshold == "duration":  # nearer than 100 m for almost 5 s
        closing = 200.0 / margin(5.0, 0.6)
        same = {"speed": closing / 2.0, "begin": -9.0, "lasts": 18.0}
        return "oncoming", [same | {"heading": k * np.pi, "y": k * 3.6} for k in range(2)]
    if threshold == "presence":  # the second is recorded for almost 5 s
        lasts = margin(5.0, 0.6)
        first, second = _oncoming(draft)
        return "oncoming", [
            first | {"speed": 7.0},
            second | {"speed": 7.0, "begin": -lasts / 2.0, "lasts": lasts},
        ]
    if threshold == "travel":  # one stands, the other moves slowly
        speed, times = margin(5.0, 1.2) / 30.0, {"begin": -15.0, "lasts": 30.0}
        places = {"speed": speed}, {"speed": 0.0, "x": 4.8 + 15.0 * speed}
        return "following", [{"heading": 0.0, **times, **each} for each in places]
    if threshold == "beside":  # on two roads side by side
        beside = margin(6.0, -1.3)
        return "oncoming", _oncoming(draft, (beside, beside))
    late = margin(3.0, -0.5)
    return "crossing", _crossing(draft, (late, late))


def _write(
    folder: Path, drives: Drives, config: ArchiveConfig, random: np.random.Generator
) -> dict[str, int]:
    """Write the files; return how many rows of what there are."""
    counts = {"rows": 0, "wrong_times": 0, "damaged": 0, "duplicates": 0}
    number = 0
    days = (drives.begin // 86400.0).astype(np.int64)
    order = np.lexsort([drives.begin, days])
    for day in np.unique(days):
        own = order[days[order] == day]
        for part in _parts(own, np.maximum(drives.lasts[own] * 10.0, 1.0)):
            number += 1
            label = (date(2004, 1, 1) - DAY0).days + FIRST_DAY + int(day)
            columns = _rows(drives, part, number, config, random, counts)
            path = folder / f"TripStart_bsmrx_{label}_p{number:03}.csv"
            csv.write_csv(pa.table(columns), path, csv.WriteOptions(include_header=False))
            broken = round(config.damaged * len(columns["TxDevice"]))
            if broken:
                with path.open(
                    "a", encoding="utf-8"
                ) as file:  # torn rows, a row of text, and an end that is cut off
                    file.writelines(
                        "17,3,\n" if k % 2 else "x,".join(["17"] * 19) + "\n"
                        for k in range(broken - 1)
                    )
                    file.write("17,3,55,261")
            counts["damaged"] += broken
            counts["rows"] += len(columns["TxDevice"]) + broken
    return counts


def _parts(own: Ints, rows: Floats) -> Iterator[Ints]:
    """Cut drives into files of about a million rows."""
    file = (np.cumsum(rows) // ROWS_PER_FILE).astype(np.int64)
    for k in np.unique(file):
        yield own[file == k]


def states(drives: Drives, who: Ints, time: Floats) -> tuple[Floats, Floats, Floats]:
    """Return positions (R, 2) [m] from the archive's origin, headings (R,) [rad] and speeds (R,) [m/s].

    Args:
        drives: of V vehicles.
        who: (R,) index of a drive.
        time: (R,) s.
    """
    base, width = drives.speed[who], drives.dip_width[who]
    since, since_at = (
        (time - drives.dip_at[who]) / width,
        ((drives.at - drives.dip_at) / drives.dip_width)[who],
    )
    dip = drives.dip[who]
    speed = base * (1.0 - dip / (1.0 + np.square(since)))
    driven = base * (
        (time - drives.at[who])
        - dip * width * (np.arctan2(since, 1.0) - np.arctan2(since_at, 1.0))
    )
    radius, turn, heading = drives.radius[who], drives.turn[who], drives.heading[who]
    bent = np.clip(driven / radius, 0.0, np.abs(turn))
    side = np.sign(turn)
    now = heading + side * bent
    rest = driven - bent * radius
    cos, sin, cos0, sin0 = np.cos(now), np.sin(now), np.cos(heading), np.sin(heading)
    x = drives.x[who] + side * radius * (sin - sin0) + rest * cos
    y = drives.y[who] - side * radius * (cos - cos0) + rest * sin
    return np.stack([x + drives.east[who], y + drives.north[who]], axis=1), now, speed


def _rows(
    drives: Drives,
    part: Ints,
    number: int,
    config: ArchiveConfig,
    random: np.random.Generator,
    counts: dict[str, int],
) -> dict[str, Ints | Floats]:
    """Return the columns of one file."""
    amount = np.maximum((drives.lasts[part] * 10.0).astype(np.int64), 1)
    who = np.repeat(part, amount)
    tick = np.arange(len(who)) - np.repeat(np.cumsum(amount) - amount, amount)
    phase = np.repeat(0.1 * random.random(len(part)), amount)
    time = drives.begin[who] + 0.1 * tick + phase + 0.03 * (random.random(len(who)) - 0.5)
    position, heading, speed = states(drives, who, time)
    off = config.noise * random.standard_normal((len(drives.x), 2))
    position = position + off[who] + 0.05 * (random.random((len(who), 2)) - 0.5)
    away = position - np.column_stack(
        [drives.east[who], drives.north[who]]
    )  # from its encounter's own place on the globe
    middle = PLACE[1] + drives.east[who] / 80_000.0, PLACE[0] + drives.north[who] / 111_000.0
    longitude, latitude, _ = pyproj.Geod(ellps="WGS84").fwd(
        *middle, np.degrees(np.arctan2(*away.T)), np.hypot(*away.T)
    )
    stamp = (np.round(time * 1e6) + FIRST_DAY * 86400e6).astype(np.int64)
    second = stamp // 1000 % 60_000
    kept = random.random(len(who)) >= config.loss
    copies = np.where(kept, 1 + (random.random(len(who)) < config.duplicates), 0)
    at = np.repeat(np.arange(len(who)), copies)
    again = np.concatenate([[False], np.diff(at) == 0])
    counts["duplicates"] += int(again.sum())
    stamp = stamp[at]
    wrong = random.random(len(at)) < config.wrong_times
    shift = (random.random(int(wrong.sum())) * 2e12 - 1e12).astype(np.int64)
    stamp[wrong] = np.where(shift % 7 == 0, 0, stamp[wrong] + shift)
    counts["wrong_times"] += int(wrong.sum())
    device = drives.device[who][at]
    zeros = np.zeros(len(at), dtype=np.int64)
    north_clockwise = np.degrees(np.pi / 2.0 - heading[at]) % 360.0
    return {
        "RxDevice": np.where(again, device + 1, device + 2),
        "FileId": np.full(len(at), number),
        "TxDevice": device,
        "Gentime": stamp,
        "TxRandom": zeros,
        "MsgCount": tick[at] % 128,
        "DSecond": second[at],
        "Latitude": np.round(latitude[at], 7),
        "Longitude": np.round(longitude[at], 7),
        "Elevation": np.full(len(at), 250.0),
        "Speed": np.round(speed[at] * 1.005, 2),
        "Heading": np.round(north_clockwise, 4),
        **dict.fromkeys(("Ax", "Ay", "Az", "Yawrate", "PathCount", "RadiusOfCurve"), zeros),
        "Confidence": np.full(len(at), 100),
    }


def main() -> None:
    """Write the archive that the command line describes."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    for one in fields(ArchiveConfig):
        parser.add_argument(
            f"--{one.name.replace('_', '-')}", type=type(one.default), default=one.default
        )
    arguments = vars(parser.parse_args())
    folder, seed = arguments.pop("folder"), arguments.pop("seed")
    try:
        planted = read_planted(write_archive(folder, ArchiveConfig(**arguments), seed))
    except ValueError as error:
        parser.error(str(error))
    inside = sum(one.inside for one in planted)
    print(
        f"{folder}: synthetic, {inside} encounters to find, {len(planted) - inside} just beyond a threshold"
    )


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A folder laid out as the recorded data is, made from seeds: a test reads either. Nothing in it was recorded.

Files have the recorded ones' names and columns, and their faults: GPS noise and slow drift, uneven clocks, losses, repeated rows,
stamps of reception, speeds by differences, steps of video tracking, vehicles whose id changes, two cars whose GPS puts them on
top of each other. What is driven: waits, turns, lane changes, stop and go, oncoming cars, queues of two to nine.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
import itertools
from pathlib import Path

import numpy as np
import pandas as pd
from PIL import Image
from rosbags.rosbag2 import StoragePlugin, Writer

from scenario_gen.logs.geodesy import geodetic
from scenario_gen.types import Vehicle
from support import map_builders
from support.synthetic_cases import coloured_noise, Drive, LANE, Leg, Phase, quarter, STORES

EAST, NORTH, WEST, SOUTH = 0.0, np.pi / 2.0, np.pi, -np.pi / 2.0
SIDE = LANE / 2.0
ORIGIN = (48.2, 11.6)  # degrees
AUTOWARE = (0.666, -0.559)  # degrees, where the map of Autoware's dialect lies
STILL = Phase(600.0)
VIDEO = [
    "t_s",
    "vehicle_id",
    "type",
    "x_m",
    "y_m",
    "speed_mps",
    "heading_rad",
    "length_m",
    "width_m",
]
RADIO = [
    "t_s",
    "clock_s",
    "vehicle_id",
    "lat_deg",
    "lon_deg",
    "elev_raw",
    "speed_mps",
    "heading_rad",
]
GPS = [
    "t_s",
    "utc_s",
    "vehicle_id",
    "lat_deg",
    "lon_deg",
    "speed_mps",
    "heading_rad",
    "gga_fix_quality",
]
DOPPLER = [
    "t_s",
    "time_s",
    "vehicle_pos",
    "vehicle_name",
    "lat_deg",
    "lon_deg",
    "alt_m",
    "e_m",
    "n_m",
    "speed_mps",
]


def drive(
    name: str,
    pose: tuple[float, float, float],
    speed: float,
    *phases: Phase,
    legs: Sequence[Leg] = (),
    **size: float,
) -> Drive:
    """A vehicle's true motion from time 0; after the last phase it goes on as it is, after the last leg straight on."""
    return Drive(Vehicle(name, **size), pose, speed, (*legs, Leg(1.0)), (*phases, STILL))


def lane_change(side: int, metres: float = 24.0) -> tuple[Leg, Leg]:
    """Two arcs to the next lane: to the left (side 1) or the right (-1)."""
    curvature = side * 4.0 * LANE / (metres**2 + LANE**2)
    angle = 2.0 * np.arctan2(LANE, metres)
    return Leg(angle / abs(curvature), curvature), Leg(angle / abs(curvature), -curvature)


@dataclass
class Writing:
    """How one kind of recorder writes drives down: `time` its stamps [s], by which a file counts from its `zero`."""

    seed: int
    begin: float
    end: float
    zero: float = 0.0
    period: float = 0.1
    shift: dict[str, tuple[float, float]] = field(
        default_factory=dict
    )  # m by which a vehicle's GPS is off

    def random(self, number: int) -> np.random.Generator:
        return np.random.Generator(np.random.PCG64(np.random.SeedSequence([self.seed, number])))

    def clock(self) -> np.ndarray:
        return self.begin + self.period * np.arange(
            round((self.end - self.begin) / self.period) + 1
        )

    def video(self, drives: Sequence[Drive]) -> pd.DataFrame:
        """Metres in a local frame; the speed is the tracker's, which holds it over a few pictures."""
        tables = []
        for number, one in enumerate(drives):
            rng, time = self.random(number), self.clock()
            x, y, heading, speed = one.state(time).T
            moves = np.minimum(speed, 1.0)
            noise = 0.03 * rng.normal(size=(2, time.size)) * moves
            said = np.maximum(
                speed + 0.15 * moves * np.repeat(rng.normal(size=time.size), 3)[: time.size], 0.0
            )
            facts = {
                "vehicle_id": one.vehicle.id,
                "type": "car",
                "length_m": one.vehicle.length,
                "width_m": one.vehicle.width,
            }
            columns = {
                "x_m": x + noise[0],
                "y_m": y + noise[1],
                "speed_mps": said,
                "heading_rad": wrapped(heading),
            }
            tables.append(pd.DataFrame({"t_s": (time - self.zero).round(2), **facts, **columns}))
        return pd.concat(tables).sort_values(["t_s", "vehicle_id"], kind="stable")[VIDEO].round(4)

    def fixes(
        self, one: Drive, number: int, uneven: float
    ) -> tuple[np.random.Generator, pd.DataFrame]:
        """What one car's GPS says: noisy places that drift, at stamps off the clock by `uneven` [s]."""
        rng, time = self.random(number), self.clock()
        stamp = (
            time + np.clip(rng.normal(0.0, 1.0, time.size), -2.0, 2.0) * uneven + uneven * number
        )
        x, y, heading, speed = one.state(stamp).T
        drift = 0.3 * coloured_noise(time.size, rng) + self.shift.get(one.vehicle.id, (0.0, 0.0))
        east, north = x + drift[:, 0], y + drift[:, 1]
        latitude, longitude = geodetic(np.stack([east, north], axis=-1), ORIGIN)
        facts = {
            "lat_deg": latitude,
            "lon_deg": longitude,
            "speed_mps": speed,
            "heading_rad": wrapped(heading),
        }
        return rng, pd.DataFrame({"t_s": stamp - self.zero, **facts, "e_m": east, "n_m": north})

    def radio(self, drives: Sequence[Drive], gaps: Sequence[float] = ()) -> pd.DataFrame:
        """Basic safety messages: uneven stamps, losses, `gaps` of that many seconds, rows heard twice, speeds by differences."""
        tables = []
        for number, one in enumerate(drives):
            rng, rows = self.fixes(one, number, 0.012)
            east, north, at = (rows[name].to_numpy() for name in ("e_m", "n_m", "t_s"))
            before, after = (
                np.maximum(np.arange(at.size) - 5, 0),
                np.minimum(np.arange(at.size) + 5, at.size - 1),
            )
            rows["speed_mps"] = np.hypot(
                east[after] - east[before], north[after] - north[before]
            ) / (at[after] - at[before])
            lost = rng.random(at.size) < 0.05
            for k, seconds in enumerate(gaps):
                gap = at[0] + (k + 0.5 + 0.3 * number) * (at[-1] - at[0]) / (len(gaps) + 1)
                lost |= (at > gap) & (at < gap + seconds)
            lost[[0, -1]] = False
            repeated = rows[~lost & (rng.random(at.size) < 0.03)]
            tables.append(
                pd.concat([rows[~lost], repeated]).assign(vehicle_id=one.vehicle.id, elev_raw=3300)
            )
        whole = pd.concat(tables).sort_values(["t_s", "vehicle_id"], kind="stable")
        whole["clock_s"] = (whole["t_s"] + 2322.1).round(2)
        return whole[RADIO].round(
            {"t_s": 2, "lat_deg": 7, "lon_deg": 7, "speed_mps": 3, "heading_rad": 3}
        )

    def gps(self, drives: Sequence[Drive]) -> pd.DataFrame:
        """One clock for all; speed and heading by differences over a second, so that headings jitter at low speed."""
        tables = []
        for number, one in enumerate(drives):
            _, rows = self.fixes(one, number, 0.0)
            east, north = rows["e_m"].to_numpy(), rows["n_m"].to_numpy()
            rows["speed_mps"] = np.hypot(
                np.gradient(east, self.period), np.gradient(north, self.period)
            )
            rows["speed_mps"] = rows["speed_mps"].rolling(11, center=True, min_periods=1).mean()
            rows["heading_rad"] = np.arctan2(np.gradient(north), np.gradient(east))
            tables.append(rows.assign(vehicle_id=one.vehicle.id, gga_fix_quality=1 + number % 2))
        whole = pd.concat(tables).sort_values(["t_s", "vehicle_id"], kind="stable")
        whole["utc_s"] = (whole["t_s"] + self.zero + UTC).round(1)
        return whole[GPS].round(
            {"t_s": 1, "lat_deg": 9, "lon_deg": 9, "speed_mps": 3, "heading_rad": 3}
        )

    def doppler(self, drives: Sequence[Drive]) -> pd.DataFrame:
        """GPS whose speed is measured by itself, with metres in two columns beside the degrees."""
        tables = []
        for number, one in enumerate(drives):
            rng, rows = self.fixes(one, number, 0.0)
            rows["speed_mps"] = np.maximum(
                rows["speed_mps"] + rng.normal(0.0, 0.03, len(rows)), 0.0
            )
            tables.append(
                rows.assign(
                    vehicle_pos=number + 2, vehicle_name=one.vehicle.id, alt_m=228.0 + number
                )
            )
        whole = pd.concat(tables).sort_values(["t_s", "vehicle_pos"], kind="stable")
        whole["time_s"] = (whole["t_s"] + 5370.0).round(1)
        return whole[DOPPLER].round(
            {"t_s": 1, "lat_deg": 9, "lon_deg": 9, "e_m": 3, "n_m": 3, "speed_mps": 3}
        )


UTC = 35150.4  # s


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Within half a turn of zero, as recorders write headings."""
    return np.angle(np.exp(1j * angle))


# --- what is driven ----------------------------------------------------------------------------------------------------------


def waits_at_a_side_road() -> list[Drive]:
    """One passes on the main road; one stands at the side road, then turns right; its record ends in the turn."""
    waits = drive(
        "21202",
        (SIDE, -12.0, NORTH),
        0.0,
        Phase(4.0),
        Phase(8.0, 1.2),
        legs=[Leg(2.0), quarter(8.0, -1)],
        **CAR,
    )
    passes = drive("21260", (-38.0, -SIDE, EAST), 11.5, Phase(8.0, -0.2), **CAR)
    return [waits, passes]


def turns_left() -> list[Drive]:
    """One stands in the junction until an oncoming one has passed, then turns left."""
    size = {"length": 3.81, "width": 1.9812}
    phases = (Phase(3.4), Phase(2.5, 1.88))
    waits = drive(
        "2839", (-11.0, -SIDE, EAST), 0.0, *phases, legs=[Leg(1.0), quarter(11.5, 1)], **size
    )
    oncoming = drive(
        "21019", (32.0, SIDE, WEST), 7.0, Phase(4.0, 0.9), Phase(4.0), length=3.3528, width=1.8898
    )
    return [waits, oncoming]


def two_turn_left() -> list[Drive]:
    """The same with a second one behind, which follows."""
    ahead, oncoming = turns_left()
    behind = drive(
        "2829",
        (-19.0, -SIDE, EAST),
        0.2,
        Phase(4.0),
        Phase(3.0, 1.2),
        legs=[Leg(9.0), quarter(11.5, 1)],
        **CAR,
    )
    return [behind, ahead, oncoming]


def stop_and_go() -> list[Drive]:
    """Opposite directions on a street, a lane between; both stop and go."""
    phases = (
        (Phase(2.0), Phase(5.0, 1.4), Phase(5.0, -1.1)),
        (Phase(3.5), Phase(6.0, 1.2), Phase(4.0, -0.9)),
    )
    south = drive("134", (-SIDE - LANE, 30.0, SOUTH), 0.0, *phases[0], length=4.8768, width=2.1336)
    north = drive("334", (SIDE + LANE, -60.0, NORTH), 0.0, *phases[1], length=5.6388, width=2.1336)
    return [south, north]


def changes_lanes() -> list[Drive]:
    """Four on two lanes; one changes to the other one's lane, where its GPS puts it on top of that."""
    phases = (Phase(12.0), Phase(16.0, 0.05), Phase(12.0, -0.02))
    first = drive("1", (0.0, 0.0, WEST), 2.2, *phases, legs=[Leg(20.0), *lane_change(1)])
    second = drive("2", (3.0, -3.2, WEST), 2.2, *phases)
    third = drive("3", (16.0, -3.2, WEST), 2.1, Phase(10.0), Phase(18.0, 0.05), Phase(12.0, -0.02))
    fourth = drive("4", (34.0, 0.0, WEST), 2.0, Phase(14.0), Phase(12.0, 0.06), Phase(14.0))
    return [first, second, third, fourth]


def opposite(first: str, second: str, begin: float = 0.0) -> list[Drive]:
    """Two come towards each other and pass; they slow down and speed up again."""
    phases = (Phase(begin), Phase(6.0, 0.3), Phase(8.0, -0.35), Phase(6.0), Phase(10.0, 0.25))
    return [
        drive(first, (-90.0 - 5.5 * begin, -SIDE, EAST), 5.5, *phases),
        drive(
            second,
            (95.0 + 6.5 * begin, SIDE, WEST),
            6.5,
            Phase(begin),
            Phase(10.0, -0.25),
            Phase(8.0),
            Phase(12.0, 0.2),
        ),
    ]


def meets_then_stands() -> list[Drive]:
    """Two come towards each other; one brakes to a stop before they meet, the other one passes it."""
    stops = drive(
        "2a3c600d",
        (-70.0, -SIDE, EAST),
        9.0,
        Phase(4.0),
        Phase(9.0, -1.0),
        Phase(12.0),
        Phase(10.0, 0.7),
    )
    passes = drive(
        "2a3c603c", (120.0, SIDE, WEST), 6.0, Phase(8.0, 0.2), Phase(20.0), Phase(10.0, -0.4)
    )
    return [stops, passes]


def follows() -> list[Drive]:
    """One behind the other round a bend, slowing down and speeding up."""
    phases = (Phase(10.0), Phase(5.0, -0.5), Phase(6.0, 0.5), Phase(10.0), Phase(6.0, -0.4))
    legs = [Leg(90.0), quarter(35.0, 1)]
    ahead = drive("2a3c603c", (30.0, 0.0, EAST), 8.0, *phases, legs=[Leg(60.0), legs[1]])
    behind = drive("2a3c600d", (0.0, 0.0, EAST), 8.0, Phase(1.2), *phases, legs=legs)
    return [ahead, behind]


MODELS = ["TESLA_MODELX", "TESLA_MODEL3", "TESLA_MODELS", "BMW_I3", "MINI_COOPER"]
MODELS += ["TOYOTA_RAV4", "JAGUAR_I_PACE", "MERCEDES_GLE", "AUDI_A4"]


def platoon(count: int) -> list[Drive]:
    """A queue that a wave of slowing down runs through again and again, each a little later than the one ahead."""
    wave = (Phase(9.0, -0.5), Phase(6.0), Phase(9.0, 0.5), Phase(7.0))
    return [
        drive(
            name,
            (-19.0 * k, 0.0, 0.4),
            12.0,
            Phase(6.0 + 1.1 * k),
            *wave * 5,
            legs=[Leg(400.0 + 19.0 * k), Leg(300.0, 0.003)],
        )
        for k, name in enumerate(MODELS[:count])
    ]


def there_and_back() -> list[Drive]:
    """Two meet, part and meet again: five passes on one road, each turning round far away from the other."""
    found = []
    for name, x, side, speed in (("2a3c600d", -60.0, -SIDE, 9.0), ("2a3c603c", 70.0, SIDE, 8.4)):
        heading = EAST if side < 0.0 else WEST
        half = (Leg(220.0), Leg(2.0 * SIDE * np.pi * 3.0, 1.0 / (6.0 * SIDE)))
        changes = (Phase(12.0), Phase(6.0, -0.6), Phase(6.0, 0.6)) * 12
        found.append(drive(name, (x, side * 6.0, heading), speed, *changes, legs=half * 12))
    return found


CAR = {"length": 4.2672, "width": 2.1336}


def street() -> pd.DataFrame:
    """Thirteen seconds of a street with three queues, in which vehicles come and go and three change their id on the way."""
    drives = []
    for lane in range(3):
        north = lane < 2
        for k in range(6):
            x = (SIDE + LANE * lane) if north else -SIDE
            y = (-60.0 - 22.0 * k) if north else (60.0 + 22.0 * k)
            phases = (Phase(2.0 + 0.6 * k), Phase(3.0, -1.0), Phase(3.0, 0.9), Phase(5.0))
            drives.append(
                drive(
                    str(100 + 10 * lane + k),
                    (x, y, NORTH if north else SOUTH),
                    9.0,
                    *phases,
                    **CAR,
                )
            )
    rows = Writing(21, 0.0, 13.0).video(drives)
    for k, name in enumerate(("102", "111", "123")):
        rows.loc[(rows["vehicle_id"] == name) & (rows["t_s"] > 5.0 + k), "vehicle_id"] = (
            f"3{name[1:]}"
        )
    late = rows["vehicle_id"].isin(["104", "114"]) & (rows["t_s"] < 3.0)
    gone = rows["vehicle_id"].isin(["100", "120"]) & (rows["t_s"] > 11.0)
    return rows[~late & ~gone]


def tables() -> dict[str, pd.DataFrame]:
    """Every file of trajectories by its name."""
    over = {"1": (0.0, 1.2), "2": (0.0, -0.4)}
    gaps = (0.4, 0.8, 5.0, 0.9, 2.0, 12.0, 3.0, 0.7, 1.5, 4.0, 2.5, 6.0)
    sources = {
        "ngsim_commonroad": {
            "encounter_3plus_two_left_turners_one_opposite_Lanker-2_13": Writing(
                1, 0.0, 8.0
            ).video(two_turn_left()),
            "encounter_a_cross_one_stops_Lanker-2_15_21202_21260": Writing(2, 0.0, 8.0).video(
                waits_at_a_side_road()
            ),
            "encounter_b_left_turn_vs_opposite_Lanker-2_13_2839_21019": Writing(3, 0.0, 8.0).video(
                turns_left()
            ),
            "encounter_c_opposite_stop_go_Peach-4_2_134_334": Writing(4, 0.0, 11.5).video(
                stop_and_go()
            ),
            "USA_Peach-4_2_T-1_all_vehicles": street(),
        },
        "psu_2obu": {
            "encounter_c_opposite_approach_then_stop_meet_300-340s": Writing(
                5, 0.0, 36.0, -300.0
            ).radio(meets_then_stands()),
            "encounter_following_follow_230-270s": Writing(6, 0.0, 40.0, -230.0).radio(follows()),
            "psu_meet_full": Writing(7, 0.0, 360.0).radio(there_and_back(), gaps),
        },
        "cats_av_lane_change": {
            "encounter_3plus_lane_change_four_vehicles_utc36110": Writing(
                8, 0.0, 40.0, shift=over
            ).gps(changes_lanes()),
            "encounter_c_opposite_v2_v4_utc35195": Writing(9, 8.0, 38.0).gps(
                opposite("2", "4", 8.0)
            ),
            **{
                f"cats_vehicle{2 + 2 * k}_full": Writing(13 + k, 0.0, 90.0)
                .gps([one])
                .drop(columns="t_s")
                for k, one in enumerate(opposite("2", "4", 40.0))
            },
        },
        "openacc_zalazone": {
            "encounter_3plus_platoon4_openacc_no_ACC_handling_part22_60-100s": Writing(
                11, 60.0, 100.0
            ).doppler(platoon(4)),
            "openacc_no_ACC_handling_part22_first150s": Writing(12, 0.0, 150.0).doppler(
                platoon(9)
            ),
        },
    }
    return {
        f"{folder}/{name}": rows
        for folder, files in sources.items()
        for name, rows in files.items()
    }


# --- maps and bags -----------------------------------------------------------------------------------------------------------


def grid(folder: Path, name: str, roads: Sequence[tuple[float, float, float, float]]) -> None:
    """Write free rectangles (x, y from and to [m]) of a square 240 m wide as a nav2 map."""
    cells = np.zeros((1200, 1200), dtype=np.uint8)
    for x0, y0, x1, y1 in roads:
        a, b, c, d = (round((value + 120.0) / 0.2) for value in (x0, y0, x1, y1))
        cells[max(b, 0) : d, max(a, 0) : c] = 254
    folder.mkdir(parents=True, exist_ok=True)
    Image.fromarray(cells[::-1]).save(folder / f"{name}.pgm")
    facts = f"image: {name}.pgm\nmode: trinary\nresolution: 0.2\norigin: [-120.0, -120.0, 0.0]\n"
    (folder / f"{name}.yaml").write_text(
        facts + "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )


def maps(folder: Path) -> None:
    """Write the maps: grids of the places where the video's vehicles drive, and the crossroads in each format of vector maps."""
    crossing = [(-120.0, -6.0, 120.0, 6.0), (-6.0, -120.0, 6.0, 120.0), (-14.0, -14.0, 14.0, 14.0)]
    grid(folder / "occupancy_grids", "USA_Lanker-2_13_T-1", crossing)
    grid(
        folder / "occupancy_grids",
        "USA_Peach-4_2_T-1",
        [(-9.0, -120.0, 9.0, 120.0), (-120.0, 20.0, 120.0, 30.0)],
    )
    grid(folder / "nav2", "warehouse", [(-30.0, -20.0, 30.0, 20.0)])
    crossroads = map_builders.opendrive()
    texts = {
        "commonroad/USA_Lanker-2_13_T-1.xml": map_builders.commonroad(),
        "commonroad/USA_Peach-4_2_T-1.xml": map_builders.commonroad(offset=(1000.0, -500.0)),
        "lanelet2/simple_cross_map.osm": map_builders.lanelet2(tagged),
        "lanelet2/kashiwanoha.osm": two_lanes(),
        "lanelet2/mapping_example.osm": map_builders.lanelet2(degrees),
        "opendrive/simple_4way_intersection.xodr": crossroads,
        "opendrive/fabriksgatan.xodr": crossroads.replace('a="3.5"', 'a="3.0"'),
        "opendrive/multi_lane_3way_intersection.xodr": map_builders.opendrive(
            "+proj=tmerc +lat_0=48.2 +lon_0=11.6 +datum=WGS84"
        ),
        "opendrive/jolengatan.xodr": crossroads.replace('b="0"', 'b="0.004"'),
    }
    for name, text in texts.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def degrees(x: float, y: float) -> str:
    """The place of a Lanelet2 node, in degrees alone."""
    latitude, longitude = geodetic(np.array([[x, y]]), ORIGIN)
    return f'lat="{float(latitude[0])!r}" lon="{float(longitude[0])!r}">'


def tagged(x: float, y: float) -> str:
    """The same in metres, too, as Autoware's dialect has it."""
    latitude, longitude = geodetic(np.array([[x, y]]), AUTOWARE)
    node = f'lat="{float(latitude[0])!r}" lon="{float(longitude[0])!r}">'
    return f'{node}<tag k="local_x" v="{x!r}"/><tag k="local_y" v="{y!r}"/>'


def tags_of(**facts: str) -> str:
    """Tags of OpenStreetMap."""
    return "".join(f'<tag k="{key}" v="{value}"/>' for key, value in facts.items())


def two_lanes() -> str:
    """A road of two lanes with a dashed line between them that both share, each in two parts, in Lanelet2."""
    nodes, ways, relations = [], [], []
    for row in range(3):
        nodes += [
            f'<node id="{1 + 3 * row + k}" {tagged(x, LANE * row)}</node>'
            for k, x in enumerate((-60.0, 0.0, 60.0))
        ]
        for part in range(2):
            refs = "".join(f'<nd ref="{1 + 3 * row + part + k}"/>' for k in range(2))
            tags = tags_of(type="line_thin", subtype="dashed" if row == 1 else "solid")
            ways.append(f'<way id="{100 + 2 * row + part}">{refs}{tags}</way>')
    tags = tags_of(
        type="lanelet", subtype="road", location="urban", one_way="yes", speed_limit="50"
    )
    for lane, part in itertools.product(range(2), range(2)):
        sides = ((lane + 1, "left"), (lane, "right"))
        members = "".join(
            f'<member type="way" ref="{100 + 2 * row + part}" role="{role}"/>'
            for row, role in sides
        )
        relations.append(f'<relation id="{200 + 2 * lane + part}">{members}{tags}</relation>')
    return f'<?xml version="1.0"?><osm version="0.6">{"".join(nodes + ways + relations)}</osm>'


BAGS = {
    "wbag": {topic * 3: ("std_msgs/msg/String", 40 + k) for k, topic in enumerate("ABCDEFGH")},
    "talker": {"/topic": ("std_msgs/msg/String", 10), "/rosout": ("rcl_interfaces/msg/Log", 10)},
    "cdr_test": {
        "/test_topic": ("test_msgs/msg/BasicTypes", 7),
        "/array_topic": ("test_msgs/msg/Arrays", 4),
    },
    "test_bag_for_seek": {"/seek": ("std_msgs/msg/Int32", 120)},
}


def bags(folder: Path) -> None:
    """Write bags without vehicles by the rosbags library, in both storages; of some types nobody here has the definition."""
    string = STORES.types["std_msgs/msg/String"]
    for storage, plugin in (("mcap", StoragePlugin.MCAP), ("sqlite3", StoragePlugin.SQLITE3)):
        (folder / storage).mkdir(parents=True)
        for name, topics in BAGS.items():
            with Writer(folder / storage / name, version=9, storage_plugin=plugin) as bag:
                for topic, (kind, count) in topics.items():
                    given = (
                        {}
                        if kind in STORES.types
                        else {"msgdef": "int32 data\n", "rihs01": "RIHS01_" + "0" * 64}
                    )
                    connection = bag.add_connection(
                        topic, kind, **(given if given else {"typestore": STORES})
                    )
                    for k in range(count):
                        data = STORES.serialize_cdr(
                            string(data=f"Hello {k}"), "std_msgs/msg/String"
                        )
                        bag.write(connection, 10**9 + 10**7 * k, bytes(data))


def write(folder: Path) -> Path:
    """Write everything into a folder; return it."""
    for name, rows in tables().items():
        path = folder / "trajectories" / f"{name}.csv"
        path.parent.mkdir(parents=True, exist_ok=True)
        rows.to_csv(path, index=False)
    maps(folder / "maps")
    bags(folder / "bags")
    return folder

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Draw the encounters of `scenario-gen demo`: `python docs/demo_encounters.py` writes scenario_gen/resources/demo/*.csv.

They are invented, with textbook driver behaviour, and rows as a roadside camera gives them: 10 Hz, 5 cm and 0.1 m/s of noise.
"""

from pathlib import Path

import numpy as np
from scipy import ndimage

from scenario_gen.numerics import Floats
from scenario_gen.numerics.curve import Curve

FOLDER = Path(__file__).resolve().parents[1] / "scenario_gen" / "resources" / "demo"
DT = 0.1  # s
NOISE_M, NOISE_MPS = 0.05, 0.1
Drive = tuple[Curve, Floats, float]  # path, speed (T,) [m/s], first station [m]


def main() -> None:
    """Write the three logs."""
    rng = np.random.default_rng(1910)
    write("left_turn", rng, [oncoming(rng), left_turner(rng)])
    write("follower", rng, following(rng))
    write("all_way_stop", rng, [stopping(rng, k, wait) for k, wait in enumerate((1.0, 3.5, 6.5))])


def write(name: str, rng: np.random.Generator, drives: list[Drive]) -> None:
    """Write one log: a row for each vehicle and instant."""
    lines = ["vehicle_id,time,x,y,speed"]
    for vehicle, (path, speed, start) in enumerate(drives, start=1):
        station = start + np.concatenate([[0.0], np.cumsum(0.5 * DT * (speed[1:] + speed[:-1]))])
        x, y = path.at(station)[:, :2].T
        noise = ndimage.gaussian_filter1d(rng.standard_normal((2, len(x))), 5.0) * NOISE_M * 4.0
        measured = np.where(
            speed > 0.0, np.maximum(speed + NOISE_MPS * rng.standard_normal(len(speed)), 0.0), 0.0
        )
        moving = ndimage.gaussian_filter1d((speed > 0.0).astype(float), 3.0)
        rows = zip(
            np.arange(len(x)) * DT,
            x + moving * noise[0],
            y + moving * noise[1],
            measured,
            strict=True,
        )
        lines += [f"{vehicle},{t:.1f},{a:.2f},{b:.2f},{v:.2f}" for t, a, b, v in rows]
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / f"{name}.csv").write_text("\n".join(lines) + "\n")


def way(*points: tuple[float, float]) -> Curve:
    """A way through points, its corners rounded as a car drives them."""
    xy = np.array(points)
    length = float(np.hypot(*np.diff(xy, axis=0).T).sum())
    dense = Curve.through(xy).cut(0.0, length, 0.5).points[:, :2]
    return Curve.through(ndimage.gaussian_filter1d(dense, 7.0, axis=0, mode="nearest"))


def speeds(rng: np.random.Generator, seconds: float, *knots: tuple[float, float]) -> Floats:
    """Speeds (T,) through knots (s, m/s), rounded over a second, with a driver's slow variation while moving."""
    time = np.arange(round(seconds / DT)) * DT
    smooth = ndimage.gaussian_filter1d(np.interp(time, *np.array(knots).T), 4.0, mode="nearest")
    slow = ndimage.gaussian_filter1d(rng.standard_normal(len(time) + 80), 12.0)[40:-40] * 0.8
    speed = smooth * (1.0 + 0.05 * slow)
    return np.where(speed < 0.25, 0.0, speed)


def oncoming(rng: np.random.Generator) -> Drive:
    """A car that goes straight on, towards -x, through the junction at 0, 0."""
    return way((90.0, 1.75), (-110.0, 1.75)), speeds(rng, 16.0, (0.0, 11.5), (16.0, 12.0)), 0.0


def left_turner(rng: np.random.Generator) -> Drive:
    """A car from -x that slows, stands before the oncoming lane until the other one has passed, and turns left."""
    knots = (0.0, 10.0), (2.0, 9.5), (6.0, 0.0), (8.4, 0.0), (12.0, 7.0), (16.0, 9.5)
    return way((-90.0, -1.75), (1.75, -1.75), (1.75, 90.0)), speeds(rng, 16.0, *knots), 46.5


def following(rng: np.random.Generator) -> list[Drive]:
    """A leader that slows for something ahead and goes on, and a follower that answers after 0.8 s (intelligent driver model)."""
    leader = speeds(
        rng, 24.0, (0.0, 13.0), (5.0, 13.0), (9.0, 4.5), (13.0, 4.5), (19.0, 12.0), (24.0, 12.5)
    )
    ahead = np.cumsum(leader) * DT + 24.0
    own, station, speed = [], 0.0, 13.0
    for k in range(len(leader)):
        seen = max(k - 8, 0)
        gap = max(ahead[seen] - (np.sum(own[:seen]) * DT if seen else 0.0) - 4.6, 0.5)
        wanted = 2.5 + max(
            0.0, 1.3 * speed + speed * (speed - leader[seen]) / (2.0 * np.sqrt(1.6 * 2.2))
        )
        speed = max(speed + DT * 1.6 * (1.0 - (speed / 15.0) ** 4 - (wanted / gap) ** 2), 0.0)
        own.append(speed)
        station += DT * speed
    lane = way((0.0, 0.0), (420.0, 0.0))
    return [(lane, leader, 24.0), (lane, np.array(own), 0.0)]


def stopping(rng: np.random.Generator, arm: int, wait: float) -> Drive:
    """A car that stops at a four-way stop and goes straight on when its turn has come, a later one from the arm to the right."""
    turned = np.array([[0.0, -1.0], [1.0, 0.0]])
    along = np.array([(-70.0, -1.75), (70.0, -1.75)])
    for _ in range(arm):
        along = along @ turned.T
    stands = 6.0 + 0.4 * arm
    goes = stands + wait
    knots = (0.0, 8.5), (2.5, 8.5), (stands, 0.0), (goes, 0.0), (goes + 4.0, 8.0), (18.0, 9.0)
    path = way(*map(tuple, along))
    speed = speeds(rng, 18.0, *knots)
    stop = float(np.sum(speed[: round((stands + 0.3) / DT)]) * DT)
    return path, speed, 61.0 - stop


if __name__ == "__main__":
    main()

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Drawn recordings at a junction with traffic lights."""

import numpy as np
import pandas as pd

DT = 0.1
COLUMNS = ["vehicle", "time", "x", "y", "speed", "heading", "signal", "signal_id"]


def stopping(t, stop, departs, speed=11.0):
    """Return speeds [m/s] that end at `stop` [s] at 2.2 m/s² and begin again at `departs` [s]."""
    braking = np.clip(2.2 * (stop - t), 0.0, speed)
    return np.where(t < departs, braking, np.clip(1.8 * (t - departs), 0.0, speed))


def signalised(green=13.0, lag=1.4, queue=1, lights=True):
    """Return a table: vehicle 1 crosses at green, 2 and a queue stop at red on the other road.

    Args:
        green: seconds at which the light of the queue turns green.
        lag: seconds until vehicle 2 departs; each further vehicle departs 1.5 s later.
        queue: number of vehicles that stop.
        lights: whether the states are recorded.
    """
    t = np.arange(0.0, green + lag + 12.0, DT)
    rows = []

    def add(name, along, speed, eastward, states, light):
        front = along + 2.4
        for k in np.flatnonzero(np.abs(along) < 85.0):
            seen = lights and front[k] < -8.0
            place = (along[k], -1.75, 0.0) if eastward else (1.75, along[k], np.pi / 2.0)
            state = states(t[k]) if seen else ""
            rows.append(
                (name, t[k].round(2), *place[:2], speed[k], place[2], state, light if seen else "")
            )

    def of_1(time):
        return "green" if time < green - 5.0 else "yellow" if time < green - 2.0 else "red"

    add("1", 12.0 * (t - green + 7.0), np.full(len(t), 12.0), True, of_1, "A")
    for n in range(queue):
        departs = green + lag + 1.5 * n
        speed = stopping(t, 5.5 + 1.5 * n, departs)
        driven = np.concatenate([[0.0], np.cumsum(0.5 * DT * (speed[1:] + speed[:-1]))])
        along = driven - np.interp(departs, t, driven) - 11.4 - 7.0 * n
        add(str(2 + n), along, speed, False, lambda s: "red" if s < green else "green", "B")
    return pd.DataFrame(rows, columns=COLUMNS)


def crossing_map(cycles, stamps="", queue=1, end=-8.0):
    """Return a CommonRoad file with two crossing lanes, their lights, and two vehicles.

    Args:
        cycles: states of the two lights, each with its steps of 0.1 s, as in `"green:120 red:80"`.
        stamps: further elements of each light.
        queue: as in `signalised`.
        end: where the lanes end [m]; the queue stands 1 m before -8.
    """
    lanes, lights, cars = [], [], []
    for k, (ahead, left) in enumerate([((1, 0), (0, 1)), ((0, 1), (-1, 0))]):

        def points(side, ahead=ahead, left=left):
            ends = [np.multiply(ahead, s) + 1.75 * side * np.array(left) for s in (-80, end)]
            return "".join(f"<point><x>{x}</x><y>{y}</y></point>" for x, y in ends)

        lanes.append(
            f'<lanelet id="{k + 1}"><leftBound>{points(1)}</leftBound><rightBound>{points(-1)}'
            f'</rightBound><laneletType>urban</laneletType><trafficLightRef ref="{11 + k}"/></lanelet>'
        )
    for k, cycle in enumerate(cycles):
        elements = (part.split(":") for part in cycle.split())
        texts = (
            f"<cycleElement><duration>{n}</duration><color>{state}</color></cycleElement>"
            for state, n in elements
        )
        lights.append(
            f'<trafficLight id="{11 + k}"><cycle>{"".join(texts)}{stamps}</cycle></trafficLight>'
        )
    table = signalised(lights=False, queue=queue)
    for vehicle, rows in table.groupby("vehicle"):
        states = [
            f"<position><point><x>{x}</x><y>{y}</y></point></position><orientation><exact>{yaw}"
            f"</exact></orientation><time><exact>{round(t * 10)}</exact></time><velocity><exact>"
            f"{v}</exact></velocity>"
            for _, _, t, x, y, v, yaw, _, _ in rows.itertuples()
        ]
        trajectory = "".join(f"<state>{state}</state>" for state in states[1:])
        cars.append(
            f'<dynamicObstacle id="{100 + int(vehicle)}"><type>car</type><shape><rectangle>'
            "<length>4.8</length><width>1.9</width></rectangle></shape><initialState>"
            f"{states[0]}</initialState><trajectory>{trajectory}</trajectory></dynamicObstacle>"
        )
    body = "".join((*lanes, *lights, *cars))
    return f'<commonRoad commonRoadVersion="2020a" timeStepSize="0.1">{body}</commonRoad>'

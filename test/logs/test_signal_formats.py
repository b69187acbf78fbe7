# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""States of traffic lights in the files of other programs."""

import json
import re

import numpy as np
import pytest
from support.signalised import crossing_map, signalised

from scenario_gen import read_log
from scenario_gen.base.errors import InputError
from scenario_gen.roads import lights_of, read_network
from scenario_gen.situation import Situation
from scenario_gen.types import TrafficLight

GREEN = 13.0
NET = """<net version="1.16">
<edge id="west"><lane id="west_0" index="0" shape="-90,-1.75 -8,-1.75" width="3.5"/></edge>
<edge id="south"><lane id="south_0" index="0" shape="1.75,-90 1.75,-8" width="3.5"/></edge>
<tlLogic id="J" type="static" programID="0" offset="-2"><phase duration="10" state="Gr"/>
<phase duration="3" state="yr"/><phase duration="2" state="rr"/><phase duration="20" state="rG"/>
</tlLogic>
<connection from="west" to="east" fromLane="0" toLane="0" tl="J" linkIndex="0"/>
<connection from="south" to="north" fromLane="0" toLane="0" tl="J" linkIndex="1"/></net>"""


def letters(time):
    """The state of both links at a time of the drawn recording."""
    west = "G" if time < GREEN - 5.0 else "y" if time < GREEN - 2.0 else "r"
    return west + ("r" if time < GREEN else "G")


def sumo(folder):
    """Write the recording as SUMO's floating-car data; return the file."""
    steps = []
    for time, rows in signalised(GREEN).groupby("time"):
        cars = "".join(
            f'<vehicle id="{row.vehicle}" x="{row.x + 2.4 * np.cos(row.heading)}" '
            f'y="{row.y + 2.4 * np.sin(row.heading)}" angle="{90 - np.degrees(row.heading)}" '
            f'speed="{row.speed}" type="car"/>'
            for row in rows.itertuples()
        )
        steps.append(f'<timestep time="{time}">{cars}</timestep>')
    (folder / "fcd.xml").write_text(f"<fcd-export>{''.join(steps)}</fcd-export>")
    (folder / "net.xml").write_text(NET)
    states = "".join(
        f'<tlsState time="{t:.1f}" id="J" programID="0" phase="0" state="{letters(t)}"/>'
        for t in np.arange(0.0, 30.0, 0.1)
    )
    (folder / "tls.xml").write_text(f"<tlsStates>{states}</tlsStates>")
    return folder / "fcd.xml"


def scene(folder):
    """Write the recording as a scene of Nocturne; return the file."""
    table = signalised(GREEN)
    steps = range(round(table.time.max() * 10) + 1)
    objects = []
    for name, rows in table.groupby("vehicle"):
        states = {round(row.time * 10): row for row in rows.itertuples()}
        known = [states.get(k) for k in steps]
        objects.append(
            {
                "id": int(name),
                "type": "vehicle",
                "length": 4.8,
                "width": 1.9,
                "valid": [row is not None for row in known],
                "position": [
                    {"x": row.x, "y": row.y} if row else {"x": 0, "y": 0} for row in known
                ],
                "heading": [row.heading if row else 0.0 for row in known],
                "velocity": [
                    {"x": row.speed * np.cos(row.heading), "y": row.speed * np.sin(row.heading)}
                    if row
                    else {"x": 0, "y": 0}
                    for row in known
                ],
            }
        )
    words = {"G": "go", "y": "arrow_caution", "r": "stop"}
    lights = {
        lane: {
            "state": [words[letters(k / 10)[link]] for k in steps],
            "x": [x] * len(steps),
            "y": [y] * len(steps),
            "time_index": list(steps),
        }
        for link, (lane, x, y) in enumerate([("61", -8.0, -1.75), ("62", 1.75, -8.0)])
    }
    lights["63"] = lights["62"] | {"x": [900.0] * len(steps)}
    place = {"position": {axis: lights["62"].pop(axis) for axis in "xy"}}  # as in its own files
    lights["62"] |= place
    roads = [
        {"type": "lane", "geometry": [{"x": x, "y": y} for x, y in points]}
        for points in ([(-90, -1.75), (90, -1.75)], [(1.75, -90), (1.75, 90)])
    ]
    file = folder / "scene.json"
    file.write_text(json.dumps({"objects": objects, "tl_states": lights, "roads": roads}))
    return file


def check(encounter, names, also=()):
    """Check the states at 100 instants, and the stop lines."""
    lights = {light.id: light for light in encounter.lights}
    assert set(lights) == {*names, *also}
    start = encounter.start_ns * 1e-9 % 86_400.0
    start -= 43_200.0 if start > 40_000.0 else 0.0  # messages begin at noon
    words = {"G": "green", "y": "yellow", "r": "red"}
    for time in np.linspace(start, start + encounter.duration, 100) + 0.003:
        states = [words[letter] for letter in letters(time)]
        assert [lights[name].schedule.at(time - start) for name in names] == states
    crosses = [lights[name].crossing(encounter, n) for n, name in enumerate(names)]
    fronts = [encounter.of_vehicles([n]).at(np.array([t])) for n, t in enumerate(crosses)]
    place = [at.position[0, 0] + 2.4 * np.array([1 - k, k]) for k, at in enumerate(fronts)]
    middle = [lights[name].line.mean(axis=0) for name in names]
    np.testing.assert_allclose(place, middle, atol=0.1)
    widths = [np.hypot(*np.diff(lights[name].line, axis=0)[0]) for name in names]
    np.testing.assert_allclose(widths, 3.5, rtol=1e-4)
    assert [lights[name].yaw for name in names] == pytest.approx([0.0, np.pi / 2.0], abs=1e-4)


@pytest.mark.parametrize("recorded", [True, False])
def test_sumo(tmp_path, recorded):
    vehicles = sumo(tmp_path)
    assert read_log(vehicles).encounters[0].lights == ()
    files = [vehicles, tmp_path / "net.xml", *[tmp_path / "tls.xml"] * recorded]
    (encounter,) = read_log(files).encounters
    check(encounter, ["J/west_0", "J/south_0"])


def test_light_is_for_lane_and_movement(tmp_path):
    vehicles = sumo(tmp_path)
    link = (
        '<connection from="west" to="{}" fromLane="0" toLane="0" tl="J" linkIndex="{}" dir="{}"/>'
    )
    plain = link.format("east", 0, "s").replace(' dir="s"', "")
    both = link.format("east", 0, "s") + link.format("north", 2, "l")
    (tmp_path / "net.xml").write_text(NET.replace(plain, both))
    states = (tmp_path / "tls.xml").read_text()
    (tmp_path / "tls.xml").write_text(re.sub('state="(..)"', r'state="\1r"', states))
    (encounter,) = read_log([vehicles, tmp_path / "net.xml", tmp_path / "tls.xml"]).encounters
    check(encounter, ["J/west_0 straight", "J/south_0"], also=["J/west_0 left"])
    (left,) = [light for light in encounter.lights if light.turns == ("left",)]
    assert left.schedule.at(3.0) == "red" and np.isnan(left.crossing(encounter, 0))
    assert TrafficLight.of_document(left.document()).turns == ("left",)
    again = tmp_path / "map.xml"
    text = crossing_map(["green:80 yellow:30 red:290", "red:130 green:270"])
    again.write_text(
        text.replace("</trafficLight>", "<direction>leftStraight</direction></trafficLight>", 1)
    )
    (encounter,) = read_log(again).encounters
    assert [light.turns for light in encounter.lights] == [("left", "straight"), ()]
    network = read_network(again)
    assert [light.turns for light in lights_of(network)] == [("left", "straight"), ()]


def test_line_is_where_vehicles_stop(tmp_path):
    file = tmp_path / "map.xml"
    file.write_text(crossing_map(["green:80 yellow:30 red:290", "red:130 green:270"], "", 2, -20))
    result = read_log(file)
    (note,) = [note for note in result.quality.notes if "beyond the stop line" in note]
    assert note.startswith("vehicles 102, 103 stop at red 4.0 to 11.0 m beyond")
    (encounter,) = result.encounters
    middle = {light.id: light.line.mean(axis=0) for light in encounter.lights}
    np.testing.assert_allclose(middle["12"], [0.0, -8.5], atol=0.05)
    np.testing.assert_allclose(middle["11"], [-20.0, 0.0])
    stops = Situation.of(encounter).reactions.stops
    assert [(stop.who, stop.queue) for stop in stops] == [(1, 0), (2, 1)]


def test_sumo_without_states_or_net(tmp_path):
    vehicles = sumo(tmp_path)
    result = read_log([vehicles, tmp_path / "tls.xml"])
    assert "give the net (.net.xml), too" in "; ".join(result.quality.notes)
    net = tmp_path / "net.xml"
    net.write_text(NET.replace('"static"', '"actuated"'))
    result = read_log([vehicles, net])
    assert result.encounters[0].lights == ()
    assert "whose states are not known are left out: J" in "; ".join(result.quality.notes)
    net.write_text(NET.replace('state="Gr"', 'state="Gx"'))
    with pytest.raises(InputError, match=r"net\.xml, line 4, <phase>: signal state 'x'"):
        read_log([vehicles, net])
    with pytest.raises(InputError, match="has no vehicles; give the floating-car data"):
        read_log(tmp_path / "tls.xml")


def test_nocturne(tmp_path):
    result = read_log(scene(tmp_path))
    check(result.encounters[0], ["61", "62"])
    assert "traffic lights without a lane are left out: 63" in result.quality.notes

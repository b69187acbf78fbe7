# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The preview: frames and markers of every vehicle of the newest scenario, in a loop."""

from dataclasses import replace
import re

import numpy as np
import pytest
from support.bag_examples import hand_made_run

from msg_conventions.frames import decode_frames
from scenario_gen.bags.recordings.write import result_messages

TOPICS = ("scenarios", "scenarios/info", "fit")


def states(scenario, at):
    from scenario_gen.ros.nodes.preview import states_at

    return states_at(scenario, at)


def test_preview_states_are_the_scenario_s():
    scenario = replace(hand_made_run().generated[0], present=np.array([[0, 60], [20, 40]]))
    here, poses, speeds = states(scenario, 3.0)
    assert (
        here == [0, 1]
        and poses[0].tolist() == pytest.approx([15.0, -2.0, 0.0])
        and speeds.tolist() == [5.0, 6.0]
    )
    assert states(scenario, 1.0)[0] == states(scenario, 5.0)[0] == [0]


def test_conflicts_show_who_goes_first():
    from scenario_gen.ros.nodes.preview import conflicts_of

    run = hand_made_run().generated[0]
    late = np.stack([np.full(61, 15.0), np.linspace(-70.0, 10.0, 61)], axis=-1)
    crossing = replace(
        run,
        position=np.stack([run.position[0], late]),
        heading=np.stack([run.heading[0], np.full(61, np.pi / 2)]),
    )
    (((x, y, _), words),) = conflicts_of(crossing)
    first, second = run.vehicles
    assert x == pytest.approx(15.0)
    assert y + 0.5 * second.length == pytest.approx(
        run.position[0, 0, 1] - 0.5 * first.width, abs=0.1
    ), "its front at the path"
    assert re.fullmatch(r"1 first, bus_2 \d\.\d s later", words)


@pytest.mark.dds
def test_vehicles_move_on_tf_and_markers(start, client):
    client.hear("/tf", "preview")
    start("preview")
    run = hand_made_run()
    for topic in TOPICS:
        client.announce(topic)
    for topic, data, _ in result_messages(
        replace(run, generated=replace(run.generated, scenarios=run.generated.scenarios[:1]))
    ):
        if topic in TOPICS:
            client.say(topic, data)

    def moved() -> list[dict[str, np.ndarray]]:
        return [
            {child: pose for _, _, child, pose in decode_frames(data)}
            for data in list(client.heard["/tf"])
        ]

    def x() -> np.ndarray:
        return np.array([frames["preview/vehicle_1"][0] for frames in moved()])

    client.until(lambda: np.diff(x()).min(initial=0.0) < -20.0, "its end, and its start again")
    client.until(lambda: np.ptp(x()) == pytest.approx(30.0, abs=1.0), "all of its way")
    assert all(set(frames) == {"preview/vehicle_1", "preview/vehicle_bus_2"} for frames in moved())
    client.wait("preview")
    assert all(
        word in client.heard["preview"][-1]
        for word in (b"box_1", b"text_bus_2", b"changepoint_0_0", b"m/s")
    )

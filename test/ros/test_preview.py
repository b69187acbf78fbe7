# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The preview: frames and markers of every vehicle of the newest scenario, in a loop."""

from dataclasses import replace

import numpy as np
import pytest
from support.bag_examples import hand_made_run
from support.message_decoders import decode_frames

from scenario_gen.bags.recordings.write import result_messages

TOPICS = ("scenarios", "scenarios/info")


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
    assert all(word in client.heard["preview"][-1] for word in (b"box_1", b"box_bus_2"))

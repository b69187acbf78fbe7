# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The measures of the naturalness benchmark on motion whose answers are known."""

import numpy as np
import pytest

from benchmarks._naturalness_classifier import FEATURES, windows
from benchmarks._naturalness_cuts import cuts
from benchmarks._naturalness_motion import roughness, Signals


def drive(speed, turn=0.0, count=2):
    """`count` vehicles side by side at these speeds (T,) [m/s], turning by `turn` [degrees] in all."""
    time = 0.1 * np.arange(len(speed))
    heading = np.radians(turn) * np.linspace(0.0, 1.0, len(speed))
    way = np.stack([np.cos(heading), np.sin(heading)], axis=-1) * speed[:, None]
    place = np.concatenate([np.zeros((1, 2)), np.cumsum(0.05 * (way[1:] + way[:-1]), axis=0)])
    position = np.stack([place + np.array([0.0, 4.0 * n]) for n in range(count)])
    return Signals.of(
        {
            "time": time,
            "position": position,
            "heading": np.tile(heading, (count, 1)),
            "speed": np.tile(speed, (count, 1)),
        }
    )


def test_roughness_of_a_known_drive():
    time = 0.1 * np.arange(101)
    found = roughness(drive(8.0 + np.sin(time), turn=40.0))
    assert found["jerk"] == pytest.approx([1.0, 1.0], abs=0.02)  # its third derivative is as great
    assert found["acceleration"] == pytest.approx([1.0, 1.0], abs=0.02)
    assert found["extrema"].tolist() == [3.0, 3.0]  # of the sine's in 10 s
    assert found["yaw rate"] == pytest.approx(np.radians(4.0) * np.ones(2))
    assert found["lateral"] == pytest.approx(9.0 * np.radians(4.0) * np.ones(2), rel=0.01)
    staircase = roughness(drive(np.interp(time, [0, 5, 10], [5.0, 10.0, 5.0])))
    assert staircase["jerk"] == pytest.approx([20.0, 20.0])  # from 1 to -1 m/s² within 0.1 s


def test_windows_see_noise_and_nothing_else():
    time = 0.1 * np.arange(101)
    rng = np.random.default_rng(0)
    calm, rough = drive(8.0 + np.sin(time)), drive(8.0 + np.sin(time) + rng.normal(0.0, 0.05, 101))
    assert windows(calm).shape == (2 * 8, len(FEATURES))
    column = FEATURES.index("acceleration: high frequencies")
    assert (windows(rough)[:, column] > 5.0 * windows(calm)[:, column]).all()
    lateral = [k for k, name in enumerate(FEATURES) if name.startswith(("yaw", "lateral"))]
    assert not windows(rough)[:, lateral].any()


def test_the_list_of_cuts_is_whole_and_its_last_third_is_apart():
    shown, held = cuts()
    assert len(held) == (len(shown) + len(held)) // 3 and not {c.name for c in shown} & {
        c.name for c in held
    }
    times = [
        (file, vehicle, cut.start, cut.end)
        for cut in (*shown, *held)
        for file in cut.files
        for vehicle in cut.vehicles
    ]
    for k, (file, vehicle, start, end) in enumerate(times):
        for other, name, begin, until in times[:k]:
            assert (file, vehicle) != (other, name) or end <= begin or until <= start, (
                file,
                vehicle,
                start,
            )

# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Changepoints while samples arrive."""

import numpy as np
import pytest

from scenario_gen.errors import InputError
from scenario_gen.segmentation import OnlineSegmenter


def found_in(encounter):
    online = OnlineSegmenter(len(encounter.vehicles), encounter.dt)
    return [c for t in range(len(encounter.time)) for c in online.push(encounter.position[:, t], encounter.speed[:, t])]


def test_finds_changes_soon_after_them(encounter_of):
    t = np.arange(400) * 0.1
    speeds = np.array([np.full(400, 8.0), np.interp(t, [0, 10, 15, 25, 30, 40], [10, 10, 2, 2, 12, 12])])
    found = found_in(encounter_of(speeds, noise=0.1, seed=3))
    assert [round(c.sample / 50) * 50 for c in found] == [100, 150, 250, 300]
    assert max(abs(c.sample - truth) for c, truth in zip(found, [100, 150, 250, 300], strict=True)) <= 4
    assert max(c.confirmed - truth for c, truth in zip(found, [100, 150, 250, 300], strict=True)) <= 15


def test_steady_noise_gives_nothing(encounter_of):
    assert found_in(encounter_of(np.full((3, 600), 9.0), noise=0.1, seed=4)) == []


def test_memory_is_bounded():
    online = OnlineSegmenter(2, 0.1)
    for t in range(2000):
        online.push(np.array([[t * 0.8, 0.0], [0.0, 5.0]]), np.array([8.0, 0.0]))
    assert len(online._samples) <= 300


@pytest.mark.parametrize("bad", [(np.zeros((2, 2)), np.array([1.0, np.nan])), (np.zeros((3, 2)), np.zeros(3))])
def test_refuses_bad_samples(bad):
    with pytest.raises(InputError, match="sample 0"):
        OnlineSegmenter(2, 0.1).push(*bad)

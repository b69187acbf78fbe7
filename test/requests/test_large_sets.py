# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Large sets: indices for any number of candidates, figures of a part."""

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from support.given import answer

from scenario_gen.method.evaluation.evaluate import measured, MEASURED_SCENARIOS
from scenario_gen.method.sampling import sampler
from scenario_gen.method.sampling.sampler import (
    BLOCK_CANDIDATES,
    index_of,
    LEVELS,
    place_of,
)
from scenario_gen.types.request import Request


def made(chain, count):
    return answer(chain, Request(), count=count).generated


@given(st.integers(0, len(LEVELS) - 1), st.integers(0, 1 << 40))
def test_index_is_wide_enough(level, candidate):
    index = index_of(level, candidate)
    assert place_of(index) == (level, candidate) and index < 1 << 63


def test_level_has_unlimited_candidates(chain, monkeypatch):
    """Beyond LEVEL_CANDIDATES candidates numbering goes on behind the last level, and each one can be had again."""
    plain = made(chain, 200)
    monkeypatch.setattr(sampler, "LEVEL_CANDIDATES", 2 * BLOCK_CANDIDATES)
    beyond = made(chain, 200)
    assert len(beyond.scenarios) == 200
    assert len({s.index for s in beyond.scenarios}) == 200
    assert max(s.index for s in beyond.scenarios) >= sampler.INDEX_LEVELS * 2 * BLOCK_CANDIDATES
    assert all(
        a.position.tobytes() == b.position.tobytes()
        for a, b in zip(plain.scenarios, beyond.scenarios, strict=True)
    )


@given(st.integers(MEASURED_SCENARIOS + 1, 10**12))
def test_large_sets_are_measured_evenly(size):
    taken = np.array(measured(range(size)))
    assert len(taken) == len(set(taken)) == MEASURED_SCENARIOS
    assert taken[0] == 0 and taken[-1] == size - 1
    steps = Counter(np.diff(taken).tolist())
    assert steps[1] >= MEASURED_SCENARIOS - 20
    gaps = [step for step in steps if step != 1]
    assert not gaps or max(gaps) - min(gaps) <= 1

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The next proposal of the search for rare figures lies where valid candidates are."""

import numpy as np

from scenario_gen.method.sampling.cross_entropy import Evaluations, Stage
from scenario_gen.method.sampling.sampler import TargetSet


def test_proposal_prefers_valid_candidates():
    """Of two clusters at z = ±2, the invalid one is nearer to the range, by less than 1 unit."""
    rng = np.random.Generator(np.random.PCG64(4))
    is_valid = np.arange(40) < 20
    z = rng.normal(0.0, 0.3, (40, 3))
    z[:, 0] += np.where(is_valid, 2.0, -2.0)
    distance = np.where(is_valid, 0.5, 0.1)
    stage = Stage(z, None, z[:, :1], z[:, :1], distance, is_valid)
    proposal = Evaluations(TargetSet((), (), lambda *_: 0.0), [stage]).proposal()
    assert proposal is not None
    assert (proposal.mean @ proposal.basis)[0] > 1.5

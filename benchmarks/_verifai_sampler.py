# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A sampler of VerifAI as a process: it writes points of the unit cube, and reads how near to a failure each was.

It runs in an environment of its own, whose NumPy is another one: `_verifai_sampler.py ce|bo DIMENSIONS SEED THRESHOLD`.
"""

import json
import sys

from dotmap import DotMap
import numpy as np
from verifai.features import Box, Feature, FeatureSpace
from verifai.samplers.feature_sampler import FeatureSampler


def main(kind: str, dimensions: int, seed: int, threshold: float) -> None:
    """Write a point a line; after each read its margin, or null where it gave no scenario."""
    np.random.seed(seed)  # noqa: NPY002 - what VerifAI draws from
    space = FeatureSpace({"u": Feature(Box(*[[0.0, 1.0]] * dimensions))})
    if kind == "ce":
        cross_entropy = DotMap(alpha=0.9, thres=threshold)  # the alpha of VerifAI's examples
        cross_entropy.cont.buckets, cross_entropy.cont.dist, cross_entropy.disc.dist = (
            5,
            None,
            None,
        )
        sampler = FeatureSampler.crossEntropySamplerFor(space, cross_entropy)
    else:
        sampler = FeatureSampler.bayesianOptimizationSamplerFor(
            space, BO_params=DotMap(init_num=5)
        )
    out = sys.stdout
    sys.stdout = sys.stderr  # GPyOpt writes there
    margin = None
    while True:
        point = sampler.nextSample(margin)
        print(json.dumps([float(u) for u in point.u]), file=out, flush=True)
        line = sys.stdin.readline()
        if not line:
            return
        margin = json.loads(line)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]))

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A template on a road by a chain of peers: jax-moseq, OMPL, scikit-learn's Gaussian processes.

The chain is spared what a batch's task does besides: the fit to the road, checks, evaluation. It is told by us where to plan
from and to, and its candidates go unchecked. jax-moseq runs as many sweeps as our three chains ran, on the same features,
compilation not counted; OMPL's RRTConnect takes its first path between neighbouring anchors, with our compiled check of
edges; each vehicle has one Gaussian process across its route and one of its speed, with fixed hyperparameters.
"""

from collections.abc import Sequence
from itertools import pairwise
from time import process_time
import warnings

import numpy as np

from benchmarks._segmentation_peers import installed, jax_moseq, posterior_of, sweeps_run
from scenario_gen.method.chain import Chain
from scenario_gen.method.config import PipelineConfig
from scenario_gen.method.segmentation import segment
from scenario_gen.roads import build_road
from scenario_gen.situation import Situation
from scenario_gen.types.encounter import Encounter
from scenario_gen.types.road import Road
from scenario_gen.types.route import Route
from scenario_gen.types.scenario import ScenarioSet

PEERS = ("jax_moseq", "ompl", "sklearn")
ACROSS, SPEED, NOISE = (
    (0.5, 20.0),
    (1.0, 3.0),
    0.1,
)  # (standard deviation [m, m/s], length [m, s]); m or m/s


def missing() -> list[str]:
    """Return which peers are not installed."""
    return [name for name in PEERS if not installed(name)]


def costs(encounter: Encounter, name: str, count: int, seed: int) -> dict[str, float]:
    """Return CPU seconds of a template on a road: ours, and of each peer.

    Args:
        encounter: the template.
        name: of the road.
        count: scenarios.
        seed: of ours.

    Raises:
        RefusedError: the template has no place on the road.
    """
    config = PipelineConfig()
    begun = process_time()
    road = build_road(name, encounter, config.road)
    made = Chain(
        Situation.of(encounter),
        segment(encounter, config.segmentation, seed),
        road,
        config,
        count=count,
        seed=seed,
    ).run()
    found = {"ours": process_time() - begun}
    features, posterior = posterior_of(encounter, config.segmentation, seed)
    jitter = 1e-6 * np.random.default_rng(0).standard_normal(features.shape)
    moseq = jax_moseq(features + jitter, sweeps_run(posterior))
    assert moseq is not None
    found["jax-moseq"] = moseq.seconds
    begun = process_time()
    for route in made.routes:
        _plan(road, route)
    found["OMPL"] = process_time() - begun
    begun = process_time()
    _sample(made.generated, made.routes, count)
    found["scikit-learn"] = process_time() - begun
    return found


def _plan(road: Road, route: Route) -> None:
    """OMPL's first path between neighbouring anchors of a route."""
    from benchmarks.planning import _ompl
    from scenario_gen.roads.clearance import to_cells

    places = to_cells(road, route.points[route.anchor, :2])
    for ends in pairwise(places):
        if (ends[0] != ends[1]).any():
            _ompl(road, np.array(ends), "ompl_rrt_connect", 10.0, first=True)


def _sample(generated: ScenarioSet, routes: Sequence[Route], count: int) -> None:
    """Fit scikit-learn's regressors to each vehicle's route and speeds, and draw as many samples as there are scenarios."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, RBF

    scenario = generated.scenarios[0]
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore"
        )  # its sampler complains of a covariance that is not quite positive
        for route, speed in zip(routes, scenario.speed, strict=True):
            across = np.zeros(len(route.length))
            for x, y, at, (sigma, length) in (
                (
                    route.length,
                    across,
                    np.linspace(0.0, route.length[-1], len(scenario.time)),
                    ACROSS,
                ),
                (scenario.time, speed, scenario.time, SPEED),
            ):
                kernel = ConstantKernel(sigma**2, "fixed") * RBF(length, "fixed")
                fitted = GaussianProcessRegressor(kernel, alpha=NOISE**2, optimizer=None).fit(
                    np.asarray(x)[:, None], y
                )
                fitted.sample_y(np.asarray(at)[:, None], count)

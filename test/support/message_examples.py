# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Domain values for the tests, drawn by hypothesis."""

from hypothesis import strategies as st
import numpy as np

from msg_conventions import roads
from scenario_gen.numerics import arc_lengths
from scenario_gen.types import Encounter, LaneNetwork, Road, Vehicle
from scenario_gen.types.fit import Route, Segmentation
from scenario_gen.types.scenario import Scenario

NASTY_HEADINGS = (
    0.0,
    np.pi,
    -np.pi,
    np.pi - 1e-10,
    -np.pi + 4e-10,
    3.0 * np.pi,
    -5.0 * np.pi,
    0.5 * np.pi,
    1e-10,
)


def generator(seed: int) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(seed))


def headings(rng: np.random.Generator, n: int, t: int) -> np.ndarray:
    values = np.cumsum(rng.normal(0.0, 0.5, (n, t)), axis=1)
    values[:, :: max(1, t // 7)] = rng.choice(NASTY_HEADINGS, values[:, :: max(1, t // 7)].shape)
    return values


def encounter(seed: int, n: int = 3, t: int = 40) -> Encounter:
    rng = generator(seed)
    return Encounter.sampled(
        tuple(Vehicle(f"car_{k}" if k else "7", 4.0 + k / 3, 1.9) for k in range(n)),
        0.1,
        rng.normal(0.0, 100.0, (n, t, 2)),
        headings(rng, n, t),
        np.abs(rng.normal(0.0, 10.0, (n, t))),
        name="tracks",
        start_ns=int(rng.integers(0, 2**31)) * 1_000_000_000 + int(rng.integers(0, 1_000_000_000)),
    )


def segmentation(seed: int, t: int = 40, k: int = 3) -> Segmentation:
    rng = generator(seed)
    at = np.sort(rng.choice(np.arange(1, t), k, replace=False))
    order = np.array([0, 1, 0, 2])[: k + 1]
    labels = order[np.searchsorted(at, np.arange(t), side="right")]
    return Segmentation(labels, at, rng.random(t), tuple(f"segment {i}" for i in range(k + 1)))


def scenario(seed: int, n: int = 2, t: int = 57) -> Scenario:
    rng = generator(seed)
    return Scenario(
        vehicles=tuple(Vehicle(f"v{k}", 4.8, 1.9 + k / 7) for k in range(n)),
        time=np.arange(t) * 0.1,
        position=rng.normal(0.0, 100.0, (n, t, 2)),
        heading=headings(rng, n, t),
        speed=np.abs(rng.normal(0.0, 10.0, (n, t))),
        acceleration=rng.normal(0.0, 1.0, (n, t)),
        frame_id="map" if seed % 2 else "a_longer_frame",
    )


def route(seed: int) -> Route:
    """Five anchors: drives, dwells twice in a row, drives."""
    rng = generator(seed)
    points = np.column_stack(
        [np.cumsum(rng.uniform(0.1, 0.5, 30)), rng.normal(0.0, 0.1, 30), headings(rng, 1, 30)[0]]
    )
    return Route(
        points=points, anchor=np.array([0, 12, 12, 12, 29]), length=arc_lengths(points[:, :2])
    )


seeds = st.integers(0, 2**32 - 1)


def assert_same(one: object, other: object, *names: str) -> None:
    """The named attributes are equal bit for bit."""
    for name in names:
        left, right = getattr(one, name), getattr(other, name)
        if isinstance(left, np.ndarray):
            assert left.tobytes() == right.tobytes(), name
        else:
            assert left == right, name


def road_with(network: LaneNetwork) -> Road:
    """Return a small road with these lanes."""
    ends = np.zeros((0, 3))
    return Road("map", np.ones((2, 2), dtype=bool), 0.5, np.zeros(2), ends, ends, lanes=network)


def lanes_again(network: LaneNetwork) -> LaneNetwork:
    """Return lanes as they arrive on `road/lanes`."""
    road = road_with(network)
    grid = roads.encode_map(road, 1)
    _, again = roads.decode_map(grid, roads.encode_description(road, grid, 1))
    assert again.lanes is not None
    return again.lanes

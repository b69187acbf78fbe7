# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Maps of the planning benchmark, the true optimum on them, and a rasteriser that shares no code with the planner."""

import itertools
from pathlib import Path

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from scenario_gen.numerics.arrays import Bools, Floats
from scenario_gen.types.road import Road

NOWHERE = np.empty((0, 3))
SIZE = 1000


def road_of(name: str, drivable: Bools, resolution: float = 1.0) -> Road:
    """A grid without entries and exits, its corner at the origin."""
    return Road(name, drivable, resolution, np.zeros(2), NOWHERE, NOWHERE)


def lane() -> tuple[Road, Floats]:
    """A straight lane, 100 cells wide, and start and goal (2, 2)."""
    drivable = np.zeros((SIZE, SIZE), dtype=bool)
    drivable[450:550] = True
    return road_of("lane", drivable), np.array([[20.5, 470.5], [980.5, 530.5]])


def t_intersection() -> tuple[Road, Floats]:
    """A T-intersection of two roads 100 cells wide; from the west arm to the south arm."""
    drivable = np.zeros((SIZE, SIZE), dtype=bool)
    drivable[450:550] = True
    drivable[:500, 450:550] = True
    return road_of("T", drivable), np.array([[20.5, 520.5], [520.5, 20.5]])


def clutter(seed: int = 0, rectangles: int = 70) -> tuple[Road, Floats]:
    """Random rectangles, 20 to 120 cells a side; from corner to corner."""
    rng = np.random.default_rng(seed)
    drivable = np.ones((SIZE, SIZE), dtype=bool)
    for _ in range(rectangles):
        x, y = rng.integers(0, 900, 2)
        width, height = rng.integers(20, 120, 2)
        drivable[y : y + height, x : x + width] = False
    drivable[:25, :25] = drivable[-25:, -25:] = True
    return road_of("clutter", drivable), np.array([[10.5, 10.5], [990.5, 990.5]])


def optimum(road: Road, ends: Floats) -> float:
    """Length of the shortest path for a point [cells]: Dijkstra on the exact visibility graph.

    A shortest path bends only at convex corners of obstacles; coordinates are doubled, so that all arithmetic is in whole
    numbers and exact. A path may touch obstacles (the infimum over the open space).
    """
    blocked = ~road.drivable
    padded = np.pad(blocked, 1, constant_values=True)
    around = np.stack([padded[:-1, :-1], padded[:-1, 1:], padded[1:, :-1], padded[1:, 1:]])
    row, column = np.nonzero(around.sum(axis=0) == 1)
    points = np.concatenate(
        [np.round(2 * ends).astype(np.int64), 2 * np.column_stack((column, row))]
    )
    a, b = np.triu_indices(len(points), k=1)
    seen = _visible(blocked, points[a], points[b])
    a, b = a[seen], b[seen]
    length = np.hypot(*(points[a] - points[b]).T) / 2.0
    graph = coo_array((length, (a, b)), shape=(len(points), len(points)))
    return float(dijkstra(graph.tocsr(), directed=False, indices=0)[1])


def _visible(blocked: Bools, a: np.ndarray, b: np.ndarray) -> Bools:
    """Whether segments a-b (P, 2), in half cells, miss the inside of every blocked cell; exact."""
    free = np.ones(len(a), dtype=bool)
    steep = np.abs((b - a)[:, 1]) > np.abs((b - a)[:, 0])
    for along, grid in (
        (~steep, blocked),
        (steep, blocked.T),
    ):  # walk along the longer side, column by column
        index = np.nonzero(along)[0]
        p, q = (a[index], b[index]) if grid is blocked else (a[index][:, ::-1], b[index][:, ::-1])
        swap = p[:, 0] > q[:, 0]
        p, q = np.where(swap[:, None], q, p), np.where(swap[:, None], p, q)
        until = np.vstack([np.zeros((1, grid.shape[1]), dtype=np.int64), np.cumsum(grid, axis=0)])
        dx, dy = (q - p).T
        good = np.ones(len(p), dtype=bool)
        for j in range(grid.shape[1]):
            left, right = np.maximum(p[:, 0], 2 * j), np.minimum(q[:, 0], 2 * j + 2)
            k = np.nonzero(good & (left < right))[0]
            y0, y1 = (
                p[k, 1] * dx[k] + dy[k] * (x[k] - p[k, 0]) for x in (left, right)
            )  # times dx
            low, high = np.minimum(y0, y1) // (2 * dx[k]), -(-np.maximum(y0, y1) // (2 * dx[k]))
            good[k] = until[high, j] - until[np.minimum(low, high), j] == 0
        free[index] = good
    return free


def enters_blocked(drivable: Bools, path: Floats) -> bool:
    """Whether a path (P, 2) [cells] enters the inside of a cell that is not drivable; exact rational arithmetic on floats."""
    height, width = drivable.shape
    scale = 1 << 1074  # every float is a whole multiple of 2^-1074
    whole = [
        [n * (scale // d) for n, d in (float(x).as_integer_ratio() for x in point)]
        for point in path
    ]
    for p, q in itertools.pairwise(whole):
        steep = abs(q[1] - p[1]) > abs(q[0] - p[0])
        (ax, ay), (bx, by) = (p[::-1], q[::-1]) if steep else (p, q)
        if ax > bx:
            ax, ay, bx, by = bx, by, ax, ay
        dx, dy = bx - ax, by - ay
        if dx == 0:
            continue
        for column in range(ax // scale, -(-bx // scale)):
            left, right = max(ax, column * scale), min(bx, (column + 1) * scale)
            y0, y1 = (ay * dx + dy * (x - ax) for x in (left, right))
            for row in range(min(y0, y1) // (dx * scale), -(-max(y0, y1) // (dx * scale))):
                i, j = (column, row) if steep else (row, column)
                if not (0 <= i < height and 0 <= j < width and drivable[i, j]):
                    return True
    return False


def recorded_maps(folder: Path) -> list[Road]:
    """The occupancy grids in a folder of nav2 map_server files (trinary; only what is free is drivable)."""
    from PIL import Image
    import yaml

    roads = []
    for path in sorted(folder.glob("*.yaml")):
        meta = yaml.safe_load(path.read_text())
        pixels = np.asarray(Image.open(path.parent / meta["image"]))
        drivable = np.flipud((255.0 - pixels) / 255.0 < meta["free_thresh"])
        roads.append(
            Road(
                path.stem,
                drivable,
                meta["resolution"],
                np.array(meta["origin"][:2]),
                NOWHERE,
                NOWHERE,
            )
        )
    return roads

"""Runs of ticks."""

import numpy as np

from scenario_gen.arrays import Bools


def runs(flags: Bools, bridge: int = 0) -> list[tuple[int, int]]:
    """Begin and end (exclusive) of each run of True, joined over at most `bridge` False."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    joined: list[tuple[int, int]] = []
    for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if joined and begin - joined[-1][1] <= bridge:
            joined[-1] = (joined[-1][0], end)
        else:
            joined.append((begin, end))
    return joined

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The readers of vector maps as targets, one per format, and the decoder of their lanes in a bag."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
import random
import re

from fuzzing.harness import Target
from fuzzing.mutators import BYTES, NUMBERS, TEXT, tree
from fuzzing.targets_bags import in_file
import numpy as np
from support.map_builders import FORMATS
from support.message_examples import road_with

from msg_conventions.roads import decode_description, encode_description
from scenario_gen.logs import read_log
from scenario_gen.logs.synthetic import bundled
from scenario_gen.roads import build_road
from scenario_gen.types.lanes import Lane, LaneNetwork


def written(suffix: str, _folder: Path) -> list[bytes]:
    """A crossroads, an element a line."""
    return [FORMATS[suffix]().replace("><", ">\n<").encode()]


def attributes(rng: random.Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Change or drop numbers and attributes: one, a few, or all of one name; or exchange two values."""
    found = list(re.finditer(rb' ([\w:]+)="([^"]*)"', data))
    if len(found) < 2:
        return rng.choice(BYTES)(rng, data, seeds)
    word = rng.choice((*NUMBERS, "1e7", "1e8")).encode("utf-8", "surrogatepass").replace(b'"', b"")
    one = rng.choice(found)
    match rng.randrange(5):
        case 0:
            chosen = [one]
        case 1:
            chosen = rng.sample(found, min(len(found), rng.choice((2, 5, 30))))
        case 2:
            chosen = [each for each in found if each[1] == one[1]]
        case 3:
            return data[: one.start()] + data[one.end() :]
        case _:
            chosen, word = [one], rng.choice(found)[2]
    for each in sorted(chosen, key=lambda each: -each.start()):
        data = data[: each.start(2)] + word + data[each.end(2) :]
    return data


@cache
def template() -> object:
    """An encounter that is laid on what was read: six seconds of two cars, for which there is place."""
    return read_log([bundled("b")]).encounters[0].between(0, 60)


def place(path: Path) -> None:
    """Read a map, and look for the template's place on it."""
    build_road(str(path), template())


def lanes() -> list[bytes]:
    """Lanes as a bag has them."""
    border = np.column_stack((np.arange(3.0), np.zeros(3)))
    first = Lane("7", border + 1.0, border, (1,))
    network = LaneNetwork("m", (first, Lane("8", border + 1.0, border, (), (0,), 13.9, "j")))
    road = road_with(network)
    return [encode_description(each, b"", 5) for each in (road, replace(road, lanes=None))]


MAP = (*TEXT, *[attributes] * 8, *[tree] * 6)
TARGETS = (
    *(
        Target(
            f"vector_map_{suffix[1:]}", partial(written, suffix), in_file(f"a{suffix}", place), MAP
        )
        for suffix in (".osm", ".xodr", ".xml")
    ),
    Target(
        "message_lanes",
        lambda _: lanes(),
        lambda data, _: decode_description(data),
        BYTES,
    ),
)

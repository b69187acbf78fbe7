# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Ways to damage an input: bytes of any format, cells of a table in text, elements of XML."""

from collections.abc import Callable, Sequence
import copy
import math
import random
import re
import struct
from xml.etree import ElementTree

TEXTS = """nan NaN inf -inf 1e308 -1e308 1e-320 -0 0 1 -1 None null NA True false 9223372036854775807 9223372036854775808
    -9223372036854775809 18446744073709551616 1e400 0x10 1_000 1,5 12:30:05 2024-02-30 9999-12-31 0001-01-01T00:00:00Z
    2024-05-01T12:00:00+02:00 1700000000000 1700000000 １２ \u0660 é \ud7ff \u202e \x1b[31m \" \"\" ' a,b =1+1 \\ \U0001f697"""
NUMBERS = (*re.split(r"\s+", TEXTS), "", " ", "a\tb", "1" * 400, "x" * 3000)
WORDS = (
    *(text.encode("utf-8", "surrogatepass") for text in NUMBERS),
    *(
        b"\x00",
        b"\x00" * 8,
        b"\xff" * 8,
        b"\xef\xbb\xbf",
        b"\xff\xfe",
        *(bytes([k]) for k in b"\n\r,;#"),
    ),
    *(struct.pack("<d", value) for value in (math.nan, math.inf, 1e308, -0.0, 5e-324)),
    *(struct.pack("<q", value) for value in (-(2**63), 2**63 - 1, 2**31, 2**32 - 1)),
)


def flip(rng: random.Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Change a few bits or bytes."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4, 16, 64))):
        if out:
            at = rng.randrange(len(out))
            out[at] = rng.choice((out[at] ^ (1 << rng.randrange(8)), rng.randrange(256), 0, 255))
    return bytes(out)


def cut(rng: random.Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Cut off the end, or a piece out of the middle."""
    if not data:
        return data
    at = rng.randrange(len(data))
    size = rng.choice((1, 2, 4, 8, rng.randrange(len(data)) + 1, len(data), len(data), len(data)))
    return data[:at] + data[at + size :]


def splice(rng: random.Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Put a piece of a seed, or of itself, somewhere."""
    other = rng.choice((data, rng.choice(seeds)))
    if not other or not data:
        return other
    begin, at = rng.randrange(len(other)), rng.randrange(len(data))
    piece = other[begin : begin + rng.choice((1, 4, 16, 64, 256, 1024, 4096))]
    return data[:at] + piece + data[at + (len(piece) if rng.random() < 0.7 else 0) :]


def token(rng: random.Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Write or insert a word that readers know."""
    word, at = rng.choice(WORDS), rng.randrange(len(data) + 1)
    return data[:at] + word + data[at + (len(word) if rng.random() < 0.7 else 0) :]


def integer(rng: random.Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Write an extreme length or number of 1, 2, 4 or 8 bytes, or one near the one that is there."""
    size = rng.choice((1, 2, 4, 8))
    if len(data) < size:
        return data
    at, order = rng.randrange(len(data) - size + 1), rng.choice(("little", "big"))
    there = int.from_bytes(data[at : at + size], order)
    top = 1 << 8 * size
    extremes = (0, 1, top - 1, top // 2, top // 2 - 1, rng.randrange(top))
    value = rng.choice((*extremes, there + 1, there - 1, there * 2, there << 8)) % top
    return data[:at] + value.to_bytes(size, order) + data[at + size :]


BYTES = (flip, cut, splice, token, integer)


def cells(rng: random.Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Write words into cells: one, some or all of a column, or the header; scale or shift numbers."""
    table = [line.split(b",") for line in data.split(b"\n")]
    full = [k for k, row in enumerate(table) if len(row) > 1]
    if not full:
        return token(rng, data, seeds)
    column = rng.randrange(len(table[full[0]]))
    one, some = [rng.choice(full)], rng.sample(full, max(len(full) // 3, 1))
    rows = rng.choice((one, one, one, full[1:], some, full[:1]))
    word = rng.choice(NUMBERS).encode("utf-8", "surrogatepass")
    factor = rng.choice((0.0, -1.0, 1e-9, 1e-3, 10.0, 1e3, 1e6, 1e9, 1e300, 1.0000001))
    written: Callable[[bytes], bytes] = lambda _: word  # noqa: E731
    multiplied: Callable[[bytes], bytes] = lambda cell: scaled(cell, factor, 0.0)  # noqa: E731
    shifted: Callable[[bytes], bytes] = lambda cell: scaled(cell, 1.0, factor)  # noqa: E731
    change = rng.choice((written, written, multiplied, shifted))
    for k in rows:
        if column < len(table[k]):
            table[k][column] = change(table[k][column])
    return b"\n".join(b",".join(row) for row in table)


def scaled(cell: bytes, factor: float, shift: float) -> bytes:
    """Return a cell with its number multiplied and shifted; other cells as they are."""
    try:
        return repr(float(cell) * factor + shift).encode()
    except ValueError:
        return cell


TEXT = (*BYTES, *[cells] * 3)


def tree(rng: random.Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Move, repeat, drop, empty, rename or exchange elements of an XML tree; move or drop attributes."""
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError):
        return rng.choice(BYTES)(rng, data, seeds)
    pairs = [(parent, child) for parent in root.iter() for child in parent]
    if not pairs:
        return rng.choice(BYTES)(rng, data, seeds)
    for _ in range(rng.choice((1, 1, 2, 5))):
        (parent, child), (_, other) = rng.choice(pairs), rng.choice(pairs)
        copied = copy.deepcopy(other)  # so that no element comes to lie in itself
        match rng.randrange(8):
            case 0:
                parent.insert(rng.randrange(len(parent) + 1), copied)
            case 1:
                parent[:] = [each for each in parent if each is not child]
            case 2:
                child[:] = list(copied)
            case 3:
                child.tag = rng.choice((other.tag, "x"))
            case 4:
                child.attrib = dict(copied.attrib)
            case 5:
                child.text = rng.choice((copied.text, None, "", "1", "nan", "-1e9"))
            case 6:
                parent.extend(copy.deepcopy(child) for _ in range(rng.choice((1, 3, 20))))
            case _:
                for name in rng.sample(list(child.attrib), min(len(child.attrib), 1)):
                    child.attrib[rng.choice((name, "id", "ref", "x"))] = child.attrib.pop(name)
    return ElementTree.tostring(root)

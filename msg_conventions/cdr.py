# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Plain CDR (XCDR1, little-endian), the bytes of a ROS 2 message, without any ROS library.

`encode` and `decode` process most messages by their tables in layouts.py. Paths and trajectories
are arrays of structures. Padding bytes are zero, as rosbags writes them; Fast CDR leaves them
uninitialised.
"""

from collections.abc import Mapping
from functools import cache
import struct
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

from msg_conventions.layouts import Layout
from scenario_gen.base.errors import InputError
from scenario_gen.numerics import NS_PER_S

HEADER = b"\x00\x01\x00\x00"  # encapsulation: CDR, little-endian, no options


@cache
def _dtype(kind: str) -> np.dtype[Any]:
    return np.dtype(kind).newbyteorder("<")


def encode(layout: Layout, **values: Any) -> bytes:
    """Return a message as CDR bytes; missing fields are zero or empty.

    Args:
        layout: one of `layouts`.
        values: by field: a mapping for a table, a sized collection for a sequence.

    Raises:
        InputError: a number or a stamp is out of range.
    """
    return CdrWriter().fields(layout, values).finish()


def decode(layout: Layout, data: bytes, source: str, *, framed: bool = False) -> SimpleNamespace:
    """Return the fields of a message.

    Args:
        layout: one of `layouts`.
        data: CDR bytes.
        source: names the message in errors.
        framed: whether its frame must not be empty, because it has positions.

    Raises:
        InputError: it is damaged.
    """
    return CdrReader(data, source).fields(layout, framed=framed)


def stamp_of(data: bytes, source: str) -> int:
    """Return the stamp [ns] of a message that begins with a header.

    Raises:
        InputError: naming `source`, it is damaged.
    """
    return CdrReader(data, source).stamp()


class CdrWriter:
    """Appends values at their natural alignment, counted after the encapsulation header."""

    def __init__(self) -> None:
        self.body = bytearray()

    def fields(self, layout: Layout, values: Mapping[str, Any]) -> "CdrWriter":
        """Append the fields of a table; missing ones are zero or empty.

        Raises:
            InputError: a number or a stamp is out of range.
        """
        for name, kind in layout.items():
            self._append(kind, values.get(name))
        return self

    def finish(self) -> bytes:
        """Return the message."""
        return HEADER + bytes(self.body)

    def _append(self, kind: Any, value: Any) -> None:
        if isinstance(kind, dict):
            self.fields(kind, value or {})
        elif kind == "string":
            data = (value or "").encode() + b"\x00"
            self._count(len(data))
            self.body += data
        elif kind == "time":
            seconds, nanoseconds = divmod(value or 0, NS_PER_S)
            if not -(2**31) <= seconds < 2**31:
                raise InputError(
                    f"stamp {value} ns does not fit a ROS time (32-bit seconds, until 2038)"
                )
            self._count(seconds % 2**32)
            self._count(nanoseconds)
        elif isinstance(kind, str):
            self._numbers(kind, np.zeros(_dtype(kind).shape) if value is None else value)
        else:
            self._sequence(kind[0], () if value is None else value)

    def _sequence(self, kind: Any, values: Any) -> None:
        self._count(len(values))
        if isinstance(kind, dict) or kind == "string":
            for value in values:
                self._append(kind, value)
        else:
            self._numbers(kind, values)

    def _count(self, count: int) -> None:
        self.body += bytes(-len(self.body) % 4) + int(count).to_bytes(4, "little")

    def _numbers(self, kind: str, value: Any) -> None:
        dtype = _dtype(kind)
        try:
            numbers = np.asarray(value, dtype.base).reshape(-1, *dtype.shape)
        except OverflowError as error:
            raise InputError(f"a message cannot hold {value}: {error}") from None
        if numbers.size:
            self.body += bytes(-len(self.body) % dtype.base.itemsize) + numbers.tobytes()


class CdrReader:
    """Reads CDR; `place` is the position after the last byte read.

    Raises:
        InputError: from every method, naming `source`: the data ends too early or is not
            little-endian CDR.
    """

    def __init__(self, data: bytes, source: str) -> None:
        if len(data) < 4 or bytes(data[:2]) != HEADER[:2]:
            raise InputError(f"{source}: not a little-endian CDR message ({len(data)} bytes)")
        self._data = memoryview(data)[4:]
        self.place = 0
        self._source = source

    def _read(self, size: int, alignment: int) -> memoryview:
        start = self.place + -self.place % alignment
        if size < 0 or start + size > len(self._data):
            raise InputError(
                f"{self._source}: the message ends at byte {len(self._data)}, {start + size} are "
                "needed"
            )
        self.place = start + size
        return self._data[start : start + size]

    def count(self, size: int = 1) -> int:
        """Read the length of a sequence whose items have at least `size` bytes each.

        Raises:
            InputError: fewer bytes are left.
        """
        count = int.from_bytes(self._read(4, 4), "little")
        left = len(self._data) - self.place
        if count * size > left:
            raise InputError(
                f"{self._source}: {count} items are announced where {left} bytes are left"
            )
        return count

    def array(self, dtype: npt.DTypeLike, count: int, alignment: int) -> npt.NDArray[Any]:
        """Read `count` items (n,) of a numpy type, the first one aligned.

        Without items no padding either.
        """
        kind = np.dtype(dtype)
        data = self._read(kind.itemsize * count, alignment) if count else b""
        return np.frombuffer(data, dtype=kind, count=count)

    def string(self) -> str:
        """Read a string.

        Raises:
            InputError: it is not UTF-8, or the message ends before it.
        """
        data = bytes(self._read(self.count(), 1))
        try:
            return data[:-1].decode()
        except UnicodeDecodeError:
            raise InputError(f"{self._source}: a text in the message is not UTF-8") from None

    def stamp(self) -> int:
        """Read a Time or Duration in nanoseconds."""
        seconds, nanoseconds = struct.unpack("<iI", self._read(8, 4))
        return int(seconds) * NS_PER_S + int(nanoseconds)

    def aligned(self, dtype: npt.DTypeLike, count: int) -> npt.NDArray[Any] | None:
        """Read `count` structures (n,) that end at multiples of 8 bytes.

        Reads nothing and returns None if fewer bytes are left.

        The type begins with 4 bytes and 4 bytes of padding. A first structure that begins at an
        odd multiple of 4 lacks this padding.
        """
        kind = np.dtype(dtype)
        start = self.place + -self.place % 4
        lacks_padding = start % 8 == 4
        end = start + kind.itemsize * count - 4 * lacks_padding
        if not count or end > len(self._data):
            return None
        self.place = end
        body: Any = self._data[start:end]
        if lacks_padding:
            body = b"".join((body[:4], bytes(4), body[4:]))
        return np.frombuffer(body, dtype=kind)

    def fields(self, layout: Layout, *, framed: bool = False) -> SimpleNamespace:
        """Read the fields of a table.

        Values are numbers, arrays, texts, stamps [ns], lists and namespaces; `framed` as in
        `decode`.

        Raises:
            InputError: the frame is empty and must not be.
        """
        values = SimpleNamespace(**{name: self._value(kind) for name, kind in layout.items()})
        if framed and not values.frame_id:
            raise InputError(
                f"{self._source}: header.frame_id is empty; name the frame of the positions"
            )
        return values

    def _value(self, kind: Any) -> Any:
        if isinstance(kind, dict):
            return self.fields(kind)
        if kind == "string":
            return self.string()
        if kind == "time":
            return self.stamp()
        if isinstance(kind, str):
            dtype = _dtype(kind)
            value = self.array(dtype, 1, dtype.base.itemsize)[0]
            return value if dtype.shape else value.item()
        if isinstance(kind[0], dict) or kind[0] == "string":
            return [self._value(kind[0]) for _ in range(self.count())]
        dtype = _dtype(kind[0])
        return self.array(dtype, self.count(dtype.itemsize), dtype.base.itemsize)

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Plain CDR (XCDR1, little-endian), the bytes of a ROS 2 message, written and read without any ROS library.

Padding bytes are zero. (Fast CDR leaves them uninitialised, so two runs of rclpy disagree there; rosbags writes zeros too.)
"""

import struct
from typing import Any

import numpy as np
import numpy.typing as npt

from scenario_gen.base.errors import InputError
from scenario_gen.numerics import Floats

HEADER = b"\x00\x01\x00\x00"  # encapsulation: CDR, little-endian, no options
NANOSECONDS = 1_000_000_000


def stamp_of(data: bytes, what: str) -> int:
    """Return the stamp [ns] of a message that begins with a header.

    Raises:
        InputError: naming `what`, it is damaged.
    """
    return CdrReader(data, what).stamp()


class CdrWriter:
    """Appends values at their natural alignment, counted from the byte after the encapsulation header."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    def align(self, size: int) -> "CdrWriter":
        """Pad with zeros to a multiple of `size` bytes."""
        self._bytes.extend(bytes(-len(self._bytes) % size))
        return self

    def raw(self, data: bytes) -> "CdrWriter":
        """Append bytes as they are."""
        self._bytes += data
        return self

    def pack(self, code: str, *values: float) -> "CdrWriter":
        """Append numbers of one struct `code` ('I' uint32, 'i' int32, 'd' float64, 'f' float32, 'B' uint8, ...).

        Raises:
            InputError: a number is out of range.
        """
        self.align(struct.calcsize("<" + code))
        try:
            self._bytes += struct.pack(f"<{len(values)}{code}", *values)
        except struct.error as error:
            raise InputError(f"a message cannot hold {values}: {error}") from None
        return self

    def string(self, text: str) -> "CdrWriter":
        """Append a string: uint32 length with the terminating zero, UTF-8 bytes, zero."""
        data = text.encode() + b"\x00"
        return self.pack("I", len(data)).raw(data)

    def stamp(self, nanoseconds: int) -> "CdrWriter":
        """Append builtin_interfaces/Time (or Duration): int32 seconds, uint32 nanoseconds.

        Raises:
            InputError: the seconds need more than 32 bits.
        """
        seconds, rest = divmod(nanoseconds, NANOSECONDS)
        if not -(2**31) <= seconds < 2**31:
            raise InputError(f"stamp {nanoseconds} ns does not fit a ROS time (32-bit seconds, until 2038)")
        return self.pack("i", seconds).pack("I", rest)

    def header(self, stamp_ns: int, frame_id: str) -> "CdrWriter":
        """Append std_msgs/Header."""
        return self.stamp(stamp_ns).string(frame_id)

    def offset(self) -> int:
        """Bytes written so far, without the encapsulation header."""
        return len(self._bytes)

    def finish(self) -> bytes:
        """Return the message."""
        return HEADER + bytes(self._bytes)


class CdrReader:
    """Reads what CdrWriter (or rclpy, or rosbags) wrote; `place` is the byte after the last one read.

    Raises:
        InputError: from every method, naming `what`, where the data ends too early or is not little-endian CDR.
    """

    def __init__(self, data: bytes, what: str) -> None:
        if len(data) < 4 or bytes(data[:2]) != HEADER[:2]:
            raise InputError(f"{what}: not a little-endian CDR message ({len(data)} bytes)")
        self._data = memoryview(data)[4:]
        self.place = 0
        self._what = what

    def _take(self, size: int, alignment: int) -> memoryview:
        start = self.place + -self.place % alignment
        if size < 0 or start + size > len(self._data):
            raise InputError(f"{self._what}: the message ends at byte {len(self._data)}, {start + size} are needed")
        self.place = start + size
        return self._data[start : start + size]

    def one(self, code: str) -> Any:
        """Read a number of struct `code`."""
        size = struct.calcsize("<" + code)
        return struct.unpack("<" + code, self._take(size, size))[0]

    def count(self, size: int = 1) -> int:
        """Read the length of a sequence whose items take at least `size` bytes each.

        Raises:
            InputError: less than that is left.
        """
        count, left = int(self.one("I")), len(self._data) - self.place
        if count * size > left:
            raise InputError(f"{self._what}: {count} items are announced where {left} bytes are left")
        return count

    def number(self) -> int:
        """Read a uint32 that is no length."""
        return int(self.one("I"))

    def array(self, dtype: npt.DTypeLike, count: int, alignment: int) -> npt.NDArray[Any]:
        """Read `count` items (n,) of a numpy type, the first one aligned; nothing (no padding either) if `count` is 0."""
        kind = np.dtype(dtype)
        return np.frombuffer(self._take(kind.itemsize * count, alignment) if count else b"", dtype=kind, count=count)

    def floats(self, count: int) -> Floats:
        """Read `count` float64 (n,), of any unit, that belong to one or more structures."""
        return self.array("<f8", count, 8)

    def string(self) -> str:
        """Read a string.

        Raises:
            InputError: it is not UTF-8, or the message ends before it.
        """
        data = bytes(self._take(self.count(), 1))
        try:
            return data[:-1].decode()
        except UnicodeDecodeError:
            raise InputError(f"{self._what}: a text in the message is not UTF-8") from None

    def stamp(self) -> int:
        """Read a Time or Duration in nanoseconds."""
        return int(self.one("i")) * NANOSECONDS + int(self.one("I"))

    def aligned(self, dtype: npt.DTypeLike, count: int) -> npt.NDArray[Any] | None:
        """Read `count` structures (n,) that each end at a multiple of 8 bytes; None, and nothing read, if less is left.

        The type begins with 4 bytes and a padding to 8, which the first structure does without where it begins amid 8.
        """
        kind, start = np.dtype(dtype), self.place + -self.place % 4
        amid = start % 8 == 4
        end = start + kind.itemsize * count - 4 * amid
        if not count or end > len(self._data):
            return None
        self.place = end
        body = self._data[start:end]
        return np.frombuffer(b"".join((body[:4], bytes(4), body[4:])) if amid else body, dtype=kind)

    def header(self) -> tuple[int, str]:
        """Read std_msgs/Header: stamp in nanoseconds and frame."""
        return self.stamp(), self.string()

    def framed_header(self) -> tuple[int, str]:
        """Read the std_msgs/Header of a message with positions: its frame may not be empty.

        Raises:
            InputError: it is empty.
        """
        stamp_ns, frame_id = self.header()
        if not frame_id:
            raise InputError(f"{self._what}: header.frame_id is empty; name the frame that the positions are in")
        return stamp_ns, frame_id

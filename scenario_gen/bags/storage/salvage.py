# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The whole records of an MCAP file that was cut off or damaged; the rest is passed over and reported.

A record is taken where its lengths agree with themselves and with what follows. After a damaged one the search goes on for the
next place at which records follow one another; a chunk holds its length twice, so one alone is enough.
"""

from dataclasses import dataclass, field, replace
import mmap
import re
from typing import Any, BinaryIO

from mcap.opcode import Opcode

from scenario_gen.bags.storage.config import Allowance
from scenario_gen.bags.storage.mcap import CHUNK_HEAD_BYTES, ChunkBlock, McapFile
from scenario_gen.bags.storage.records import DamagedError, HEAD, MAGIC, read_chunk_head, Record
from scenario_gen.base.errors import InputError

# An opcode of a record that matters, and a length below 2**32.
CANDIDATE = re.compile(rb"(?=[\x01-\x0f].{4}\x00{4})", re.DOTALL)
FEWEST = {  # bytes of a record's content; some kinds have always the same number
    Opcode.HEADER: 8,
    Opcode.SCHEMA: 14,
    Opcode.CHANNEL: 16,
    Opcode.MESSAGE: 22,
    Opcode.CHUNK: 40,
    Opcode.MESSAGE_INDEX: 6,
    Opcode.CHUNK_INDEX: 64,
    Opcode.ATTACHMENT: 36,
    Opcode.ATTACHMENT_INDEX: 48,
    Opcode.STATISTICS: 46,
    Opcode.METADATA: 8,
    Opcode.METADATA_INDEX: 20,
}
ALWAYS = {Opcode.FOOTER: 20, Opcode.DATA_END: 4, Opcode.SUMMARY_OFFSET: 17}
PRIVATE = 0x80  # opcodes from here on are for private use
IN_A_ROW = 3  # so many records that follow one another are not there by chance


@dataclass(frozen=True)
class Gap:
    """Bytes that were passed over: the first one, how many, why, and how many messages were in them as far as known."""

    offset: int
    size: int
    problem: str
    messages: int = 0


@dataclass
class Salvage:
    """The sound part of a file.

    Attributes:
        whole: its blocks and types, to be read with `strict=False`.
        gaps: what was passed over, in order.
        closed: whether the recorder closed the file.
    """

    whole: McapFile
    gaps: list[Gap] = field(default_factory=list)
    closed: bool = True


def salvage(file: BinaryIO, size: int, allowance: Allowance) -> Salvage:
    """Find what is whole in a file of `size` bytes."""
    found = Salvage(McapFile(file, allowance))
    if size < len(MAGIC):
        return replace(found, gaps=[Gap(0, size, "shorter than the beginning of an MCAP file")], closed=False)
    with mmap.mmap(file.fileno(), size, access=mmap.ACCESS_READ) as data:
        at = len(MAGIC)
        if data[:at] != MAGIC:
            at = _next(data, 0)
            found.gaps.append(Gap(0, at, "not the beginning of an MCAP file"))
        while at < size:
            if size - at == len(MAGIC) and data[at:size] == MAGIC:
                return found
            at = _take(found, data, at)
    found.closed = False
    return found


def _take(found: Salvage, data: Any, at: int) -> int:
    """Take the record at byte `at`, or note a gap; return where to go on."""
    size = len(data)
    record = _record(data, at)
    if record is None or record.end > size:
        if record is not None and record.opcode == Opcode.CHUNK and _chunk_is_sound(data, record):
            found.gaps.append(Gap(at, size - at, "a chunk that is cut off"))
            return size
        after = _next(data, at + 1)
        found.gaps.append(Gap(at, after - at, "no record" if record is None else "a record longer than the file"))
        return after
    sound = _chunk_is_sound(data, record) if record.opcode == Opcode.CHUNK else _follows(data, record.end, IN_A_ROW - 1)
    if not sound:
        after = _next(data, at + 1)
        if after < record.end or record.opcode == Opcode.CHUNK:
            found.gaps.append(Gap(at, after - at, "a record whose length is damaged"))
            return after
    try:
        _keep(found, record)
    except DamagedError as error:
        lost = _indexed(data, record.end) if record.opcode == Opcode.CHUNK else int(record.opcode == Opcode.MESSAGE)
        found.gaps.append(Gap(at, record.end - at, str(error), lost))
    return record.end


def _keep(found: Salvage, record: Record) -> None:
    """Add a record, and check a chunk: whether it is whole, and what its first stamp is.

    Raises:
        DamagedError: it is damaged.
    """
    whole = found.whole
    whole.take(record)
    block = whole.blocks[-1] if whole.blocks else None
    if record.opcode != Opcode.CHUNK or not isinstance(block, ChunkBlock):
        return
    try:
        contents = block.contents(whole.file, whole.allowance)
    except InputError as error:
        whole.blocks.pop()
        raise DamagedError(record.start, str(error)) from error
    except DamagedError:
        whole.blocks.pop()
        raise
    whole.learn(contents)
    whole.blocks[-1] = replace(block, start_ns=int(min(contents.stamps, default=0)))
    if contents.damage:
        found.gaps.append(Gap(record.start, record.length, f"the end of a chunk: {contents.damage}"))


def _record(data: Any, at: int) -> Record | None:
    """Return the record whose head lies at byte `at`, None if there is none; its end may lie beyond the file's."""
    if len(data) - at < HEAD.size:
        return None
    opcode, length = HEAD.unpack_from(data, at)
    if opcode in ALWAYS:
        return Record(opcode, at + HEAD.size, length) if length == ALWAYS[opcode] else None
    is_kind = opcode in FEWEST or opcode >= PRIVATE
    return Record(opcode, at + HEAD.size, length) if is_kind and length >= FEWEST.get(opcode, 0) else None


def _chunk_is_sound(data: Any, record: Record) -> bool:
    """Return whether both lengths of a chunk agree."""
    try:
        read_chunk_head(data[record.start : min(record.start + CHUNK_HEAD_BYTES, record.end)], record)
    except DamagedError:
        return False
    return True


def _follows(data: Any, at: int, count: int) -> bool:
    """Return whether records follow one another from byte `at`, `count` of them or up to the end of the file."""
    for _ in range(count):
        if at == len(data) or data[at : at + 2 * len(MAGIC)] == MAGIC:
            return True
        record = _record(data, at)
        if record is None or record.end > len(data):
            return False
        if record.opcode == Opcode.CHUNK:
            return _chunk_is_sound(data, record)
        at = record.end
    return True


def _next(data: Any, at: int) -> int:
    """Return the next place from which records follow one another; the end of the file if there is none."""
    for match in CANDIDATE.finditer(data, at):
        record = _record(data, match.start())
        if record is None or record.end > len(data):
            continue
        if record.opcode == Opcode.CHUNK:
            if _chunk_is_sound(data, record):
                return match.start()
        elif _follows(data, match.start(), IN_A_ROW):
            return match.start()
    return len(data)


def _indexed(data: Any, at: int) -> int:
    """Return how many messages the indexes after a chunk name."""
    count = 0
    while (record := _record(data, at)) is not None and record.opcode == Opcode.MESSAGE_INDEX and record.end <= len(data):
        count += (record.length - 6) // 16
        at = record.end
    return count

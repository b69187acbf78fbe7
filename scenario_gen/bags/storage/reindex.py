# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Recover the whole messages of MCAP files that were not closed or are damaged, as a new bag."""

from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
import heapq
from pathlib import Path

from mcap.records import Channel

from scenario_gen.bags.storage.config import BagConfig, ReadBudget
from scenario_gen.bags.storage.definitions import definition
from scenario_gen.bags.storage.mcap import DamagedError, Gap, LoggedMessage, McapFile
from scenario_gen.bags.storage.metadata import profiles
from scenario_gen.bags.storage.writer import atomic_bag, BagWriter
from scenario_gen.base.documents import shown
from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import Kind

_REINDEXED = Kind("reindexed bag")
_BINARY_ENCODING = "protobuf"  # schemas that are not texts
_MAX_LINE_COUNT = 20


@dataclass(frozen=True)
class Reindexed:
    """The result of `reindex`.

    Attributes:
        messages: number of recovered messages.
        gaps: file name and skipped bytes.
        undescribed: reason and number of whole messages whose topic or type is lost.
        unclosed: names of files that their recorder did not close.
    """

    messages: int
    gaps: tuple[tuple[str, Gap], ...] = ()
    undescribed: tuple[tuple[str, int], ...] = ()
    unclosed: tuple[str, ...] = ()

    def lines(self) -> list[str]:
        """Return a line for each loss, and a remedy; none if nothing was lost."""
        lines = [
            f"{name} was not closed: messages that its recorder had not written yet are missing"
            for name in self.unclosed
        ]
        for name, gap in self.gaps:
            known = f", {gap.messages} messages by its index" if gap.messages else ""
            lines.append(
                f"lost: {name}, {gap.size} bytes from byte {gap.offset}{known} ({gap.problem})"
            )
        lines += [f"lost: {count} messages ({reason})" for reason, count in self.undescribed]
        if len(lines) > _MAX_LINE_COUNT:
            more = len(lines) - _MAX_LINE_COUNT
            lines = [*lines[:_MAX_LINE_COUNT], f"… and {more} more losses"]
        if self.gaps or self.undescribed:
            size = sum(gap.size for _, gap in self.gaps)
            lines.append(
                f"{size} bytes were skipped; copy the files again if the originals are whole"
            )
        return lines


def reindex(folder: Path, target: Path, config: BagConfig = BagConfig()) -> Reindexed:
    """Write the readable messages of a bag to a new bag, by their stamps.

    Args:
        folder: that of the bag, or one MCAP file.
        target: folder of the new bag.
        config: bounds of reading; a larger chunk is skipped.

    Raises:
        InputError: the folder has no MCAP file, no message is whole, or the bag cannot be written.
    """
    paths = [folder] if folder.is_file() else list(folder.glob("*.mcap"))
    paths.sort(key=lambda path: (len(path.name), path.name))
    if not paths:
        raise InputError(f"{folder}: no .mcap file here; name the folder of a recorded bag")
    with ExitStack() as stack:
        files = _scan(paths, config, stack)
        gaps = tuple((path.name, gap) for path, file in files for gap in file.gaps)
        with atomic_bag(target, _REINDEXED, [folder]) as bag:
            recovered, undescribed = _copy_messages(bag, files)
            if not recovered:
                reason = f": {gaps[0][1].problem} at byte {gaps[0][1].offset}" if gaps else ""
                names = shown(", ".join(path.name for path in paths))
                raise InputError(f"{folder}: no whole message is left in {names}{reason}")
    unclosed = tuple(path.name for path, file in files if not file.closed)
    return Reindexed(recovered, gaps, tuple(sorted(undescribed.items())), unclosed)


def _scan(paths: list[Path], config: BagConfig, stack: ExitStack) -> list[tuple[Path, McapFile]]:
    """Return the whole chunks of each file.

    Raises:
        InputError: a file cannot be read.
    """
    try:
        total_bytes = sum(path.stat().st_size for path in paths)
        scan_budget = ReadBudget(config, str(paths[0].parent), total_bytes)
        copy_budget = ReadBudget(config, str(paths[0].parent), total_bytes)
        files = []
        for path in paths:
            stream = stack.enter_context(path.open("rb"))
            file = McapFile(stream, path.stat().st_size, scan_budget)
            file.scan()
            file.budget = copy_budget
            files.append((path, file))
    except OSError as error:
        raise InputError(
            f"{error.filename or paths[0]}: cannot be read ({error.strerror or error})"
        ) from error
    return files


def _copy_messages(bag: BagWriter, files: list[tuple[Path, McapFile]]) -> tuple[int, Counter[str]]:
    """Copy all messages; return how many, and how many not, by the reason."""
    types: dict[str, str] = {}
    problems: dict[tuple[Path, int], str] = {}
    for path, file in files:
        for key, channel in file.channels.items():
            problems[path, key] = _add_topic(bag, file, channel, types)

    copied = 0
    undescribed = Counter[str]()
    streams = [_messages(path, file) for path, file in files]
    for path, file, message in heapq.merge(*streams, key=lambda entry: entry[2].stamp_ns):
        channel_id = message.channel_id
        lost_channel = f"channel {channel_id} is not described in what is left of {path.name}"
        problem = problems.get((path, channel_id), lost_channel)
        if problem:
            undescribed[problem] += 1
            continue
        bag.write(file.channels[channel_id].topic, message.data, message.stamp_ns)
        copied += 1
    return copied, undescribed


def _messages(path: Path, file: McapFile) -> Iterator[tuple[Path, McapFile, LoggedMessage]]:
    """Yield the messages of a file by their stamps."""
    try:
        for message in file.messages():
            yield path, file, message
    except DamagedError as error:  # the scan found it whole
        raise InputError(f"{path}: changed while it was read ({error})") from error


def _add_topic(bag: BagWriter, file: McapFile, channel: Channel, types: dict[str, str]) -> str:
    """Add a topic to the bag and to `types`; return "", or why its messages cannot be written."""
    schema = file.schemas.get(channel.schema_id)
    name = f"topic {shown(channel.topic)}"
    if schema is None:
        return f"the type of {name} is not described in what is left"
    if channel.message_encoding != "cdr":
        return f"{name} is encoded as {shown(channel.message_encoding)!r}, not as 'cdr'"
    if types.setdefault(channel.topic, schema.name) != schema.name:
        return f"{name} has two types, {shown(types[channel.topic])} and {shown(schema.name)}"
    recorded_schema = None
    try:
        definition(schema.name)
    except InputError as error:
        if not schema.data or schema.encoding == _BINARY_ENCODING:
            return str(error)
        recorded_schema = schema.encoding, schema.data.decode(errors="replace")
    qos = channel.metadata.get("offered_qos_profiles", "")
    type_hash = channel.metadata.get("topic_type_hash", "")
    valid_qos = qos if profiles(qos) else ""
    bag.add_topic(channel.topic, schema.name, valid_qos, type_hash, recorded_schema)
    return ""

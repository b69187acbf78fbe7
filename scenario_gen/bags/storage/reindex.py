# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Save what is whole in the MCAP files of a bag whose recorder was killed or that was damaged, and write its metadata.yaml."""

from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
import heapq
from pathlib import Path

from mcap.records import Channel

from scenario_gen.bags.storage.config import Allowance, BagConfig
from scenario_gen.bags.storage.definitions import definition
from scenario_gen.bags.storage.mcap import DamagedError, Gap, Logged, McapFile
from scenario_gen.bags.storage.metadata import profiles
from scenario_gen.bags.storage.writer import atomic_bag, BagWriter
from scenario_gen.base.documents import shown
from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import Kind

REINDEXED = Kind("reindexed bag")
PROTOBUF = "protobuf"  # the encoding of schemas that are no texts
MOST_LINES = 20  # of what was lost, on a terminal


@dataclass(frozen=True)
class Reindexed:
    """The result of `reindex`.

    Attributes:
        messages: how many were saved.
        gaps: what was passed over, by the name of the file.
        undescribed: messages that are whole but whose topic or type is lost: how many, by a sentence that says why.
        unclosed: names of the files that their recorder did not close.
    """

    messages: int
    gaps: tuple[tuple[str, Gap], ...] = ()
    undescribed: tuple[tuple[str, int], ...] = ()
    unclosed: tuple[str, ...] = ()

    def lines(self) -> list[str]:
        """Return what was lost, where, and what can be done about it, line by line; no line if nothing was."""
        lines = [
            f"{name} was not closed: messages that its recorder had not written yet are missing"
            for name in self.unclosed
        ]
        for name, gap in self.gaps:
            known = f", {gap.messages} messages by its index" if gap.messages else ""
            lines.append(
                f"lost: {name}, {gap.size} bytes from byte {gap.offset}{known} ({gap.problem})"
            )
        lines += [f"lost: {count} messages ({why})" for why, count in self.undescribed]
        if len(lines) > MOST_LINES:
            lines = [*lines[:MOST_LINES], f"… and {len(lines) - MOST_LINES} gaps more"]
        if self.gaps or self.undescribed:
            size = sum(gap.size for _, gap in self.gaps)
            lines.append(
                f"{size} bytes were passed over in all; copy the files again if they are whole where they were recorded"
            )
        return lines


def reindex(folder: Path, target: Path, config: BagConfig = BagConfig()) -> Reindexed:
    """Write the messages that can still be read in `folder` to the bag `target`, in order of their stamps.

    Args:
        folder: of the bag, or one MCAP file.
        target: folder of the new bag.
        config: what is read at most; a chunk that is larger is passed over.

    Raises:
        InputError: there is no MCAP file in `folder`, none holds a whole message, or `target` cannot be written.
    """
    paths = (
        [folder]
        if folder.is_file()
        else sorted(folder.glob("*.mcap"), key=lambda path: (len(path.name), path.name))
    )
    if not paths:
        raise InputError(f"{folder}: no .mcap file here; name the folder of a recorded bag")
    with ExitStack() as stack:
        files = _salvaged(paths, config, stack)
        gaps = tuple((path.name, gap) for path, file in files for gap in file.gaps)
        with atomic_bag(target, REINDEXED, [folder]) as bag:
            saved, lost = _write(bag, files)
            if not saved:
                why = f": {gaps[0][1].problem} at byte {gaps[0][1].offset}" if gaps else ""
                names = shown(", ".join(path.name for path in paths))
                raise InputError(f"{folder}: not one whole message is left in {names}{why}")
    return Reindexed(
        saved,
        gaps,
        tuple(sorted(lost.items())),
        tuple(path.name for path, file in files if not file.closed),
    )


def _salvaged(
    paths: list[Path], config: BagConfig, stack: ExitStack
) -> list[tuple[Path, McapFile]]:
    """Return what is whole in each file."""
    try:
        sizes = [path.stat().st_size for path in paths]
        first, again = (Allowance(config, str(paths[0].parent), sum(sizes)) for _ in range(2))
        streams = [stack.enter_context(path.open("rb")) for path in paths]
        found = [
            McapFile(stream, size, first) for stream, size in zip(streams, sizes, strict=True)
        ]
        for file in found:
            file.scan()
            file.allowance = again  # for the second reading, which writes
    except OSError as error:
        raise InputError(
            f"{error.filename or paths[0]}: cannot be read ({error.strerror or error})"
        ) from error
    return list(zip(paths, found, strict=True))


def _write(bag: BagWriter, files: list[tuple[Path, McapFile]]) -> tuple[int, Counter[str]]:
    """Write all messages; return how many were written, and how many could not be, by the reason."""
    saved, undescribed, types = 0, Counter[str](), dict[str, str]()
    reasons = {
        (path, key): _announced(bag, file, channel, types)
        for path, file in files
        for key, channel in file.channels.items()
    }
    for path, file, (stamp, number, data) in heapq.merge(
        *(_messages(*entry) for entry in files), key=lambda entry: entry[2][0]
    ):
        reason = reasons.get(
            (path, number), f"channel {number} is not described in what is left of {path.name}"
        )
        if reason:
            undescribed[reason] += 1
        else:
            bag.write(file.channels[number].topic, data, stamp)
            saved += 1
    return saved, undescribed


def _messages(path: Path, file: McapFile) -> Iterator[tuple[Path, McapFile, Logged]]:
    """Yield the messages of a file in order of their stamps."""
    try:
        for message in file.in_order(None):
            yield path, file, message
    except DamagedError as error:  # it was whole just now
        raise InputError(f"{path}: changed while it was read ({error})") from error


def _announced(bag: BagWriter, file: McapFile, channel: Channel, types: dict[str, str]) -> str:
    """Announce a topic; return "", or why its messages cannot be written. `types` are those of the topics before."""
    schema, name = file.schemas.get(channel.schema_id), f"topic {shown(channel.topic)}"
    if schema is None:
        return f"the type of {name} is not described in what is left"
    if channel.message_encoding != "cdr":
        return f"{name} is encoded as {shown(channel.message_encoding)!r}, not as 'cdr'"
    if types.setdefault(channel.topic, schema.name) != schema.name:
        return f"{name} is of two types, {shown(types[channel.topic])} and {shown(schema.name)}"
    text = None
    try:
        definition(schema.name)
    except InputError as error:
        if not schema.data or schema.encoding == PROTOBUF:
            return str(error)
        text = (
            schema.encoding,
            schema.data.decode(errors="replace"),
        )  # as the recorder described it
    qos, type_hash = (
        channel.metadata.get(key, "") for key in ("offered_qos_profiles", "topic_type_hash")
    )
    bag.add_topic(channel.topic, schema.name, qos if profiles(qos) else "", type_hash, text)
    return ""

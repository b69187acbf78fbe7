# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Save what is whole in the MCAP files of a bag whose recorder was killed or that was damaged, and write its metadata.yaml."""

from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass
import heapq
from pathlib import Path

from mcap.records import Channel

from scenario_gen.bags.storage.config import Allowance, BagConfig
from scenario_gen.bags.storage.definitions import definition
from scenario_gen.bags.storage.files import METADATA
from scenario_gen.bags.storage.mcap import DamagedError, Gap, Logged, McapFile
from scenario_gen.bags.storage.metadata import profiles
from scenario_gen.bags.storage.writer import atomic_bag, BagWriter
from scenario_gen.base.documents import read_yaml, shown
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
        lines = [f"{name} was not closed: messages that its recorder had not written yet are missing" for name in self.unclosed]
        for name, gap in self.gaps:
            known = f", {gap.messages} messages by its index" if gap.messages else ""
            lines.append(f"lost: {name}, {gap.size} bytes from byte {gap.offset}{known} ({gap.problem})")
        lines += [f"lost: {count} messages ({why})" for why, count in self.undescribed]
        if len(lines) > MOST_LINES:
            lines = [*lines[:MOST_LINES], f"… and {len(lines) - MOST_LINES} gaps more"]
        if self.gaps or self.undescribed:
            size = sum(gap.size for _, gap in self.gaps)
            lines.append(f"{size} bytes were passed over in all; copy the files again if they are whole where they were recorded")
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
    files = [folder] if folder.is_file() else sorted(folder.glob("*.mcap"), key=lambda path: (len(path.name), path.name))
    if not files:
        raise InputError(f"{folder}: no .mcap file here; name the folder of a recorded bag")
    with ExitStack() as stack:
        found = _salvaged(files, config, stack)
        with atomic_bag(target, REINDEXED, [folder]) as bag:
            types = _types(found, folder)
            for part in found:
                part.announce(bag, types)
            saved, undescribed = _write(bag, found)
            gaps = tuple((part.path.name, gap) for part in found for gap in part.whole.gaps)
            if not saved:
                why = f": {gaps[0][1].problem} at byte {gaps[0][1].offset}" if gaps else ""
                names = shown(", ".join(path.name for path in files))
                raise InputError(f"{folder}: not one whole message is left in {names}{why}")
    unclosed = tuple(part.path.name for part in found if not part.whole.closed)
    return Reindexed(saved, gaps, tuple(sorted(undescribed.items())), unclosed)


def _salvaged(files: list[Path], config: BagConfig, stack: ExitStack) -> list["_Saved"]:
    """Return what is whole in each file."""
    found = []
    try:
        sizes = [path.stat().st_size for path in files]
        first, again = (Allowance(config, str(files[0].parent), sum(sizes)) for _ in range(2))
        for path, size in zip(files, sizes, strict=True):
            whole = McapFile(stack.enter_context(path.open("rb")), size, first)
            whole.scan()
            whole.allowance = again  # for the second reading, which writes
            found.append(_Saved(path, whole))
    except OSError as error:
        raise InputError(f"{error.filename or files[0]}: cannot be read ({error.strerror or error})") from error
    return found


class _Saved:
    """A file and what is whole in it."""

    def __init__(self, path: Path, whole: McapFile) -> None:
        self.path, self.whole = path, whole
        self.topics: dict[int, tuple[str, str]] = {}  # by channel: the name, and why its messages cannot be written, or ""

    def announce(self, bag: BagWriter, types: dict[str, str]) -> None:
        """Announce the topics, whose types are given."""
        for channel in self.whole.channels.values():
            self.topics[channel.id] = (channel.topic, self._announced(bag, channel, types.get(channel.topic, "")))

    def _announced(self, bag: BagWriter, channel: Channel, known: str) -> str:
        """Announce a topic; return "", or why it cannot be."""
        schema, name = self.whole.schemas.get(channel.schema_id), f"topic {shown(channel.topic)}"
        kind = schema.name if schema is not None else known
        if not kind:
            return f"the type of {name} is not described in what is left"
        if channel.message_encoding != "cdr":
            return f"{name} is encoded as {shown(channel.message_encoding)!r}, not as 'cdr'"
        if kind != known:
            return f"{name} is of two types, {shown(known)} and {shown(kind)}"
        text = None
        try:
            definition(kind)
        except InputError as error:
            if schema is None or not schema.data or schema.encoding == PROTOBUF:
                return str(error)
            text = (
                schema.encoding,
                schema.data.decode(errors="replace"),
            )  # a type that is not installed here, as the recorder described it
        qos, type_hash = (channel.metadata.get(key, "") for key in ("offered_qos_profiles", "topic_type_hash"))
        bag.add_topic(channel.topic, kind, qos if profiles(qos) else "", type_hash, text)
        return ""

    def messages(self) -> Iterator[tuple["_Saved", Logged]]:
        """Yield its messages in order of their stamps."""
        try:
            for message in self.whole.in_order(None):
                yield self, message
        except DamagedError as error:  # it was whole just now
            raise InputError(f"{self.path}: changed while it was read ({error})") from error


def _types(found: list[_Saved], folder: Path) -> dict[str, str]:
    """Return the type of each topic that metadata.yaml, if it is sound, or a file names: one may have lost what another has."""
    types: dict[str, str] = {}
    with suppress(InputError, KeyError, TypeError):
        for topic in read_yaml(folder / METADATA)["rosbag2_bagfile_information"]["topics_with_message_count"]:
            types[str(topic["topic_metadata"]["name"])] = str(topic["topic_metadata"]["type"])
    for whole in (part.whole for part in found):
        named = {c.topic: whole.schemas[c.schema_id].name for c in whole.channels.values() if c.schema_id in whole.schemas}
        types |= named
    return types


def _write(bag: BagWriter, found: list[_Saved]) -> tuple[int, Counter[str]]:
    """Write all messages; return how many were written, and how many could not be, by the reason."""
    saved, undescribed = 0, Counter[str]()
    for part, (stamp, channel, data) in heapq.merge(*(part.messages() for part in found), key=lambda entry: entry[1][0]):
        topic, lost = part.topics.get(channel, ("", f"channel {channel} is not described in what is left of {part.path.name}"))
        if lost:
            undescribed[lost] += 1
        else:
            bag.write(topic, data, stamp)
            saved += 1
    return saved, undescribed

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Save what is whole in the MCAP files of a bag whose recorder was killed or that was damaged, and write its metadata.yaml."""

from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
import heapq
from pathlib import Path
from typing import Any

from mcap.records import Channel, Schema

from scenario_gen.bags.storage.config import Allowance, BagConfig
from scenario_gen.bags.storage.definitions import definition
from scenario_gen.bags.storage.files import METADATA
from scenario_gen.bags.storage.mcap import Logged, McapFile
from scenario_gen.bags.storage.metadata import profiles
from scenario_gen.bags.storage.records import DamagedError, PROTOBUF
from scenario_gen.bags.storage.salvage import Gap, Salvage, salvage
from scenario_gen.bags.storage.writer import atomic_bag, BagWriter
from scenario_gen.base.documents import read_yaml, shown
from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import Kind

REINDEXED = Kind("reindexed bag")
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
            saved, undescribed = _write(bag, found, _types(found, folder))
            if not saved:
                gaps = [gap for _, part in found for gap in part.gaps]
                why = f": {gaps[0].problem} at byte {gaps[0].offset}" if gaps else ""
                raise InputError(
                    f"{folder}: not one whole message is left in {shown(', '.join(path.name for path in files))}{why}"
                )
    return Reindexed(
        saved,
        tuple((path.name, gap) for path, part in found for gap in part.gaps),
        tuple(sorted(undescribed.items())),
        tuple(path.name for path, part in found if not part.closed),
    )


def _salvaged(files: list[Path], config: BagConfig, stack: ExitStack) -> list[tuple[Path, Salvage]]:
    found = []
    try:
        sizes = [path.stat().st_size for path in files]
        first, again = (Allowance(config, str(files[0].parent), sum(sizes)) for _ in range(2))
        for path, size in zip(files, sizes, strict=True):
            part = salvage(stack.enter_context(path.open("rb")), size, first)
            part.whole.allowance = again  # for the second reading, which writes
            found.append((path, part))
    except OSError as error:
        raise InputError(f"{error.filename or files[0]}: cannot be read ({error.strerror or error})") from error
    return found


def _types(found: list[tuple[Path, Salvage]], folder: Path) -> dict[str, str]:
    """Return the type of every topic that the files or metadata.yaml name: a file may have lost what another one has."""
    types = _types_in_metadata(folder / METADATA)
    for _, part in found:
        for channel in part.whole.channels.values():
            schema = part.whole.schemas.get(channel.schema_id)
            if schema is not None:
                types[channel.topic] = schema.name
    return types


def _types_in_metadata(path: Path) -> dict[str, str]:
    """Return topics and types as far as metadata.yaml, which may be damaged too, names them."""
    found: dict[str, str] = {}
    try:
        listed: Any = read_yaml(path)["rosbag2_bagfile_information"]["topics_with_message_count"]
        for entry in listed:
            about = entry["topic_metadata"]
            if isinstance(about["name"], str) and isinstance(about["type"], str):
                found[about["name"]] = about["type"]
    except (InputError, KeyError, TypeError):
        return found
    return found


def _write(bag: BagWriter, found: list[tuple[Path, Salvage]], types: dict[str, str]) -> tuple[int, Counter[str]]:
    """Write the messages that were found; return how many, and how many could not be written, by the reason."""
    topics = [_announce(bag, part.whole, types) for _, part in found]
    saved, undescribed = 0, Counter[str]()
    streams = [_logged(k, path, part.whole) for k, (path, part) in enumerate(found)]
    for k, (stamp, channel, data) in heapq.merge(*streams, key=lambda entry: entry[1][0]):
        topic, lost = topics[k].get(channel, ("", f"channel {channel} is not described in what is left of {found[k][0].name}"))
        if lost:
            undescribed[lost] += 1
        else:
            bag.write(topic, data, stamp)
            saved += 1
    return saved, undescribed


def _logged(number: int, path: Path, whole: McapFile) -> Iterator[tuple[int, Logged]]:
    try:
        for message in whole.in_order(None, strict=False):
            yield number, message
    except DamagedError as error:  # the salvage has found it whole
        raise InputError(f"{path}: changed while it was read ({error})") from error


def _announce(bag: BagWriter, whole: McapFile, types: dict[str, str]) -> dict[int, tuple[str, str]]:
    """Announce the topics of a file; return {channel: (topic, "" or why its messages cannot be written)}."""
    announced: dict[int, tuple[str, str]] = {}
    for channel in whole.channels.values():
        schema = whole.schemas.get(channel.schema_id)
        kind = schema.name if schema is not None else types.get(channel.topic, "")
        name = f"topic {shown(channel.topic)}"
        if not kind:
            lost = f"the type of {name} is not described in what is left"
        elif channel.message_encoding != "cdr":
            lost = f"{name} is encoded as {shown(channel.message_encoding)!r}, not as 'cdr'"
        elif kind != types[channel.topic]:
            lost = f"{name} is of two types, {shown(types[channel.topic])} and {shown(kind)}"
        else:
            lost = _announced(bag, channel, kind, schema)
        announced[channel.id] = (channel.topic, lost)
    return announced


def _announced(bag: BagWriter, channel: Channel, kind: str, schema: Schema | None) -> str:
    """Announce a topic; return "", or why it cannot be."""
    known = None
    try:
        definition(kind)
    except InputError as error:
        if schema is None or not schema.data or schema.encoding == PROTOBUF:
            return str(error)
        known = (schema.encoding, schema.data.decode())  # a type that is not installed here, as the recorder described it
    qos, type_hash = (channel.metadata.get(key, "") for key in ("offered_qos_profiles", "topic_type_hash"))
    bag.add_topic(channel.topic, kind, qos if profiles(qos) else "", type_hash, known)
    return ""

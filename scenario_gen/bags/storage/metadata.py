# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""rosbag2's metadata.yaml, version 9, and QoS profiles, as any version of rosbag2 writes them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from scenario_gen.bags.storage.files import NOT_RECORDED
from scenario_gen.types import Quality

_MAX_STAMP_NS = 2**63 - 1


@dataclass
class TopicInfo:
    """The metadata of a topic."""

    name: str
    type: str
    quality: Quality
    type_hash: str
    count: int = 0


@dataclass
class FileInfo:
    """The metadata of a file."""

    path: str
    start_ns: int = _MAX_STAMP_NS
    end_ns: int = 0
    count: int = 0

    def add(self, stamp_ns: int) -> None:
        """Count a message."""
        self.start_ns = min(self.start_ns, stamp_ns)
        self.end_ns = max(self.end_ns, stamp_ns)
        self.count += 1


def _statistics(file: FileInfo) -> dict[str, Any]:
    """Return first stamp, duration and count of a file as in metadata.yaml; zeros if empty."""
    start_ns = file.start_ns if file.count else 0
    return {
        "starting_time": {"nanoseconds_since_epoch": start_ns},
        "duration": {"nanoseconds": file.end_ns - start_ns},
        "message_count": file.count,
    }


def metadata_yaml(
    topics: Sequence[TopicInfo], file: FileInfo, not_recorded: Mapping[str, str]
) -> str:
    """Return the text of metadata.yaml; `not_recorded` says by topic what is missing."""
    custom = {f"{NOT_RECORDED}{topic}": text for topic, text in not_recorded.items()}
    document = {
        "version": 9,
        "storage_identifier": "mcap",
        **_statistics(file),
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.type,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": _profiles(topic.quality),
                    "type_description_hash": topic.type_hash,
                },
                "message_count": topic.count,
            }
            for topic in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.path],
        "files": [{"path": file.path, **_statistics(file)}],
        "custom_data": custom or None,
        "ros_distro": "jazzy",
    }
    return _dump({"rosbag2_bagfile_information": document})


def _dump(value: Any) -> str:
    """Return YAML in the given order."""
    text: str = yaml.dump(value, Dumper=yaml.CSafeDumper, sort_keys=False)
    return text


def _profiles(quality: Quality) -> list[dict[str, Any]]:
    """Return an offered QoS profile in the list that rosbag2 writes.

    Each duration is rmw's infinite one, and an object of its own: rosbag2's YAML reader accepts no
    anchors.
    """
    durations = ("deadline", "lifespan", "liveliness_lease_duration")
    profile = {
        "history": "keep_last",
        "depth": quality.depth,
        "reliability": "reliable" if quality.reliable else "best_effort",
        "durability": "transient_local" if quality.transient_local else "volatile",
        **{name: {"sec": 9223372036, "nsec": 854775807} for name in durations},
        "liveliness": "automatic",
        "avoid_ros_namespace_conventions": False,
    }
    return [profile]


def qos_yaml(quality: Quality) -> str:
    """Return an offered QoS profile as the text in a file of a bag."""
    return _dump(_profiles(quality)).rstrip("\n")


def quality_of(profiles: Any) -> Quality:
    """Return the quality of the first of offered profiles with the fields that rosbag2 writes.

    It is volatile and of depth 10 if there is none, or a damaged one.
    """
    try:
        profile = profiles[0]
        names = [str(profile[key]).lower() for key in ("reliability", "durability")]
        # rosbag2 wrote rmw's numbers before Jazzy: best effort is 2, transient local is 1.
        return Quality(
            depth=max(1, int(profile["depth"])),
            reliable=not names[0].endswith(("best_effort", "2")),
            transient_local=names[1].endswith(("transient_local", "1")),
        )
    except (LookupError, TypeError, ValueError, OverflowError):
        return Quality(depth=10, transient_local=False)

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""rosbag2's metadata.yaml, version 9, and QoS profiles, as any version of rosbag2 writes them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from scenario_gen.bags.storage.files import NOT_RECORDED
from scenario_gen.types import Quality


@dataclass
class TopicInfo:
    """The metadata of a topic; `channel` is its number in the file."""

    name: str
    type: str
    quality: Quality
    type_hash: str
    channel: int
    count: int = 0


def metadata_yaml(
    file: str,
    topics: Sequence[TopicInfo],
    span_ns: tuple[int, int],
    not_recorded: Mapping[str, str],
) -> str:
    """Return the text of metadata.yaml of a bag with one file.

    Args:
        file: its name.
        topics: its topics.
        span_ns: first and last stamp; the first is the larger one if it is empty.
        not_recorded: says by topic what is missing.
    """
    first_ns = min(span_ns)
    statistics = {
        "starting_time": {"nanoseconds_since_epoch": first_ns},
        "duration": {"nanoseconds": span_ns[1] - first_ns},
        "message_count": sum(topic.count for topic in topics),
    }
    custom = {f"{NOT_RECORDED}{topic}": text for topic, text in not_recorded.items()}
    document = {
        "version": 9,
        "storage_identifier": "mcap",
        **statistics,
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
        "relative_file_paths": [file],
        "files": [{"path": file, **statistics}],
        "custom_data": custom or None,
        "ros_distro": "jazzy",
    }
    return _dump({"rosbag2_bagfile_information": document})


class _Dumper(yaml.CSafeDumper):  # type: ignore[misc]
    """Writes no anchors, which rosbag2's YAML reader does not accept."""

    def ignore_aliases(self, data: object) -> bool:
        return True


def _dump(value: Any) -> str:
    """Return YAML in the given order."""
    text: str = yaml.dump(value, Dumper=_Dumper, sort_keys=False)
    return text


def _profiles(quality: Quality) -> list[dict[str, Any]]:
    """Return an offered QoS profile in the list that rosbag2 writes."""
    infinite = {"sec": 9223372036, "nsec": 854775807}  # as rmw's
    profile = {
        "history": "keep_last",
        "depth": quality.depth,
        "reliability": "reliable" if quality.reliable else "best_effort",
        "durability": "transient_local" if quality.transient_local else "volatile",
        "deadline": infinite,
        "lifespan": infinite,
        "liveliness_lease_duration": infinite,
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

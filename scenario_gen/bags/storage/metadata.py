# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""rosbag2's metadata.yaml, version 9, and QoS profiles, as any version of rosbag2 writes them."""

from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import Any

import yaml

from scenario_gen.bags.storage.files import NOT_RECORDED
from scenario_gen.base.documents import parse_yaml
from scenario_gen.base.errors import InputError
from scenario_gen.types import Quality

_MAX_STAMP_NS = 2**63 - 1
_INFINITE = {"sec": 9223372036, "nsec": 854775807}  # rmw's infinite duration
_PROFILE_TYPES: dict[str, Any] = {
    "history": str | int,
    "depth": int,
    "reliability": str | int,
    "durability": str | int,
    "deadline": dict,
    "lifespan": dict,
    "liveliness": str | int,
    "liveliness_lease_duration": dict,
    "avoid_ros_namespace_conventions": bool,
}


class _Dumper(yaml.CSafeDumper):  # type: ignore[misc]
    """Writes no anchors: rosbag2's YAML reader does not accept them."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


@dataclass
class TopicInfo:
    """The metadata of a topic; `qos` is a YAML list of profiles."""

    name: str
    type: str
    qos: str
    type_hash: str
    count: int = 0

    @property
    def document(self) -> dict[str, Any]:
        """The topic as in metadata.yaml."""
        return {
            "topic_metadata": {
                "name": self.name,
                "type": self.type,
                "serialization_format": "cdr",
                "offered_qos_profiles": profiles(self.qos),
                "type_description_hash": self.type_hash,
            },
            "message_count": self.count,
        }


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


@dataclass
class BagInfo:
    """The metadata of a bag; `not_recorded` says by topic what is missing."""

    topics: list[TopicInfo] = field(default_factory=list)
    files: list[FileInfo] = field(default_factory=list)
    not_recorded: dict[str, str] = field(default_factory=dict)


def _statistics(files: list[FileInfo]) -> dict[str, Any]:
    """Return first stamp, duration and count of files as in metadata.yaml; zeros if empty."""
    used = [file for file in files if file.count]
    start_ns = min((file.start_ns for file in used), default=0)
    end_ns = max((file.end_ns for file in used), default=0)
    return {
        "starting_time": {"nanoseconds_since_epoch": start_ns},
        "duration": {"nanoseconds": end_ns - start_ns},
        "message_count": sum(file.count for file in used),
    }


def metadata_yaml(info: BagInfo) -> str:
    """Return the text of metadata.yaml."""
    not_recorded = {f"{NOT_RECORDED}{topic}": text for topic, text in info.not_recorded.items()}
    document = {
        "version": 9,
        "storage_identifier": "mcap",
        **_statistics(info.files),
        "topics_with_message_count": [topic.document for topic in info.topics],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.path for file in info.files],
        "files": [{"path": file.path, **_statistics([file])} for file in info.files],
        "custom_data": not_recorded or None,
        "ros_distro": "jazzy",
    }
    return _dump({"rosbag2_bagfile_information": document})


def _dump(value: Any) -> str:
    """Return YAML without anchors, in the given order."""
    text: str = yaml.dump(value, Dumper=_Dumper, sort_keys=False, default_flow_style=False)
    return text


@cache
def qos_yaml(quality: Quality) -> str:
    """Return an offered QoS profile as the list that rosbag2 writes."""
    profile = {
        "history": "keep_last",
        "depth": quality.depth,
        "reliability": "reliable" if quality.reliable else "best_effort",
        "durability": "transient_local" if quality.transient_local else "volatile",
        "deadline": _INFINITE,
        "lifespan": _INFINITE,
        "liveliness": "automatic",
        "liveliness_lease_duration": _INFINITE,
        "avoid_ros_namespace_conventions": False,
    }
    return _dump([profile]).rstrip("\n")


@lru_cache(maxsize=256)
def profiles(text: str) -> list[dict[str, Any]]:
    """Return the profiles in a YAML list; none if it is damaged, since they are not essential."""
    if not text:
        return []
    try:
        entries = parse_yaml(text, "offered_qos_profiles")
    except InputError:
        return []
    return entries if isinstance(entries, list) and all(map(_is_profile, entries)) else []


def _is_profile(entry: Any) -> bool:
    """Return whether an entry has what every reader needs."""
    if not isinstance(entry, dict):
        return False
    if not all(isinstance(entry.get(key), kind) for key, kind in _PROFILE_TYPES.items()):
        return False
    durations = (value for value in entry.values() if isinstance(value, dict))
    return all({"sec", "nsec"} <= value.keys() for value in durations)


def quality_of(text: str) -> Quality:
    """Return the quality of the first profile in a YAML list; by default volatile, depth 10."""
    known = profiles(text)
    if not known:
        return Quality(depth=10, transient_local=False)
    profile = known[0]
    # rosbag2 wrote rmw's numbers before Jazzy: best effort is 2, transient local is 1.
    return Quality(
        depth=max(1, profile["depth"]),
        reliable=str(profile["reliability"]).lower() not in ("best_effort", "2"),
        transient_local=str(profile["durability"]).lower() in ("transient_local", "1"),
    )

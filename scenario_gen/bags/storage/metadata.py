# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""rosbag2's metadata.yaml, version 9, written; QoS profiles, written, and read as any version of rosbag2 wrote them."""

from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import Any

import yaml

from scenario_gen.bags.storage.files import LOST
from scenario_gen.base.documents import parse_yaml
from scenario_gen.base.errors import InputError
from scenario_gen.types import Quality

ENTRIES = {
    **dict.fromkeys(("history", "reliability", "durability", "liveliness"), str | int),
    **dict.fromkeys(("deadline", "lifespan", "liveliness_lease_duration"), dict),
    **{"depth": int, "avoid_ros_namespace_conventions": bool},
}
FOREVER = {"sec": 9223372036, "nsec": 854775807}  # rmw's infinite duration


class _PlainDumper(yaml.CSafeDumper):  # type: ignore[misc]
    """No anchors: rosbag2's YAML reader does not want them."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


@dataclass
class TopicInfo:
    """The metadata of one topic; `qos` is a YAML list of profiles."""

    name: str
    type: str
    qos: str
    type_hash: str
    count: int = 0

    @property
    def document(self) -> dict[str, Any]:
        """As in metadata.yaml."""
        about: dict[str, Any] = {
            "name": self.name,
            "type": self.type,
            "serialization_format": "cdr",
        }
        about |= {
            "offered_qos_profiles": profiles(self.qos),
            "type_description_hash": self.type_hash,
        }
        return {"topic_metadata": about, "message_count": self.count}


@dataclass
class FileInfo:
    """The metadata of one file, or of several: stamps in nanoseconds."""

    path: str
    start_ns: int = 2**63 - 1
    end_ns: int = 0
    count: int = 0

    def add(self, start_ns: int, end_ns: int, count: int = 1) -> None:
        """Count messages between two stamps."""
        self.start_ns, self.end_ns = min(self.start_ns, start_ns), max(self.end_ns, end_ns)
        self.count += count

    @property
    def document(self) -> dict[str, Any]:
        """First stamp, duration and count as in metadata.yaml; zeros where there is no message."""
        start, duration = (self.start_ns, self.end_ns - self.start_ns) if self.count else (0, 0)
        times = {
            "starting_time": {"nanoseconds_since_epoch": start},
            "duration": {"nanoseconds": duration},
        }
        return times | {"message_count": self.count}


@dataclass
class BagInfo:
    """The metadata of a bag."""

    topics: list[TopicInfo] = field(default_factory=list)
    files: list[FileInfo] = field(default_factory=list)
    lost: dict[str, str] = field(default_factory=dict)  # topic -> what of it is not in the bag


def dump(value: Any) -> str:
    """Return YAML without anchors, in the order given."""
    text: str = yaml.dump(value, Dumper=_PlainDumper, sort_keys=False, default_flow_style=False)
    return text


@cache
def qos_yaml(quality: Quality) -> str:
    """Return the offered QoS profile as the list that rosbag2 writes."""
    profile = {
        "history": "keep_last",
        "depth": quality.depth,
        "reliability": "reliable" if quality.reliable else "best_effort",
        "durability": "transient_local" if quality.transient_local else "volatile",
        "deadline": FOREVER,
        "lifespan": FOREVER,
        "liveliness": "automatic",
        "liveliness_lease_duration": FOREVER,
        "avoid_ros_namespace_conventions": False,
    }
    return dump([profile]).rstrip("\n")


def metadata_yaml(info: BagInfo) -> str:
    """Return the text of metadata.yaml."""
    whole = FileInfo("")
    for file in info.files:
        whole.add(file.start_ns, file.end_ns, file.count)
    about = {"version": 9, "storage_identifier": "mcap", **whole.document}
    about |= {"topics_with_message_count": [topic.document for topic in info.topics]}
    about |= {
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.path for file in info.files],
    }
    about |= {"files": [{"path": file.path} | file.document for file in info.files]}
    about |= {
        "custom_data": {f"{LOST}{topic}": words for topic, words in info.lost.items()} or None,
        "ros_distro": "jazzy",
    }
    return dump({"rosbag2_bagfile_information": about})


@lru_cache(maxsize=256)
def profiles(text: str) -> list[dict[str, Any]]:
    """Return the profiles, none if the text is damaged: a bag can be read without them."""
    try:
        found = parse_yaml(text, "offered_qos_profiles") if text else []
    except InputError:
        return []
    return found if isinstance(found, list) and all(map(_is_whole, found)) else []


def _is_whole(profile: Any) -> bool:
    """Return whether a profile has the entries that every reader needs."""
    if not isinstance(profile, dict) or not all(
        isinstance(profile.get(key), kind) for key, kind in ENTRIES.items()
    ):
        return False
    return all(
        {"sec", "nsec"} <= set(value) for value in profile.values() if isinstance(value, dict)
    )


def quality_of(text: str) -> Quality:
    """Return the quality that the first of the profiles offers: volatile, depth 10 where there is none."""
    for profile in profiles(text)[:1]:
        reliable = str(profile["reliability"]).lower() not in (
            "best_effort",
            "2",
        )  # a number, as rosbag2 wrote before Jazzy
        return Quality(
            max(1, profile["depth"]),
            reliable,
            str(profile["durability"]).lower() in ("transient_local", "1"),
        )
    return Quality(depth=10, transient_local=False)

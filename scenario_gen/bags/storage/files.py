# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The files of a bag, and what its metadata.yaml says of them."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scenario_gen.base.documents import read_yaml, shown
from scenario_gen.base.errors import guarded, InputError

METADATA = "metadata.yaml"
NOT_RECORDED = "scenario_gen.lost:"
"""Prefix of the keys in custom_data that say what of a topic was not recorded."""

_SUFFIXES = (".mcap", ".db3", ".bag")


@dataclass(frozen=True)
class BagFiles:
    """The files of a bag in order.

    Attributes:
        files: their paths.
        compression: "", "file" or "message", as in rosbag2.
        count: number of messages by metadata.yaml, or None.
        custom: further entries of metadata.yaml.
    """

    files: tuple[Path, ...]
    compression: str = ""
    count: int | None = None
    custom: dict[Any, Any] = field(default_factory=dict)


def files_of(path: Path) -> BagFiles:
    """Return the files of a bag by metadata.yaml, or else those in its folder; none if no bag.

    Raises:
        InputError: metadata.yaml is damaged, or lists a file that does not exist.
    """
    if path.is_file():
        return BagFiles((path,) if path.suffix in _SUFFIXES else ())
    metadata = path / METADATA
    if not metadata.exists():
        return BagFiles(_files_in(path))
    try:
        return _listed(metadata)
    except InputError as error:
        remedy = f"`ros2 bag reindex {path}` writes it" if _files_in(path) else "copy the bag"
        raise InputError(f"{error}; {remedy} again") from error


def _files_in(folder: Path) -> tuple[Path, ...]:
    """Return the bag files in a folder; bag_10 follows bag_9."""
    try:
        files = [file for file in folder.iterdir() if file.suffix in _SUFFIXES and file.is_file()]
    except OSError as error:
        raise InputError(f"{folder}: {error.strerror}") from error
    return tuple(sorted(files, key=lambda file: (len(file.name), file.name)))


def _listed(metadata: Path) -> BagFiles:
    """Return the files that metadata.yaml lists.

    Raises:
        InputError: it is damaged, or a file does not exist.
    """
    with guarded(f"{metadata}: damaged, it does not list the files of a bag"):
        information = read_yaml(metadata)["rosbag2_bagfile_information"]
        names = information["relative_file_paths"]
        files = tuple(metadata.parent / Path(name).name for name in names)
        missing = [file for file in files if not file.is_file()]
        mode = str(information.get("compression_mode") or "none").lower()
        count, custom = information.get("message_count"), information.get("custom_data")
    if missing:
        raise InputError(f"{metadata} lists {shown(missing[0].name)}, which does not exist")
    return BagFiles(
        files,
        mode.replace("none", ""),
        count if isinstance(count, int) else None,
        custom if isinstance(custom, dict) else {},
    )

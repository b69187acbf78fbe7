# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The files of a bag, as its metadata.yaml lists them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenario_gen.base.documents import read_yaml, shown
from scenario_gen.base.errors import InputError

METADATA = "metadata.yaml"
NOT_RECORDED = "scenario_gen.lost:"
"""Prefix of the keys in custom_data that say what of a topic was not recorded."""

_SUFFIXES = (".mcap", ".db3", ".bag")


@dataclass(frozen=True)
class BagFiles:
    """The files of a bag in order; `compression` is "", "file" or "message", as in rosbag2."""

    files: tuple[Path, ...]
    compression: str = ""


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
        bag_files = _listed(_information(metadata), metadata)
    except InputError as error:
        remedy = "copy the bag again"
        files = ", ".join(file.name for file in _files_in(path)[:3])
        if files:
            remedy = f"`scenario-gen reindex {path}` writes it from the files ({files}, …)"
        raise InputError(f"{error}; {remedy}") from error
    for file in bag_files.files:
        if not file.is_file():
            raise InputError(
                f"{metadata} lists {shown(file.name)}, which does not exist; "
                f"`scenario-gen reindex {path}` reads the other files"
            )
    return bag_files


def _files_in(folder: Path) -> tuple[Path, ...]:
    """Return the bag files in a folder; bag_10 follows bag_9."""
    try:
        files = [file for file in folder.iterdir() if file.suffix in _SUFFIXES and file.is_file()]
    except OSError as error:
        raise InputError(f"{folder}: {error.strerror}") from error
    return tuple(sorted(files, key=lambda file: (len(file.name), file.name)))


def _information(metadata: Path) -> dict[str, Any]:
    """Return the content of metadata.yaml.

    Raises:
        InputError: it is not the metadata of a bag.
    """
    document = read_yaml(metadata)
    information = document.get("rosbag2_bagfile_information") if isinstance(document, dict) else 0
    if not isinstance(information, dict):
        raise InputError(f"{metadata}: damaged, it has no rosbag2_bagfile_information")
    return information


def _listed(information: dict[str, Any], metadata: Path) -> BagFiles:
    """Return the listed files.

    Raises:
        InputError: the list is damaged, or the compression is unknown.
    """
    names = information.get("relative_file_paths")
    if not isinstance(names, list):
        raise InputError(f"{metadata}: damaged, it has no relative_file_paths")
    for name in names:
        if not _is_file_name(name):
            raise InputError(
                f"{metadata}: damaged, relative_file_paths contains {shown(name)}, which is not "
                "the name of a file"
            )
    mode = shown(information.get("compression_mode") or "none").lower()
    compressor = shown(information.get("compression_format") or "")
    if mode != "none" and (mode not in ("file", "message") or compressor != "zstd"):
        raise InputError(
            f"{metadata}: compression {compressor!r} by {mode!r} is unknown; zstd by file or by "
            "message can be read"
        )
    files = tuple(metadata.parent / Path(name).name for name in names)
    return BagFiles(files, mode.replace("none", ""))


def _is_file_name(name: Any) -> bool:
    if not isinstance(name, str) or "\0" in name:
        return False
    return 0 < len(Path(name).name.encode()) <= 255


def metadata_warnings(path: Path) -> tuple[str, ...]:
    """Return warnings that metadata.yaml of a bag is missing, or names what was not recorded."""
    if not path.is_dir():
        return ()
    metadata = path / METADATA
    if not metadata.exists():
        warning = (
            f"{path} has no metadata.yaml: its files are read in order of their names; "
            f"`scenario-gen reindex {path}` writes it"
        )
        return (warning,) if _files_in(path) else ()
    try:
        entries = _information(metadata).get("custom_data")
    except InputError:
        return ()
    return tuple(
        f"not complete, by its recorder: {shown(str(key).removeprefix(NOT_RECORDED))}: "
        f"{shown(text, 400)}"
        for key, text in (entries.items() if isinstance(entries, dict) else ())
        if str(key).startswith(NOT_RECORDED)
    )

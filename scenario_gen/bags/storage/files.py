# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which files make up a bag."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenario_gen.base.documents import read_yaml, shown
from scenario_gen.base.errors import InputError

SUFFIXES = (".mcap", ".db3", ".bag")
METADATA = "metadata.yaml"
LOST = "scenario_gen.lost:"  # begins the keys of custom_data that name what is not in the bag, by topic


@dataclass(frozen=True)
class BagFiles:
    """The files of a bag in order; `compression` is "", "file" or "message", as rosbag2 calls it."""

    files: tuple[Path, ...]
    compression: str = ""


def files_of(path: Path) -> BagFiles:
    """Return the files of a bag: those that metadata.yaml lists, or else those in the folder; none if it is no bag.

    Raises:
        InputError: metadata.yaml is damaged, or lists a file that is not there.
    """
    if path.is_file():
        return BagFiles((path,) if path.suffix in SUFFIXES else ())
    metadata = path / METADATA
    if not metadata.exists():
        return BagFiles(_in_folder(path))
    try:
        names, compression = _listed(read_yaml(metadata), metadata)
    except InputError as error:
        there = ", ".join(file.name for file in _in_folder(path)[:3])
        remedy = f"`scenario-gen reindex {path}` makes it anew from its files ({there}, …)" if there else "copy the bag again"
        raise InputError(f"{error}; {remedy}") from error
    for name in names:
        if not (path / name).is_file():
            raise InputError(f"{metadata} lists {shown(name)}, which is not there; `scenario-gen reindex {path}` reads what is")
    return BagFiles(tuple(path / name for name in names), compression)


def _in_folder(path: Path) -> tuple[Path, ...]:
    try:
        found = [file for file in path.iterdir() if file.suffix in SUFFIXES and file.is_file()]
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from error
    return tuple(sorted(found, key=lambda file: (len(file.name), file.name)))


def _listed(document: Any, metadata: Path) -> tuple[list[str], str]:
    """Return the files' names and the mode of compression.

    Raises:
        InputError: the document does not hold them.
    """
    info = document.get("rosbag2_bagfile_information") if isinstance(document, dict) else None
    listed = info.get("relative_file_paths") if isinstance(info, dict) else None
    if not isinstance(info, dict) or not isinstance(listed, list):
        raise InputError(f"{metadata}: damaged, it lists no files under rosbag2_bagfile_information: relative_file_paths")
    for name in listed:
        if not isinstance(name, str) or not 0 < len(Path(name).name.encode()) < 256 or "\0" in name:
            raise InputError(f"{metadata}: damaged, relative_file_paths holds {shown(name)}, no file's name")
    mode = info.get("compression_mode") or ""
    kind = info.get("compression_format") or ""
    mode = mode.lower() if isinstance(mode, str) else shown(mode)
    if mode not in ("", "none", "file", "message"):
        raise InputError(f"{metadata}: compression_mode is {shown(mode)}; file and message are known")
    if mode in ("file", "message") and kind != "zstd":
        raise InputError(f"{metadata}: compression_format is {shown(kind)}; zstd is known")
    return [Path(name).name for name in listed], "" if mode == "none" else mode


def remarks(path: Path) -> tuple[str, ...]:
    """Return remarks on a bag's folder that is read though its metadata.yaml is missing, or names what was not recorded."""
    if not path.is_dir():
        return ()
    if (path / METADATA).exists():
        return tuple(f"not whole, by its recorder: {topic}: {words}" for topic, words in _lost(path / METADATA).items())
    if not _in_folder(path):
        return ()
    return (f"{path} has no metadata.yaml: its files are read in order of their names; `scenario-gen reindex {path}` writes it",)


def _lost(metadata: Path) -> dict[str, str]:
    """Return the recorder's notes on messages that it did not record, by topic."""
    try:
        custom = read_yaml(metadata)["rosbag2_bagfile_information"]["custom_data"]
        return {shown(key[len(LOST) :]): shown(text, 400) for key, text in custom.items() if key.startswith(LOST)}
    except (InputError, KeyError, TypeError, AttributeError):
        return {}

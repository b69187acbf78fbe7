# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Which files make up a bag."""

from contextlib import suppress
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
        remedy = (
            f"`scenario-gen reindex {path}` makes it anew from its files ({there}, …)"
            if there
            else "copy the bag again"
        )
        raise InputError(f"{error}; {remedy}") from error
    for name in names:
        if not (path / name).is_file():
            raise InputError(
                f"{metadata} lists {shown(name)}, which is not there; `scenario-gen reindex {path}` reads what is"
            )
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
        raise InputError(
            f"{metadata}: damaged, it lists no files under rosbag2_bagfile_information: relative_file_paths"
        )
    for name in listed:
        if (
            not isinstance(name, str)
            or not 0 < len(Path(name).name.encode()) < 256
            or "\0" in name
        ):
            raise InputError(
                f"{metadata}: damaged, relative_file_paths holds {shown(name)}, no file's name"
            )
    mode, kind = (shown(info.get(f"compression_{key}") or "") for key in ("mode", "format"))
    if mode.lower() not in ("", "none", "file", "message") or (
        mode.lower() in ("file", "message") and kind != "zstd"
    ):
        raise InputError(
            f"{metadata}: compression {kind!r} by {mode!r}; zstd by file or message is known"
        )
    return [Path(name).name for name in listed], mode.lower().replace("none", "")


def remarks(path: Path) -> tuple[str, ...]:
    """Return remarks on a bag's folder that is read though its metadata.yaml is missing, or names what was not recorded."""
    if not path.is_dir():
        return ()
    if not (path / METADATA).exists():
        words = f"has no metadata.yaml: its files are read in order of their names; `scenario-gen reindex {path}` writes it"
        return (f"{path} {words}",) if _in_folder(path) else ()
    with suppress(InputError, KeyError, TypeError, AttributeError):
        custom = read_yaml(path / METADATA)["rosbag2_bagfile_information"]["custom_data"]
        notes = {
            key.removeprefix(LOST): text for key, text in custom.items() if key.startswith(LOST)
        }
        return tuple(
            f"not whole, by its recorder: {shown(topic)}: {shown(text, 400)}"
            for topic, text in notes.items()
        )
    return ()

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Definitions and hashes of message types: Jazzy's from rosbags, others from installed packages.

Those of our own bags are stored in `resources/definitions.json`, as rosbags writes them: loading
rosbags' types takes long, since it parses seven releases of ROS. The file also has Autoware's
perception messages with the fields of autoware_perception_msgs 1.11.0 for Jazzy
(autowarefoundation/autoware_msgs), which are in no package index.
"""

from functools import cache
import json
import os
from pathlib import Path
from typing import Any

from scenario_gen.base.errors import InputError

PREDICTED = "autoware_perception_msgs/msg/PredictedObjects"
TRACKED = "autoware_perception_msgs/msg/TrackedObjects"

_STORED = Path(__file__).resolve().parents[2] / "resources" / "definitions.json"
_MAX_ROS1_DEFINITION_BYTES = 64 * 1024


@cache
def type_store() -> Any:
    """Return rosbags' store of Jazzy's and Autoware's types, which decodes their messages."""
    from rosbags.typesys import get_types_from_msg, get_typestore, Stores  # slow to import

    store = get_typestore(Stores.ROS2_JAZZY)
    for kind in (PREDICTED, TRACKED):
        text, _ = stored_definitions()[kind]
        store.register(get_types_from_msg(text, kind))
    return store


@cache
def ros1_types(kind: str, text: str) -> Any:
    """Return a store that converts messages of ROS 1 to CDR, by the definition in their bag.

    Raises:
        InputError: the definition is too long.
        Exception: rosbags' own, if it is damaged, or has other fields than in ROS 2.
    """
    from rosbags.typesys import get_types_from_msg, get_typestore, Stores

    if len(text) > _MAX_ROS1_DEFINITION_BYTES:
        raise InputError(
            f"its definition has {len(text)} characters; at most {_MAX_ROS1_DEFINITION_BYTES} "
            "can be read"
        )
    types = get_types_from_msg(text, kind)
    types.pop("std_msgs/msg/Header", None)  # ROS 2's header has no seq, which rosbags omits
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(types)
    return store


def _register_installed(kind: str) -> None:
    """Register a type and those of its fields from the packages on AMENT_PREFIX_PATH.

    Raises:
        InputError: a package is not installed.
    """
    from rosbags.typesys import get_types_from_msg

    package, _, name = kind.partition("/msg/")
    prefixes = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
    paths = (Path(prefix) / "share" / package / "msg" / f"{name}.msg" for prefix in prefixes)
    file = next((path for path in paths if path.is_file()), None)
    if file is None:
        raise InputError(
            f"message type {kind} is unknown: no {package}/msg/{name}.msg on AMENT_PREFIX_PATH; "
            "source its workspace"
        )
    store = type_store()
    types = get_types_from_msg(file.read_text(encoding="utf-8"), kind)
    for _constants, fields in types.values():
        for _name, (node, description) in fields:
            is_list = node.name in ("ARRAY", "SEQUENCE")
            inner = description[0][1] if is_list else description
            if isinstance(inner, str) and inner not in store.fielddefs:
                _register_installed(inner)
    store.register(types)


@cache
def stored_definitions() -> dict[str, tuple[str, str]]:
    """Return text and hash of the stored definitions, by type."""
    document = json.loads(_STORED.read_text(encoding="utf-8"))
    return {kind: (entry["text"], entry["hash"]) for kind, entry in document.items()}


@cache
def definition(kind: str) -> tuple[str, str]:
    """Return the ros2msg definition of a type with nested types, and its RIHS01 hash (REP 2011).

    Raises:
        InputError: the type is neither a standard one nor installed.
    """
    if kind in stored_definitions():
        return stored_definitions()[kind]
    store = type_store()
    if kind not in store.fielddefs:
        _register_installed(kind)
    text, _ = store.generate_msgdef(kind, ros_version=2)
    return text, store.hash_rihs01(kind)

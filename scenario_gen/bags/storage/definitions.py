# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Definitions and hashes of types: Jazzy's from rosbags, others from an installed package.

Those of our own bags are kept in `resources/definitions.json`, in rosbags' words: to load rosbags' types takes long, because it
parses seven releases of ROS. Autoware's perception messages are there too, with the fields that autoware_perception_msgs 1.11.0
has for Jazzy (autowarefoundation/autoware_msgs): they are in no package index.
"""

from functools import cache
import json
import os
from pathlib import Path
from typing import Any

from scenario_gen.base.errors import InputError

PREDICTED, TRACKED = (
    f"autoware_perception_msgs/msg/{name}" for name in ("PredictedObjects", "TrackedObjects")
)
KEPT = Path(__file__).resolve().parents[2] / "resources" / "definitions.json"
MOST_TEXT = 64 * 1024  # characters of a definition in a bag of ROS 1


@cache
def type_store() -> Any:
    """Return rosbags' store of Jazzy's types and Autoware's, which decodes messages of them."""
    from rosbags.typesys import get_types_from_msg, get_typestore, Stores  # slow to import

    store = get_typestore(Stores.ROS2_JAZZY)
    for kind in (PREDICTED, TRACKED):
        store.register(get_types_from_msg(kept()[kind][0], kind))
    return store


@cache
def ros1_types(kind: str, text: str) -> Any:
    """Return a store that turns messages of ROS 1 into CDR, by the definition in their bag.

    Raises:
        InputError: the definition is too long.
        Exception: rosbags' own, where it is damaged, or has other fields than ROS 2's of that name.
    """
    from rosbags.typesys import get_types_from_msg, get_typestore, Stores

    if len(text) > MOST_TEXT:
        raise InputError(
            f"its definition has {len(text)} characters; at most {MOST_TEXT} are read"
        )
    store, types = get_typestore(Stores.ROS2_JAZZY), get_types_from_msg(text, kind)
    types.pop("std_msgs/msg/Header", None)  # that of ROS 2 has no seq, which rosbags leaves out
    store.register(types)
    return store


def _register_installed(kind: str) -> None:
    """Read `kind` and the types of its fields from the share folders of AMENT_PREFIX_PATH."""
    from rosbags.typesys import get_types_from_msg

    package, _, name = kind.partition("/msg/")
    prefixes = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
    paths = [Path(prefix) / "share" / package / "msg" / f"{name}.msg" for prefix in prefixes]
    file = next((path for path in paths if path.is_file()), None)
    if file is None:
        raise InputError(
            f"message type {kind} is unknown: no {package}/msg/{name}.msg on AMENT_PREFIX_PATH; source its workspace"
        )
    store, types = type_store(), get_types_from_msg(file.read_text(encoding="utf-8"), kind)
    for _constants, fields in types.values():
        for _field, (node, what) in fields:
            inner = what[0][1] if node.name in ("ARRAY", "SEQUENCE") else what
            if isinstance(inner, str) and inner not in store.fielddefs:
                _register_installed(inner)
    store.register(types)


@cache
def kept() -> dict[str, tuple[str, str]]:
    """Return the definitions in `resources/definitions.json`, by type, as `definition` does."""
    document = json.loads(KEPT.read_text(encoding="utf-8"))
    return {kind: (entry["text"], entry["hash"]) for kind, entry in document.items()}


@cache
def definition(kind: str) -> tuple[str, str]:
    """Return the full ros2msg definition text of a type, nested types included, and its RIHS01 hash (REP 2011).

    Raises:
        InputError: the type is neither a standard one nor installed.
    """
    if kind in kept():
        return kept()[kind]
    store = type_store()
    if kind not in store.fielddefs:
        _register_installed(kind)
    text, _ = store.generate_msgdef(kind, ros_version=2)
    return text, store.hash_rihs01(kind)

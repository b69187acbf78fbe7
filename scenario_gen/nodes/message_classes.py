"""ROS message classes by their name."""

import importlib
from typing import Any

from scenario_gen.errors import InputError


def message_class(kind: str) -> Any:
    """Return the class of e.g. `nav_msgs/msg/Path`.

    Raises:
        InputError: the package is not installed or has no such type.
    """
    package, _, name = kind.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError, ValueError):
        raise InputError(f"message type {kind} is not installed; source the workspace that has {package or 'it'}") from None

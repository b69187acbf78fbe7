# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Names of an earlier version, which go on to work for one version and say what the new name is."""

from typing import Any
import warnings


def warn_renamed(old: str, new: str, stacklevel: int = 2) -> None:
    """Warn, at the caller's caller by default, that a name is another one now."""
    text = f"{old} is now {new}; the old name goes with the next version"
    warnings.warn(text, DeprecationWarning, stacklevel=stacklevel + 1)


class Renamed:
    """An attribute or method by its earlier name: `old = Renamed("new")` in the body of a class."""

    def __init__(self, new: str) -> None:
        self.new = new

    def __set_name__(self, owner: type, name: str) -> None:
        self.old = name

    def __get__(self, instance: object, owner: type | None = None) -> Any:
        """Return what the new name gives, with a warning; of the class, this object."""
        if instance is None:
            return self
        warn_renamed(f"{type(instance).__name__}.{self.old}", self.new)
        return getattr(instance, self.new)

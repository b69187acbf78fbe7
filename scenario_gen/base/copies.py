# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Temporary copies of inputs, such as unpacked files; messages name the inputs instead."""

from collections.abc import Iterator
from contextlib import contextmanager

from scenario_gen.base.errors import ScenarioGenError

_copies: dict[str, str] = {}  # {path of a copy: name of its input}; a path is never reused


@contextmanager
def naming_inputs(names: dict[str, str]) -> Iterator[None]:
    """Let errors, and texts that pass `renamed`, name the inputs of copies {path: name}."""
    _copies.update(names)
    try:
        yield
    except ScenarioGenError as error:
        error.args = (renamed(str(error)),)
        raise
    finally:
        for path in names:
            _copies.pop(path, None)


def renamed(text: str) -> str:
    """Return a text with the paths of copies replaced by the names of their inputs."""
    # Longer paths first, since one path may begin with another one.
    for path in sorted(_copies, key=len, reverse=True):
        text = text.replace(path, _copies.get(path, path))
    return text

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""URLs as arguments of commands: what a command reads is copied to files first, what it writes goes to the store at its end."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, ExitStack
from pathlib import Path
from typing import Any, get_args, get_type_hints

import typer

from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.base.folders import scratch
from scenario_gen.base.stores import fetched, naming_objects, place, Remote, temporary, upload, url_of

READ = ("log", "parameter_file", "against")  # options that name an input; those of all other options are written


def paths_of(command: Callable[..., None], own: Sequence[str]) -> dict[str, bool]:
    """Return {name: whether it is written} of the parameters that are paths, without the command's `own`, whose URLs it takes."""
    found = {}
    for name, annotation in get_type_hints(command, include_extras=True).items():
        kind, info = (*get_args(annotation), None, None)[:2]
        if name not in own and (kind is Path or Path in get_args(kind)):
            found[name] = name == "out" or (type(info) is type(typer.Option()) and name not in READ)
    return found


@contextmanager
def as_files(values: Mapping[str, Any], written: Mapping[str, bool]) -> Iterator[dict[str, Any]]:
    """Give a command's values with files in place of URLs; what it writes is in the store afterwards, also if it refuses some.

    Args:
        values: of the parameters.
        written: for those that are paths, whether the command writes them.

    Raises:
        InputError: a store lets nobody in, or holds something where is to be written.
    """
    urls = {name: [one for one in _listed(values[name]) if url_of(one)] for name in written}
    if not any(urls.values()):
        yield dict(values)
        return
    uploads: list[tuple[Path, Remote]] = []
    with ExitStack() as stack:
        local: dict[Path, Path] = {}
        for name, own in urls.items():
            for one in own:
                there = place(one, to_write=written[name])
                local[one] = there if isinstance(there, Path) else _copy(there, stack, uploads if written[name] else None)
        try:
            yield {name: _replaced(value, local) if name in written else value for name, value in values.items()}
        except (typer.Exit, RefusedError):
            _put(uploads)
            raise
        _put(uploads)


def _listed(value: Any) -> list[Path]:
    """Return the paths of a value: one, several or none."""
    return [] if value is None else list(value) if isinstance(value, list) else [value]


def _replaced(value: Any, local: Mapping[Path, Path]) -> Any:
    """Return a value with files in place of URLs."""
    return [local.get(one, one) for one in value] if isinstance(value, list) else local.get(value, value)


def _copy(there: Remote, stack: ExitStack, uploads: list[tuple[Path, Remote]] | None) -> Path:
    """Return a copy of what a command reads, or with `uploads` the path where it writes.

    Raises:
        InputError: there is something already where is to be written.
    """
    if uploads is None:
        return stack.enter_context(fetched([there]))[0]
    if there.exists():
        raise InputError(f"{there} is there already, and nothing in a store is replaced; name another place, or remove it")
    path = stack.enter_context(scratch(temporary())) / there.name
    stack.enter_context(naming_objects({str(path): there.url}))
    uploads.append((path, there))
    return path


def _put(uploads: Sequence[tuple[Path, Remote]]) -> None:
    for path, there in uploads:
        if path.exists():
            upload(path, there)

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
from scenario_gen.base.stores import (
    fetched,
    naming_objects,
    place,
    Remote,
    temporary,
    upload,
    url_of,
)

READ = (
    "log",
    "parameter_file",
    "against",
)  # options that name an input; those of all other options are written


def paths_of(command: Callable[..., None], own: Sequence[str]) -> dict[str, bool]:
    """Return {name: whether it is written} of the parameters that are paths, without the command's `own`, whose URLs it takes."""
    found = {}
    for name, annotation in get_type_hints(command, include_extras=True).items():
        kind, info = (*get_args(annotation), None, None)[:2]
        if name not in own and (kind is Path or Path in get_args(kind)):
            found[name] = name == "out" or (
                type(info) is type(typer.Option()) and name not in READ
            )
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
    uploads: list[tuple[Path, Remote]] = []
    with ExitStack() as stack:

        def local(one: Path, *, to_write: bool) -> Path:
            """Return the file that stands for what a URL names."""
            there = place(one, to_write=to_write) if url_of(one) else one
            if isinstance(there, Path):
                return there
            if not to_write:
                return stack.enter_context(fetched([there]))[0]
            if there.exists():
                raise InputError(
                    f"{there} is there already, and nothing in a store is replaced; name another place, or remove it"
                )
            path = stack.enter_context(scratch(temporary())) / there.name
            stack.enter_context(naming_objects({str(path): there.url}))
            uploads.append((path, there))
            return path

        files = dict(values)
        for name, to_write in written.items():
            value = values[name]
            several = [
                local(one, to_write=to_write)
                for one in (value if isinstance(value, list) else [value])
                if one is not None
            ]
            files[name] = several if isinstance(value, list) else several[0] if several else None
        refused: Exception | None = None
        try:
            yield files
        except (typer.Exit, RefusedError) as error:
            refused = error
        for path, there in uploads:
            if path.exists():
                upload(path, there)
        if refused is not None:
            raise refused

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""URLs as arguments of commands: inputs are copied to files, outputs are uploaded at the end."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, ExitStack
from functools import partial
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
    temp_folder,
    upload,
    url_of,
)

INPUT_OPTIONS = ("log", "recording", "parameter_file", "against")
"""Options that name an input; all other options with a path name an output."""


def paths_of(command: Callable[..., None], skipped: Sequence[str]) -> dict[str, bool]:
    """Return, for each path parameter of a command except `skipped`, whether it is an output."""
    paths = {}
    for name, annotation in get_type_hints(command, include_extras=True).items():
        kind, info = (*get_args(annotation), None, None)[:2]
        if name not in skipped and (kind is Path or Path in _members(kind)):
            is_option = type(info) is type(typer.Option())
            paths[name] = name == "out" or (is_option and name not in INPUT_OPTIONS)
    return paths


def _members(kind: Any) -> set[Any]:
    """Return the arguments of a type and of its arguments, as of list[Path] | None."""
    arguments = get_args(kind)
    return {*arguments, *(inner for argument in arguments for inner in get_args(argument))}


def _converted(value: Any, convert: Callable[[Path], Path]) -> Any:
    """Return a parameter with its path, or each path of its list, converted; None stays None."""
    if value is None:
        return None
    if isinstance(value, list):
        return [convert(path) for path in value]
    return convert(value)


@contextmanager
def as_files(values: Mapping[str, Any], outputs: Mapping[str, bool]) -> Iterator[dict[str, Any]]:
    """Yield a command's values with files in place of URLs; upload its outputs afterwards.

    Outputs are also uploaded if the command refuses a part of the request.

    Args:
        values: of the parameters.
        outputs: whether each path among them is an output.

    Raises:
        InputError: a store denies access, or an output exists already.
    """
    uploads: list[tuple[Path, Remote]] = []
    with ExitStack() as stack:

        def local(path: Path, *, is_output: bool) -> Path:
            """Return the file in place of a path or URL."""
            remote = place(path, to_write=is_output) if url_of(path) else path
            if isinstance(remote, Path):
                return remote
            if not is_output:
                return stack.enter_context(fetched([remote]))[0]
            if remote.exists():
                raise InputError(
                    f"{remote} exists, and objects are never overwritten; choose another place"
                )
            file = stack.enter_context(scratch(temp_folder())) / remote.name
            stack.enter_context(naming_objects({str(file): remote.url}))
            uploads.append((file, remote))
            return file

        files = dict(values)
        for name, is_output in outputs.items():
            files[name] = _converted(values[name], partial(local, is_output=is_output))
        refused: Exception | None = None
        try:
            yield files
        except (typer.Exit, RefusedError) as error:
            refused = error
        for file, remote in uploads:
            if file.exists():
                upload(file, remote)
        if refused is not None:
            raise refused

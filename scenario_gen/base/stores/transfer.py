# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Objects of a store to files and back: fetched in blocks, side by side, in bounded memory; written whole or not at all.

A store has no locks and no names that change places. What a result is of is therefore its first object, which is created only
where there is none yet: whoever comes second agrees with it or is refused. All else is a function of it, so that two writers
write the same bytes.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
import tempfile
from typing import Any, NamedTuple

from scenario_gen.base.errors import InputError, ScenarioGenError
from scenario_gen.base.folders import naming, scratch
from scenario_gen.base.stores.remote import fresh, Place, Remote, tried

BLOCK = 8 << 20  # bytes that are asked for at once
AT_ONCE = 64 << 20  # bytes of blocks in memory
REQUESTS = 64  # of one round


class Part(NamedTuple):
    """Bytes of an object, and the file that takes them, at the same offsets."""

    source: Remote
    begin: int
    end: int
    target: Path


def temporary() -> Path:
    """Return the folder in which fetched objects lie meanwhile: TMPDIR."""
    return Path(tempfile.gettempdir())


def below(path: Place, above: Place) -> str:
    """Return the name of a file or an object within a folder, with slashes."""
    if isinstance(path, Remote):
        return path.url.removeprefix(str(above)).lstrip("/")
    return path.relative_to(str(above)).as_posix()


def workplace(folder: Place) -> Path:
    """Return where intermediate files of results in `folder` lie: there, or for a store on this machine."""
    return temporary() if isinstance(folder, Remote) else folder


def size_of(path: Place) -> int:
    """Return the size of a file or an object in bytes."""
    return path.looked_up().size if isinstance(path, Remote) else path.stat().st_size


def download(parts: Iterable[Part]) -> None:
    """Copy parts of objects to files.

    Raises:
        InputError: an object is not there, has changed its size, or cannot be read.
        OSError: the disk is full; it names the file.
    """
    waiting: list[Part] = []
    room = AT_ONCE
    for part in _blocks(parts):
        if len(waiting) == REQUESTS or part.end - part.begin > room:
            _copy(waiting)
            waiting, room = [], AT_ONCE
        waiting.append(part)
        room -= part.end - part.begin
    _copy(waiting)


def _blocks(parts: Iterable[Part]) -> Iterator[Part]:
    """Cut parts into blocks; the file of a part is there afterwards, also that of an empty one."""
    for part in parts:
        part.target.parent.mkdir(parents=True, exist_ok=True)
        with naming(part.target):
            part.target.touch()
        for begin in range(part.begin, part.end, BLOCK):
            yield part._replace(begin=begin, end=min(begin + BLOCK, part.end))


def _copy(parts: Sequence[Part]) -> None:
    for _, group in groupby(parts, key=lambda part: id(part.source.there()[0])):  # of one account
        own = list(group)
        for part, data in zip(own, _read(own), strict=True):
            if len(data) != part.end - part.begin:
                raise InputError(
                    f"{part.source} gave {len(data)} bytes where {part.end - part.begin} were asked for: it has changed, or the "
                    "server reads no parts of files; start again, or download it first"
                )
            with naming(part.target), part.target.open("r+b") as file:
                file.seek(part.begin)
                file.write(data)


def _read(parts: Sequence[Part]) -> Iterator[bytes]:
    """Yield the bytes of each part; those that failed side by side are asked for again one by one."""
    system, paths = parts[0].source.there()[0], [part.source.there()[1] for part in parts]
    whole = [part.begin == 0 and part.end == part.source.size for part in parts]  # without a range, which not all servers know
    spans = [(None, None) if all_of_it else (part.begin, part.end) for part, all_of_it in zip(parts, whole, strict=True)]
    answers: list[Any] = tried(
        parts[0].source, lambda: system.cat_ranges(paths, [a for a, _ in spans], [b for _, b in spans], on_error="return")
    )
    for part, path, (begin, end), answer in zip(parts, paths, spans, answers, strict=True):
        if isinstance(answer, bytes):
            yield answer
            continue

        def again(path: str = path, begin: int | None = begin, end: int | None = end) -> bytes:
            data: bytes = system.cat_file(path, start=begin, end=end)
            return data

        yield tried(part.source, again)


def each_fetched(places: Sequence[Place]) -> Iterator[tuple[Place, Path]]:
    """Yield each place with its file, as `fetched` gives it, a few at a time: each file is gone after those that follow it."""
    for first in range(0, len(places), REQUESTS):
        own = places[first : first + REQUESTS]
        with fetched(own) as here:
            yield from zip(own, here, strict=True)


@contextmanager
def fetched(places: Sequence[Place]) -> Iterator[list[Path]]:
    """Give files as they are, and objects as files of the same names in folders of the same names; messages name the objects.

    Args:
        places: files, objects, or folders of either. Objects of one folder come to lie in one folder.

    Raises:
        InputError: an object is not there or cannot be read.
        OSError: the disk is full.
    """
    remote = [found.looked_up() for found in places if isinstance(found, Remote)]
    if not remote:
        yield [found for found in places if isinstance(found, Path)]
        return
    with scratch(temporary()) as own:
        folders: dict[str, Path] = {}
        parts: list[Part] = []
        local: dict[Remote, Path] = {}
        for found in remote:
            folder = folders.setdefault(found.parent.url, own / str(len(folders)) / (found.parent.name or "store"))
            local[found] = folder / found.name
            parts += _whole(found, local[found])
        with naming_objects({str(path): found.url for found, path in local.items()}):
            download(parts)
            yield [local[found] if isinstance(found, Remote) else found for found in places]


def _whole(found: Remote, target: Path) -> list[Part]:
    """Return what is to be copied of an object, or of all objects of a folder."""
    if found.size >= 0:
        return [Part(found, 0, found.size, target)]
    inside = list(found.rglob("*"))
    return [Part(one, 0, one.size, target / below(one, found)) for one in inside]


def read(found: Remote) -> bytes:
    """Return the content of a small object.

    Raises:
        InputError: it is not there, or cannot be read.
    """
    system, path = found.there()
    data: bytes = tried(found, lambda: fresh(system).cat_file(path))
    return data


_copies: dict[str, str] = {}  # {path: URL} of files that stand for objects; paths are never used twice


@contextmanager
def naming_objects(names: dict[str, str]) -> Iterator[None]:
    """Let errors, and texts that are `renamed`, name objects instead of the files {path: URL} that stand for them."""
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
    """Return a text with URLs instead of the paths of copies; longer paths first, for one may begin with another."""
    for path in sorted(_copies, key=len, reverse=True) if _copies else ():
        text = text.replace(path, _copies.get(path, path))
    return text


def upload(source: Path, target: Remote) -> None:
    """Copy a file to an object, or all files of a folder: each object is whole or not there, whoever is killed.

    Raises:
        InputError: the store refuses it or goes on failing.
    """
    system, _ = target.there()
    files = sorted(path for path in source.rglob("*") if path.is_file()) if source.is_dir() else [source]
    for file in files:
        own = target if file == source else target / file.relative_to(source).as_posix()
        tried(own, lambda file=file, own=own: system.put_file(str(file), own.there()[1]))  # type: ignore[misc]


def create(target: Remote, data: bytes) -> bool:
    """Write a small object where there is none; return False if there is one, from another writer or from a try of ours.

    Raises:
        InputError: the store refuses it or goes on failing.
    """
    system, path = target.there()
    if target.exists():
        return False
    try:
        tried(target, lambda: system.pipe_file(path, data, mode="create"))
    except FileExistsError:
        return False
    return True

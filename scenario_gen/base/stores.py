# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Object stores (s3, gs, abfs) and the web, by URL, through fsspec: what is there, objects to files, and files to objects.

A `Remote` has the few names of `Path` that commands need, so the same lines ask either what is there; a reader takes a `Path`
alone, and mypy says where an object has to be fetched first.

A store has no locks and no names that change places. What a result is of is therefore its first object, which is created only
where there is none yet: whoever comes second agrees with it or is refused. All else is a function of it, so that two writers
write the same bytes.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path, PurePosixPath
import re
import tempfile
from typing import Any, NamedTuple, TypeVar

from scenario_gen.base.errors import describe, guarded, InputError, needs, ScenarioGenError
from scenario_gen.base.folders import naming, scratch

Result = TypeVar("Result")
URL = re.compile(
    r"([A-Za-z][A-Za-z0-9+.-]+):/+(.*)", re.DOTALL
)  # one slash: a Path drops the second
WRITTEN, READ = ("s3", "gs", "gcs", "abfs", "abfss", "az"), ("http", "https")
S3 = {
    "max_concurrency": 2,  # parts of a long object in memory at a time, 50 MiB each
    "config_kwargs": {"retries": {"mode": "standard", "total_max_attempts": 8}},
}
BLOCK_BYTES, REQUESTS = 4 << 20, 16  # that are in memory at once
TOGETHER = 64  # files that `each_fetched` keeps


@dataclass(frozen=True, order=True)
class Remote:
    """An object of a store, or all objects below it, as a folder; nothing is looked up before it is asked for.

    Attributes:
        url: without a slash at its end.
        size: bytes of the object, -1 where nobody has looked.
    """

    url: str
    size: int = field(default=-1, compare=False)

    def __str__(self) -> str:
        return self.url

    def __truediv__(self, name: str) -> "Remote":
        return Remote(f"{self.url}/{name}")

    @property
    def name(self) -> str:
        """The last part; of a web address without its query."""
        scheme, _, path = self.url.partition("://")
        return PurePosixPath(path.partition("?")[0] if scheme in READ else path).name

    @property
    def stem(self) -> str:
        """The last part without its suffix."""
        return PurePosixPath(self.name).stem

    @property
    def parent(self) -> "Remote":
        """What the object lies in."""
        return Remote(self.url.rpartition("/")[0])

    def with_suffix(self, suffix: str) -> "Remote":
        """Return the object of that ending beside this one."""
        return self.parent / f"{self.stem}{suffix}"

    def there(self) -> tuple[Any, str]:
        """Return fsspec's file system, without what it remembers of others' doings, and the path in it.

        Raises:
            InputError: the library of the store is not installed, or lacks a setting.
        """
        needs("stores", "fsspec")
        from fsspec.core import url_to_fs

        with guarded(self.url):
            system, path = url_to_fs(self.url, **(S3 if self.url.startswith("s3:") else {}))
            system.invalidate_cache()
        return system, path

    def asked(
        self, operation: Callable[[Any, str], Result], missing: Callable[[], Result] | None = None
    ) -> Result:
        """Return what an operation on file system and path returns; the library of the store tries again what fails for a while.

        Args:
            operation: calls the file system and nothing else.
            missing: makes the answer where there is no such object.

        Raises:
            InputError: there is no such object, the store lets nobody in, or it goes on failing.
            FileExistsError: the operation's own.
        """
        system, path = self.there()
        try:
            return operation(system, path)
        except FileExistsError:
            raise
        except FileNotFoundError as error:
            if missing is not None:
                return missing()
            raise InputError(f"{self} does not exist; check bucket and name") from error
        except Exception as error:
            advice = "check address and credentials; the same command goes on where it stopped"
            raise InputError(f"{self}: {describe(error)}; {advice}") from error

    def exists(self) -> bool:
        """Return whether there is an object of that name, or objects below it."""
        return bool(self.asked(lambda system, path: system.exists(path)))

    def looked_up(self) -> "Remote":
        """Return the object with its size; of a folder it stays unknown.

        Raises:
            InputError: there is nothing of that name.
        """
        if self.size >= 0:
            return self
        facts: dict[str, Any] = self.asked(lambda system, path: system.info(path))
        if facts.get("type") == "directory" or str(facts.get("mimetype")).startswith(
            "text/html"
        ):  # the list of a web server
            return self
        if facts.get("size") is None:
            raise InputError(f"{self}: the server does not say how long it is; download it first")
        return Remote(self.url, int(facts["size"]))

    def rglob(self, pattern: str) -> Iterator["Remote"]:
        """Yield the objects below, at any depth, whose names match, in order; none where there is nothing."""
        root = self.there()[1]
        listed: dict[str, Any] = self.asked(
            lambda system, path: system.find(path, detail=True), missing=dict
        )
        for path, facts in sorted(listed.items()):
            own = path.removeprefix(root).lstrip("/")
            if (
                own
                and facts.get("type") != "directory"
                and not path.endswith("/")
                and fnmatch(PurePosixPath(path).name, pattern)
            ):
                size = facts.get("size")
                yield Remote(f"{self}/{own}", -1 if size is None else int(size)).looked_up()

    def glob(self, pattern: str) -> Iterator["Remote"]:
        """Yield those of `rglob` that are no deeper."""
        return (found for found in self.rglob(pattern) if found.parent == self)


Place = Path | Remote
"""Where something is, or will be: in the file system or in a store."""


class Part(NamedTuple):
    """Bytes of an object, and the file that takes them, at the same offsets."""

    source: Remote
    begin: int
    end: int
    target: Path


def url_of(text: object) -> str:
    """Return the URL that a text or a Path was, "" if it is none; one slash may have been dropped."""
    found = URL.fullmatch(str(text))
    return f"{found[1].lower()}://{found[2].rstrip('/')}" if found else ""


def place(text: str | Path, *, to_write: bool = False) -> Place:
    """Return the place that a URL or a path names; `file://` is a path.

    Raises:
        InputError: the scheme is not known, or is to be written and cannot be.
    """
    url = url_of(text)
    scheme, _, rest = url.partition("://")
    if not url or scheme == "file":
        return Path("/" + rest.lstrip("/")) if url else Path(text)
    if not rest or scheme not in WRITTEN + (() if to_write else READ):
        why = (
            f"{scheme} is only read"
            if scheme in READ
            else f"{scheme} is not read or written, or a bucket's name is missing"
        )
        raise InputError(f"{url}: {why}; name a file or folder, or a place in s3, gs or abfs")
    return Remote(url)


def local(path: Path, use: str) -> Path:
    """Return a path that is no URL.

    Raises:
        InputError: it is one, and `use` takes files and folders alone.
    """
    if url := url_of(path):
        raise InputError(f"{url}: {use} takes a file or folder; copy it first")
    return path


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
    """Copy parts of objects to files, in blocks, some at once.

    Raises:
        InputError: an object is not there, has changed its size, or cannot be read.
        OSError: the disk is full; it names the file.
    """
    blocks = []
    for part in parts:
        part.target.parent.mkdir(parents=True, exist_ok=True)
        with naming(part.target):
            part.target.touch()
        starts = range(part.begin, part.end, BLOCK_BYTES)
        blocks += [
            part._replace(begin=begin, end=min(begin + BLOCK_BYTES, part.end)) for begin in starts
        ]
    with ThreadPoolExecutor(REQUESTS) as pool:
        for _ in pool.map(_copy, blocks):  # the first that fails ends the others
            pass


def _copy(part: Part) -> None:
    source, begin, end, target = part
    whole = (
        begin == 0 and end == source.size
    )  # is read without a range, which not all servers know
    bounds = {} if whole else {"start": begin, "end": end}
    data = source.asked(lambda system, path: bytes(system.cat_file(path, **bounds)))
    if len(data) != end - begin:
        why = "it has changed, or the server reads no parts of files; start again, or download it first"
        raise InputError(
            f"{source} gave {len(data)} bytes where {end - begin} were asked for: {why}"
        )
    with naming(target), target.open("r+b") as file:
        file.seek(begin)
        file.write(data)


def each_fetched(places: Sequence[Place]) -> Iterator[tuple[Place, Path]]:
    """Yield each place with its file, as `fetched` gives it, a few at a time: each file is gone after those that follow it."""
    for first in range(0, len(places), TOGETHER):
        own = places[first : first + TOGETHER]
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
        local: dict[Remote, Path] = {}
        parts: list[Part] = []
        for found in remote:
            folder = folders.setdefault(
                found.parent.url, own / str(len(folders)) / (found.parent.name or "store")
            )
            local[found] = folder / found.name
            objects = [found] if found.size >= 0 else found.rglob("*")
            parts += [Part(one, 0, one.size, local[found] / below(one, found)) for one in objects]
        with naming_objects({str(path): found.url for found, path in local.items()}):
            download(parts)
            yield [local[found] if isinstance(found, Remote) else found for found in places]


_copies: dict[
    str, str
] = {}  # {path: URL} of files that stand for objects; paths are never used twice


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
    if source.is_dir():
        for inside in sorted(source.iterdir()):
            upload(inside, target / inside.name)
    else:
        target.asked(lambda system, path: system.put_file(str(source), path))


def create(target: Remote, data: bytes) -> bool:
    """Write a small object where there is none; return False if there is one, from another writer or from a try of ours.

    Raises:
        InputError: the store refuses it or goes on failing.
    """
    try:
        if not target.exists():
            target.asked(lambda system, path: system.pipe_file(path, data, mode="create"))
            return True
    except FileExistsError:
        pass
    return False

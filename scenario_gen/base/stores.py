# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Object stores (s3, gs, abfs) and the web, by URL, through fsspec.

A `Remote` has those methods of `Path` that the commands need, so the same code lists folders and
stores. A reader accepts only a `Path`: mypy reports where an object has to be fetched first.

A store has neither locks nor an atomic rename. The first object of a result is therefore its
manifest, which is created only if there is none yet; a second writer has to agree with it. All
other objects follow from the manifest, so that two writers write the same bytes.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
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

# One slash is enough, since a Path drops the second one.
URL = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+):/+(.*)", re.DOTALL)
WRITABLE_SCHEMES = ("s3", "gs", "gcs", "abfs", "abfss", "az")
READ_ONLY_SCHEMES = ("http", "https")
S3 = {
    "max_concurrency": 2,  # parts of a long object in memory at the same time, 50 MiB each
    "config_kwargs": {"retries": {"mode": "standard", "total_max_attempts": 8}},
}
BLOCK_BYTES = 4 << 20
FETCHED_FILE_COUNT = 64  # files on disk at the same time in `each_fetched`


@dataclass(frozen=True, order=True)
class Remote:
    """An object in a store, or a folder of objects; creating one makes no request.

    Attributes:
        url: without a trailing slash.
        size: bytes of the object; -1 if it is unknown.
        version: of its content, as the store names it; "" if it is unknown.
    """

    url: str
    size: int = field(default=-1, compare=False)
    version: str = field(default="", compare=False)

    def __str__(self) -> str:
        return self.url

    def __truediv__(self, name: str) -> "Remote":
        return Remote(f"{self.url}/{name}")

    @property
    def name(self) -> str:
        """The last part of the path; the query of a web address is left out."""
        scheme, _, path = self.url.partition("://")
        if scheme in READ_ONLY_SCHEMES:
            path = path.partition("?")[0]
        return PurePosixPath(path).name

    @property
    def stem(self) -> str:
        """The last part of the path without its suffix."""
        return PurePosixPath(self.name).stem

    @property
    def parent(self) -> "Remote":
        """The folder of the object."""
        return Remote(self.url.rpartition("/")[0])

    def with_suffix(self, suffix: str) -> "Remote":
        """Return the object in the same folder with another suffix."""
        return self.parent / f"{self.stem}{suffix}"

    def file_system(self) -> tuple[Any, str]:
        """Return fsspec's file system, which caches no listings, and the path in it.

        Raises:
            InputError: the library for the store is not installed, or a setting is missing.
        """
        needs("stores", "fsspec")
        from fsspec.core import url_to_fs

        options = S3 if self.url.startswith("s3:") else {}
        with guarded(self.url):
            system, path = url_to_fs(self.url, use_listings_cache=False, **options)
        return system, path

    def call(
        self, operation: Callable[[Any, str], Result], missing: Callable[[], Result] | None = None
    ) -> Result:
        """Return the result of an operation; the store's library repeats failed requests.

        Args:
            operation: calls the file system, given the file system and the path.
            missing: returns the result if there is no such object.

        Raises:
            InputError: there is no such object, access is denied, or the store keeps failing.
            FileExistsError: raised by the operation.
        """
        system, path = self.file_system()
        try:
            return operation(system, path)
        except FileExistsError:
            raise
        except FileNotFoundError as error:
            if missing is not None:
                return missing()
            raise InputError(f"{self} does not exist; check bucket and name") from error
        except Exception as error:
            advice = "check address and credentials; the same command resumes where it stopped"
            raise InputError(f"{self}: {describe(error)}; {advice}") from error

    def exists(self) -> bool:
        """Return whether there is an object with this name, or a folder of objects."""
        return bool(self.call(lambda system, path: system.exists(path)))

    def with_size(self) -> "Remote":
        """Return the object with its size; the size of a folder stays unknown.

        Raises:
            InputError: there is no such object, or the server does not report its size.
        """
        if self.size >= 0:
            return self
        info: dict[str, Any] = self.call(lambda system, path: system.info(path))
        # A web server describes a folder by a page with links.
        is_index = str(info.get("mimetype")).startswith("text/html")
        if is_index or info.get("type") == "directory":
            return self
        if info.get("size") is None:
            raise InputError(f"{self}: the server does not report its size; download it first")
        return self._described(info)

    def _described(self, info: Mapping[str, Any]) -> "Remote":
        """Return the object with the size and the version that the store reports."""
        size = info.get("size")
        versions = [info[name] for name in ("ETag", "etag", "LastModified") if info.get(name)]
        return Remote(self.url, -1 if size is None else int(size), str((*versions, "")[0]))

    def rglob(self, pattern: str) -> Iterator["Remote"]:
        """Yield the objects at any depth whose names match, sorted; none if there is no folder."""
        root = self.file_system()[1]
        listing: dict[str, Any] = self.call(
            lambda system, path: system.find(path, detail=True), missing=dict
        )
        for path, info in sorted(listing.items()):
            relative = path.removeprefix(root).lstrip("/")
            is_folder = info.get("type") == "directory" or path.endswith("/")
            if is_folder or not relative or not fnmatch(PurePosixPath(path).name, pattern):
                continue
            yield Remote(f"{self}/{relative}")._described(info).with_size()

    def glob(self, pattern: str) -> Iterator["Remote"]:
        """Yield the objects directly in this folder whose names match, sorted."""
        return (entry for entry in self.rglob(pattern) if entry.parent == self)


Place = Path | Remote
"""A file or folder in the file system or in a store."""


class Part(NamedTuple):
    """Bytes of an object, and the file that they are copied to at the same offsets."""

    source: Remote
    begin: int
    end: int
    target: Path


def url_of(text: object) -> str:
    """Return the URL in a text or a Path, "" if it is none; a Path has dropped one slash."""
    match = URL.fullmatch(str(text))
    return f"{match[1].lower()}://{match[2].rstrip('/')}" if match else ""


def place(text: str | Path, *, to_write: bool = False) -> Place:
    """Return the place with a URL or a path; `file://` is a path.

    Raises:
        InputError: the scheme is unknown, or it cannot be written although `to_write` is set.
    """
    url = url_of(text)
    if not url:
        return Path(text)
    scheme, _, path = url.partition("://")
    if scheme == "file":
        return Path("/" + path.lstrip("/"))
    schemes = WRITABLE_SCHEMES if to_write else WRITABLE_SCHEMES + READ_ONLY_SCHEMES
    if path and scheme in schemes:
        return Remote(url)
    if scheme in READ_ONLY_SCHEMES:
        why = f"{scheme} is read-only"
    else:
        why = f"{scheme} is not supported, or the bucket name is missing"
    raise InputError(f"{url}: {why}; name a file or folder, or a place in s3, gs or abfs")


def require_local(path: Path, use: str) -> Path:
    """Return a path that is not a URL.

    Raises:
        InputError: it is a URL, and `use` reads only files and folders.
    """
    if url := url_of(path):
        raise InputError(f"{url}: {use} takes a file or folder; copy it first")
    return path


def temp_folder() -> Path:
    """Return the folder for fetched objects: TMPDIR."""
    return Path(tempfile.gettempdir())


def relative_name(path: Place, folder: Place) -> str:
    """Return the name of a file or an object relative to a folder, with slashes."""
    if isinstance(path, Remote):
        return path.url.removeprefix(str(folder)).lstrip("/")
    return path.relative_to(str(folder)).as_posix()


def workplace(folder: Place) -> Path:
    """Return the folder for intermediate files: `folder` itself, or TMPDIR for a store."""
    return temp_folder() if isinstance(folder, Remote) else folder


def size_of(path: Place) -> int:
    """Return the size of a file or an object in bytes."""
    return path.with_size().size if isinstance(path, Remote) else path.stat().st_size


def identity_of(path: Place) -> tuple[str, int, str]:
    """Return what tells whether a file or an object has changed: name, size, time or version."""
    if isinstance(path, Remote):
        remote = path.with_size()
        return remote.url, remote.size, remote.version
    status = path.stat()
    return str(path.resolve()), status.st_size, str(status.st_mtime_ns)


def remove(places: Sequence[Place]) -> None:
    """Remove files, or objects of one store.

    Raises:
        InputError: the store refuses it or keeps failing.
    """
    for path in places:
        if isinstance(path, Path):
            path.unlink(missing_ok=True)
    objects = [entry for entry in places if isinstance(entry, Remote)]
    if objects:
        paths = [entry.file_system()[1] for entry in objects]
        objects[0].call(lambda system, _: system.rm(paths))


def download(parts: Iterable[Part]) -> None:
    """Copy parts of objects to files, in blocks, several at the same time.

    Raises:
        InputError: an object is missing, has changed its size, or cannot be read.
        OSError: the disk is full; the message names the file.
    """
    blocks = []
    for part in parts:
        part.target.parent.mkdir(parents=True, exist_ok=True)
        with naming(part.target):
            part.target.touch()
        begins = range(part.begin, part.end, BLOCK_BYTES)
        blocks += [part._replace(begin=k, end=min(k + BLOCK_BYTES, part.end)) for k in begins]
    with ThreadPoolExecutor(16) as pool:  # at most 16 blocks are in memory
        # The first error ends the other downloads.
        for _ in pool.map(_copy, blocks):
            pass


def _copy(part: Part) -> None:
    source = part.source
    # The web is read without a range if possible, since some servers do not support ranges. A
    # store would be asked for the size first; one byte more shows that an object has grown.
    is_end = part.end == source.size
    is_whole = part.begin == 0 and is_end and source.url.startswith(READ_ONLY_SCHEMES)
    bounds = {} if is_whole else {"start": part.begin, "end": part.end + is_end}
    data = source.call(lambda system, path: bytes(system.cat_file(path, **bounds)))
    expected = part.end - part.begin
    if len(data) != expected:
        why = "it has changed, or the server does not support ranges"
        remedy = "start again, or download it first"
        raise InputError(f"{source}: got {len(data)} bytes, not {expected}: {why}; {remedy}")
    with naming(part.target), part.target.open("r+b") as file:
        file.seek(part.begin)
        file.write(data)


def each_fetched(places: Sequence[Place]) -> Iterator[tuple[Place, Path]]:
    """Yield each place with its local file; a copy is removed when its batch has been read."""
    for first in range(0, len(places), FETCHED_FILE_COUNT):
        batch = places[first : first + FETCHED_FILE_COUNT]
        with fetched(batch) as files:
            yield from zip(batch, files, strict=True)


@contextmanager
def fetched(places: Sequence[Place]) -> Iterator[list[Path]]:
    """Give the local files of places: objects are copied, files and folders are used directly.

    A copy has the object's name, in a folder with the name of the object's folder. Error messages
    name the object, not the copy.

    Args:
        places: files, objects, or folders. Objects from one folder are copied to one folder.

    Raises:
        InputError: an object is missing or cannot be read.
        OSError: the disk is full.
    """
    remotes = [entry.with_size() for entry in places if isinstance(entry, Remote)]
    if not remotes:
        yield [entry for entry in places if isinstance(entry, Path)]
        return
    with scratch(temp_folder()) as root:
        copies = _copy_paths(remotes, root)
        parts: list[Part] = []
        for remote, copy in copies.items():
            objects = [remote] if remote.size >= 0 else remote.rglob("*")
            parts += [
                Part(entry, 0, entry.size, copy / relative_name(entry, remote))
                for entry in objects
            ]
        with naming_objects({str(copy): remote.url for remote, copy in copies.items()}):
            download(parts)
            yield [copies[entry] if isinstance(entry, Remote) else entry for entry in places]


def _copy_paths(remotes: Sequence[Remote], root: Path) -> dict[Remote, Path]:
    """Return the path of each object's copy in `root`."""
    folders: dict[str, Path] = {}
    copies = {}
    for remote in remotes:
        parent = remote.parent
        folder = root / str(len(folders)) / (parent.name or "store")
        copies[remote] = folders.setdefault(parent.url, folder) / remote.name
    return copies


_copies: dict[str, str] = {}  # {path of a copy: URL of its object}; a path is never reused


@contextmanager
def naming_objects(names: dict[str, str]) -> Iterator[None]:
    """Let errors, and texts that pass `renamed`, name the objects of copies {path: URL}."""
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
    """Return a text with the paths of copies replaced by the URLs of their objects."""
    # Longer paths first, since one path may begin with another one.
    for path in sorted(_copies, key=len, reverse=True):
        text = text.replace(path, _copies.get(path, path))
    return text


def upload(source: Path, target: Remote) -> None:
    """Copy a file or all files of a folder to a store; an object is never partly written.

    Raises:
        InputError: the store refuses an object or keeps failing.
    """
    if source.is_dir():
        for entry in sorted(source.iterdir()):
            upload(entry, target / entry.name)
    else:
        target.call(lambda system, path: system.put_file(str(source), path))


def create(target: Remote, data: bytes) -> bool:
    """Write a small object if there is none; return False if one exists already.

    An existing object comes from another writer, or from an earlier attempt of this one.

    Raises:
        InputError: the store refuses it or keeps failing.
    """
    try:
        if not target.exists():
            target.call(lambda system, path: system.pipe_file(path, data, mode="create"))
            return True
    except FileExistsError:
        pass
    return False

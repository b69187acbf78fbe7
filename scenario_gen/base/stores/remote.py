# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Places outside of the file system: objects of a store, by URL. What a library of a store raises becomes one of our errors.

A `Remote` has the few names of `Path` that commands need, so the same lines ask either what is there; a reader takes a `Path`
alone, and mypy says where an object has to be fetched first (`transfer.py`).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from fnmatch import fnmatch
from importlib.util import find_spec
from pathlib import Path, PurePosixPath
import re
import time
from typing import Any, TypeVar

from scenario_gen.base.errors import describe, InputError, MissingExtraError, needs

Result = TypeVar("Result")
URL = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+):/+(.*)", re.DOTALL)  # one slash: a Path drops the second
PAUSES = (0.5, 2.0, 5.0)  # s before an operation is tried again; before that the library has tried several times
LIBRARIES = {"aiobotocore", "aiohttp", "azure", "botocore", "fsspec", "gcsfs", "google", "s3fs"}  # whose errors may pass
AWS = "set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY (and AWS_ENDPOINT_URL where it is not Amazon's), or write ~/.aws/config"
GOOGLE = "set GOOGLE_APPLICATION_CREDENTIALS, or run `gcloud auth application-default login`"
AZURE = "set AZURE_STORAGE_ACCOUNT_NAME and AZURE_STORAGE_ACCOUNT_KEY, or AZURE_STORAGE_CONNECTION_STRING"
WEB = "the server refuses it; check the address, or download it first"


@dataclass(frozen=True)
class Scheme:
    """A kind of store: the library that fsspec needs for it, the remedy where it refuses access, whether it can be written."""

    library: str
    remedy: str
    writable: bool = True
    options: dict[str, Any] = field(default_factory=dict)


SCHEMES = {
    "s3": Scheme("s3fs", AWS, options={"max_concurrency": 2}),  # parts of a long object in memory at a time, 50 MiB each
    **dict.fromkeys(("gs", "gcs"), Scheme("gcsfs", GOOGLE)),
    **dict.fromkeys(("abfs", "abfss", "az"), Scheme("adlfs", AZURE)),
    **dict.fromkeys(("http", "https"), Scheme("aiohttp", WEB, writable=False)),
}
KNOWN = "s3, gs, abfs, http, https and file"


@dataclass(frozen=True, order=True)
class Remote:
    """An object of a store, or all objects below it, as a folder; nothing is looked up before it is asked for.

    Attributes:
        url: without a slash at its end.
        size: bytes of the object, -1 where nobody has looked.
        etag: by which the store tells contents apart, "" likewise.
    """

    url: str
    size: int = field(default=-1, compare=False)
    etag: str = field(default="", compare=False)

    def __str__(self) -> str:
        return self.url

    def __truediv__(self, name: str) -> "Remote":
        return Remote(f"{self.url}/{name}")

    @property
    def scheme(self) -> Scheme:
        """The kind of store."""
        return SCHEMES[self.url.partition(":")[0]]

    @property
    def _name(self) -> PurePosixPath:
        path = self.url.partition("?")[0] if not self.scheme.writable else self.url  # of a web address without its query
        return PurePosixPath(path.partition("://")[2])

    @property
    def name(self) -> str:
        """The last part."""
        return self._name.name

    @property
    def stem(self) -> str:
        """The last part without its suffix."""
        return self._name.stem

    @property
    def suffix(self) -> str:
        """The ending of the last part, with its dot."""
        return self._name.suffix

    @property
    def parent(self) -> "Remote":
        """What the object lies in."""
        return Remote(self.url.rpartition("/")[0])

    def with_suffix(self, suffix: str) -> "Remote":
        """Return the object of that ending beside this one."""
        return self.parent / f"{self.stem}{suffix}"

    def there(self) -> tuple[Any, str]:
        """Return fsspec's file system and the path in it.

        Raises:
            MissingExtraError: the library of the store is not installed.
        """
        if self.scheme.library in ("s3fs", "aiohttp"):
            needs("stores", "fsspec", self.scheme.library)
        elif find_spec(self.scheme.library) is None:
            raise MissingExtraError(f"{self}: {self.scheme.library} not installed; `pip install {self.scheme.library}` brings it")
        from fsspec.core import url_to_fs

        system, path = url_to_fs(self.url, **self.scheme.options)
        return system, path

    def exists(self) -> bool:
        """Return whether there is an object of that name, or objects below it."""
        system, path = self.there()
        return bool(tried(self, lambda: fresh(system).exists(path)))

    def looked_up(self) -> "Remote":
        """Return the object with size and etag; of a folder the size stays unknown.

        Raises:
            InputError: there is nothing of that name.
        """
        if self.size >= 0:
            return self
        system, path = self.there()
        facts = tried(self, lambda: fresh(system).info(path))
        if facts.get("type") == "directory" or str(facts.get("mimetype")).startswith("text/html"):  # the list of a web server
            return self
        found = self._seen(facts)
        if found.size < 0:
            raise InputError(f"{self}: the server does not say how long it is; download it first")
        return found

    def _seen(self, facts: dict[str, Any]) -> "Remote":
        found = next((str(facts[key]) for key in ("ETag", "etag", "md5Hash") if facts.get(key)), "")
        size = facts.get("size")
        return replace(self, size=-1 if size is None else int(size), etag=found.strip('"'))

    def rglob(self, pattern: str) -> Iterator["Remote"]:
        """Yield the objects below, at any depth, whose names match, in order; none where there is nothing."""
        system, root = self.there()
        listed = tried(self, lambda: fresh(system).find(root, detail=True), missing=dict)
        for path, facts in sorted(listed.items()):
            below = path.removeprefix(root).lstrip("/")
            if (
                facts.get("type") != "directory"
                and below
                and not path.endswith("/")
                and fnmatch(path.rpartition("/")[2], pattern)
            ):
                yield (self / below)._seen(facts).looked_up()

    def glob(self, pattern: str) -> Iterator["Remote"]:
        """Yield those of `rglob` that are no deeper."""
        return (found for found in self.rglob(pattern) if found.parent == self)


Place = Path | Remote
"""Where something is, or will be: in the file system or in a store."""


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
    if not url:
        return Path(text)
    scheme, _, rest = url.partition("://")
    if scheme == "file":
        return Path("/" + rest.lstrip("/"))
    if scheme not in SCHEMES:
        raise InputError(f"{url}: {scheme} is not read or written; {KNOWN} are")
    if not rest:
        raise InputError(f"{url}: name a bucket or a host, too")
    if to_write and not SCHEMES[scheme].writable:
        raise InputError(f"{url}: {scheme} is only read; name a folder, or a place in s3, gs or abfs")
    return Remote(url)


def local(path: Path, use: str) -> Path:
    """Return a path that is no URL.

    Raises:
        InputError: it is one, and `use` takes files and folders alone.
    """
    url = url_of(path)
    if url:
        raise InputError(f"{url}: {use} takes a file or folder; copy it first")
    return path


def fresh(system: Any) -> Any:
    """Return the file system without what it remembers of others' doings."""
    system.invalidate_cache()
    return system


def tried(what: Remote, operation: Callable[[], Result], missing: Callable[[], Result] | None = None) -> Result:
    """Return what an operation on a store returns; one that fails for a while is tried again, a few times.

    Args:
        what: it is about; begins the messages.
        operation: may be done twice.
        missing: makes the answer where there is no such object.

    Raises:
        InputError: there is no such object, the store lets nobody in, or it goes on failing.
        FileExistsError: the operation's own.
    """
    for pause in (*PAUSES, None):
        try:
            return operation()
        except FileExistsError:
            raise
        except FileNotFoundError as error:
            if missing is not None:
                return missing()
            raise InputError(f"{what} does not exist; check bucket and name") from error
        except Exception as error:
            if not _of_a_library(error):
                raise
            if _is_refusal(error):
                raise InputError(f"{what}: {describe(error)}; {what.scheme.remedy}") from error
            if pause is None:
                raise InputError(
                    f"{what}: {describe(error)} (tried {len(PAUSES) + 1} times); the same command goes on where it stopped"
                ) from error
        time.sleep(pause)
    raise AssertionError


def _of_a_library(error: Exception) -> bool:
    """Return whether an error is of the system or of a store's library, and no fault of ours."""
    return isinstance(error, OSError | TimeoutError) or type(error).__module__.partition(".")[0] in LIBRARIES


def _is_refusal(error: Exception) -> bool:
    """Return whether a store lets nobody in, so that to ask again is of no use."""
    names = {kind.__name__ for kind in type(error).__mro__}
    return (
        isinstance(error, PermissionError)
        or bool(names & {"NoCredentialsError", "PartialCredentialsError", "ProfileNotFound", "DefaultCredentialsError"})
        or "ClientAuthenticationError" in names
        or getattr(error, "status", None) in (401, 403)
    )

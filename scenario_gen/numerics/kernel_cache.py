# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The cache of compiled kernels: numba's own, in one folder per content of a source file.

Compiled code is run, so a cache that another account could write to is not used.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from hashlib import sha256
import os
from pathlib import Path
import platform
import re
import tempfile

from scenario_gen.base.errors import InputError
from scenario_gen.base.folders import own_folder
from scenario_gen.numerics.numba_import import numba

OPTIONS = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
"""How numba compiles every kernel."""

PACKAGE = Path(__file__).parents[1]
_DECORATED = re.compile(rb"^@kernel\(", re.MULTILINE)
_IMPORT = re.compile(rb"^from (scenario_gen[\w.]*) import ([^(\n]+|\([^)]*\))", re.MULTILINE)
_PROCESSOR_FACTS = ("vendor_id", "cpu family", "model", "flags", "Features")
_NAME = re.compile(rb"\w+")


@cache
def _has_kernels(file: Path) -> bool:
    """Return whether a file exists and holds kernels."""
    return file.is_file() and _DECORATED.search(file.read_bytes()) is not None


def sources() -> list[Path]:
    """Return the files of the package that hold kernels."""
    return list(filter(_has_kernels, sorted(PACKAGE.rglob("*.py"))))


@cache
def _imported(source: Path) -> frozenset[Path]:
    """Return the files with kernels that a file imports directly."""
    modules: set[str] = set()
    for module, names in _IMPORT.findall(source.read_bytes()):
        modules.add(module.decode())
        modules |= {f"{module.decode()}.{name.decode()}" for name in _NAME.findall(names)}
    paths = {PACKAGE.parent.joinpath(*module.split(".")).with_suffix(".py") for module in modules}
    return frozenset(filter(_has_kernels, paths))


def _with_imports(source: Path) -> list[Path]:
    """Return a file and all files with kernels that it imports, directly or not."""
    reached = {source}
    waiting = [source]
    while waiting:
        new = _imported(waiting.pop()) - reached
        reached |= new
        waiting += new
    return sorted(reached)


@cache
def _chosen_root() -> tuple[Path, str]:
    """Return the folder of all caches, and why it does not last, "" if it does."""
    user = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache") / "scenario_gen"
    fault = "set NUMBA_CACHE_DIR to a folder that can be written to"
    try:
        place = Path(numba.config.CACHE_DIR or user.expanduser()).resolve()
        own_folder(place)
        tempfile.TemporaryFile(dir=place).close()
    except InputError as error:
        fault = f"{error}, or set NUMBA_CACHE_DIR to a folder of your own"
    except (OSError, RuntimeError):  # RuntimeError: the user has no home
        pass
    else:
        return place, ""
    return Path(_temporary().name), fault


def root() -> Path:
    """Return the folder of all caches.

    `NUMBA_CACHE_DIR`, the user's cache, or a temporary folder of this process.
    """
    return _chosen_root()[0]


@cache
def folder(source: Path) -> Path:
    """Return the folder for the compiled kernels of one source file.

    Its name is a hash of the processor, the versions of Python and numba, and the content of the
    file and of the files with kernels that it imports. So a kernel is compiled again when a file
    that it calls has changed, and is found by a copy of the package elsewhere.
    """
    versions = (numba.__version__, platform.python_version())
    digest = sha256(repr((OPTIONS, _processor(), versions)).encode())
    for file in _with_imports(source):
        digest.update(file.name.encode())
        digest.update(_content(file))
    place = root() / f"kernels-{digest.hexdigest()[:16]}"
    place.mkdir(mode=0o700, exist_ok=True)
    return place


@cache
def _content(file: Path) -> bytes:
    """Return the hash of a file, which several others may import."""
    return sha256(file.read_bytes()).digest()


@cache
def _processor() -> tuple[str, ...]:
    """Return the name and the features of the processor that kernels are compiled for."""
    requested = (str(numba.config.CPU_NAME), str(numba.config.CPU_FEATURES))
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return (platform.machine(), platform.processor(), *requested)
    facts = dict(line.split(":", 1) for line in reversed(lines) if ":" in line)
    facts = {name.strip(): value.strip() for name, value in facts.items()}
    return (*(facts.get(name, "") for name in _PROCESSOR_FACTS), *requested)


class Locator:
    """The place of a function's cache, for numba.

    Numba's own locators use the path of the source, so that a copy would be compiled again.
    """

    def __init__(self, source: str) -> None:
        self._source = Path(source)

    @classmethod
    def from_function(cls, _function: object, source: str) -> "Locator":
        """Return the place for a function of a file."""
        return cls(source)

    def ensure_cache_path(self) -> None:
        """Do nothing: the folder exists."""

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(folder(self._source))

    def get_source_stamp(self) -> str:
        """Return the version of the source."""
        return folder(self._source).name

    def get_disambiguator(self) -> str:
        """Return what distinguishes files with functions of the same name in one folder."""
        return self._source.stem


@contextmanager
def used_by_numba(source: Path) -> Iterator[None]:
    """Let functions that are compiled within the block use the cache of a source file."""
    settings = {"CACHE_DIR": str(folder(source))}
    if hasattr(numba.config, "CACHE_LOCATOR_CLASSES"):  # since numba 0.61
        settings["CACHE_LOCATOR_CLASSES"] = f"{__name__}.{Locator.__name__}"
    before = {name: getattr(numba.config, name) for name in settings}
    try:
        for name, value in settings.items():
            setattr(numba.config, name, value)
        yield
    finally:
        for name, value in before.items():
            setattr(numba.config, name, value)


@cache
def _temporary() -> tempfile.TemporaryDirectory[str]:
    """Return a folder that is removed with this process."""
    return tempfile.TemporaryDirectory(prefix="scenario_gen-kernels-")


def temporary_because() -> str:
    """Return why other processes will not find the kernels that this one compiles; "" if not."""
    return _chosen_root()[1]

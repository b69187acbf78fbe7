# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The cache of compiled kernels: numba's own, in one folder per version of a source file."""

from functools import cache
from hashlib import sha256
import os
from pathlib import Path
import platform
import re
import tempfile

import numba

PACKAGE = Path(__file__).parents[1]
_DECORATED = re.compile(rb"^@kernel\(", re.MULTILINE)
_IMPORT = re.compile(rb"^from (scenario_gen[\w.]*) import ([^(\n]+|\([^)]*\))", re.MULTILINE)
_NAME = re.compile(rb"\w+")


@cache
def sources() -> tuple[Path, ...]:
    """Return the files of the package that hold kernels."""
    return tuple(
        file for file in sorted(PACKAGE.rglob("*.py")) if _DECORATED.search(file.read_bytes())
    )


@cache
def _imported(source: Path) -> frozenset[Path]:
    """Return the files with kernels that a file imports directly."""
    modules: set[str] = set()
    for module, names in _IMPORT.findall(source.read_bytes()):
        modules.add(module.decode())
        modules |= {f"{module.decode()}.{name.decode()}" for name in _NAME.findall(names)}
    paths = {PACKAGE.parent.joinpath(*module.split(".")).with_suffix(".py") for module in modules}
    return frozenset(paths.intersection(sources()))


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
def root() -> Path:
    """Return the folder of all caches.

    `NUMBA_CACHE_DIR`, the user's cache, or a temporary folder of this process.
    """
    user = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache") / "scenario_gen"
    try:
        folder = Path(numba.config.CACHE_DIR or user.expanduser())
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except (OSError, RuntimeError):  # RuntimeError: the user has no home
        return Path(_temporary().name)
    return folder


@cache
def folder(source: Path) -> Path:
    """Return the folder for the compiled kernels of one source file.

    Its name is a hash of the versions of Python and numba, and of path, time and size of the file
    and of the files with kernels that it imports. So a kernel is compiled again when a file that
    it calls has changed.
    """
    stamps = [
        (str(file), file.stat().st_mtime_ns, file.stat().st_size) for file in _with_imports(source)
    ]
    versions = (numba.__version__, platform.python_version())
    digest = sha256(repr((stamps, versions)).encode()).hexdigest()[:16]
    place = root() / f"kernels-{digest}"
    place.mkdir(mode=0o700, exist_ok=True)
    return place


@cache
def _temporary() -> tempfile.TemporaryDirectory[str]:
    """Return a folder that is removed with this process."""
    return tempfile.TemporaryDirectory(prefix="scenario_gen-kernels-")


def is_lasting() -> bool:
    """Return whether other processes will find the kernels that this one compiles."""
    return _temporary.cache_info().currsize == 0

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Where compiled kernels are kept: by what they are compiled from, not by where their sources lie.

A clone, a copy of it and what colcon installs share one folder, and none compiles what another has compiled. numba itself keeps
kernels beside their sources, and looks only at the file of the kernel, not at what it calls.
"""

from collections.abc import Callable, Iterator
from enum import EnumType
from functools import cache
from hashlib import sha256
import os
from pathlib import Path
import shutil
import stat
import tempfile
from time import time
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numba
from numba.core.caching import _CacheLocator, CompileResultCacheImpl, FunctionCache, NullCache
from numba.core.runtime.nrt import rtsys
import numpy as np

DIGITS = 24  # of the name of a kernel's folder
UNUSED = 60.0 * 86400.0  # s after which what no kernel of this version needs is swept

_described: dict[FunctionType, frozenset[str]] = {}


@cache
def folder() -> Path | None:
    """Return the folder of all kernels: `NUMBA_CACHE_DIR`, the user's cache, or a temporary one; None if there is none."""
    if numba.config.CACHE_DIR:
        places = [Path(numba.config.CACHE_DIR)]
    else:
        user = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser()
        places = [user / "scenario_gen" / "kernels", Path(tempfile.gettempdir()) / f"scenario_gen_kernels_{os.getuid()}"]
    return next((place for place in places if _is_ours(place)), None)


def _is_ours(place: Path) -> bool:
    """Say whether a folder can be written to, and by this user alone: what is kept there is run."""
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        place.mkdir(mode=0o700, exist_ok=True)
        status = place.lstat() if not numba.config.CACHE_DIR else place.stat()
        tempfile.TemporaryFile(dir=place).close()
    except (OSError, RuntimeError):  # the latter: the user has no home
        return False
    own = stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o022
    return own or bool(numba.config.CACHE_DIR)


def keep(compiled: Any) -> Any:
    """Return the cache of a compiled function, which it gets at the first call."""
    if isinstance(compiled._cache, NullCache) and folder() is not None:
        compiled._cache = KernelCache(getattr(compiled, "py_func", None) or compiled._pyfunc)
    return compiled._cache


def sweep(kept: set[str]) -> int:
    """Remove folders of kernels that were last written long ago, but for those named in `kept`; return their number."""
    place, old = folder(), []
    for each in place.iterdir() if place is not None else ():
        if each.is_dir() and len(each.name) == DIGITS and each.name not in kept and time() - each.stat().st_mtime > UNUSED:
            shutil.rmtree(each, ignore_errors=True)
            old.append(each)
    return len(old)


class _Locator(_CacheLocator):  # type: ignore[misc]
    """Finds the folder of a kernel by all that it is compiled from."""

    def __init__(self, function: FunctionType, place: Path) -> None:
        self._stamp = sha256("\n".join(sorted(description(function))).encode()).hexdigest()
        self._path, self._line = place / self._stamp[:DIGITS], function.__code__.co_firstlineno

    def get_cache_path(self) -> str:
        return str(self._path)

    def ensure_cache_path(self) -> None:
        self._path.mkdir(exist_ok=True)

    def get_source_stamp(self) -> str:
        return self._stamp

    def get_disambiguator(self) -> str:
        return str(self._line)

    @classmethod
    def from_function(cls, function: FunctionType, _file: str) -> "_Locator | None":
        place = folder()
        return None if place is None else cls(function, place)


class _Files(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (_Locator,)


class KernelCache(FunctionCache):  # type: ignore[misc]
    """numba's cache of a function, in a folder named after all that the function is compiled from."""

    _impl_class = _Files

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Load what is kept with numba's run time alone.

        numba would import all that its compiler needs first, a quarter of a second; what is compiled imports it then.
        """
        rtsys.initialize(context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(signature, context)


def description(function: FunctionType) -> frozenset[str]:
    """Return what a compiled function is made from: source files of it and of what it calls, and the constants that they use."""
    if function not in _described:
        _described[function] = frozenset()  # for one that calls itself
        parts = {f"{function.__module__} {_source(function.__code__.co_filename)}"}
        for name, value in _globals_of(function):
            inner = _inner(value)
            if inner is not None:
                parts |= description(inner)
            elif isinstance(value, np.ndarray):
                parts.add(f"{name} {value.dtype} {value.shape} {sha256(value.tobytes()).hexdigest()}")
            elif isinstance(value, EnumType):
                parts.add(f"{name} {list(value)}")
            elif isinstance(value, (bool, int, float, str, tuple)):
                parts.add(f"{name} {value!r}")
        _described[function] = frozenset(parts)
    return _described[function]


def size(function: FunctionType) -> int:
    """Return the bytes of a function's code and of what it calls, a measure of how long it takes to be compiled."""
    functions, new = {function}, [function]
    while new:
        called = {inner for _, value in _globals_of(new.pop()) if (inner := _inner(value)) is not None}
        new += called - functions
        functions |= called
    return len(b"".join(each.__code__.co_code for each in functions))


def _inner(value: Any) -> FunctionType | None:
    """What a dispatcher or a ufunc of ours compiles; None for any other value."""
    wrapped = getattr(value, "__wrapped__", None)
    ours = isinstance(wrapped, FunctionType) and wrapped.__module__.partition(".")[0] == "scenario_gen"
    return wrapped if ours else None


@cache
def _source(file: str) -> str:
    """Return the digest of a source file."""
    return sha256(Path(file).read_bytes()).hexdigest()


def _globals_of(function: Callable[..., Any]) -> Iterator[tuple[str, Any]]:
    """The globals that a function uses, and what it uses of modules of ours."""
    names = set(_names(function.__code__))
    for name in sorted(names & function.__globals__.keys()):
        value = function.__globals__[name]
        if isinstance(value, ModuleType) and value.__name__.startswith("scenario_gen"):
            yield from ((f"{name}.{each}", getattr(value, each)) for each in sorted(names) if hasattr(value, each))
        yield name, value


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for const in code.co_consts:
        if isinstance(const, CodeType):
            yield from _names(const)

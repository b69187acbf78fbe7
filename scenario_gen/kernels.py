# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Compiled kernels: one decorator, explicit types, compiled once and cached on disk.

Every kernel names its argument types and has one compiled form, which is made (or loaded from the cache) at its first call.
`python -m scenario_gen.compiling` compiles every kernel of the project; `make` runs it at installation, and nodes that find one
missing see to it (`scenario_gen/compiling.py`).
Inputs are `F1`, `I2`, …, read-only to the kernel; outputs are `OUT1`, `OUTI2`, ….
"""

from collections.abc import Callable
from contextlib import suppress
import importlib
import operator
import os
from pathlib import Path
import pkgutil
import stat
import tempfile
from types import FunctionType, ModuleType
from typing import Any, cast, TypeVar

import numba
from numba import types
from numba.core.registry import CPUDispatcher
from numba.np.numpy_support import as_dtype
import numpy as np

Function = TypeVar("Function", bound=Callable[..., Any])


def _array(dtype: types.Type, ndim: int, *, readonly: bool) -> types.Array:
    return types.Array(dtype, ndim, "C", readonly=readonly)


F = types.float64
I = types.int64  # noqa: E741 - the field's letter for integers
B = types.boolean
F1, F2, F3, F4 = (_array(F, n, readonly=True) for n in (1, 2, 3, 4))
I1, I2, I3 = (_array(I, n, readonly=True) for n in (1, 2, 3))
B1, B2, B3 = (_array(B, n, readonly=True) for n in (1, 2, 3))
OUT1, OUT2, OUT3, OUT4 = (_array(F, n, readonly=False) for n in (1, 2, 3, 4))
OUTI1, OUTI2, OUTI3 = (_array(I, n, readonly=False) for n in (1, 2, 3))
OUTB1, OUTB2 = (_array(B, n, readonly=False) for n in (1, 2))

_registry: list[tuple[Any, tuple[Any, ...]]] = []


def _inner(function: Callable[..., Any]) -> list[FunctionType]:
    """The functions of ours that a compiled function calls."""
    names = function.__code__.co_names
    called = [function.__globals__.get(name) for name in names]
    ours = [module for module in called if isinstance(module, ModuleType) and module.__name__.startswith("scenario_gen.")]
    called += [getattr(module, name, None) for module in ours for name in names]
    inner = [getattr(each, "__wrapped__", None) for each in called]  # dispatchers and ufuncs wrap what they compile
    return [each for each in inner if isinstance(each, FunctionType) and each.__module__.startswith("scenario_gen.")]


def _source_stamp(function: Callable[..., Any], seen: set[int]) -> tuple[Any, ...]:
    """What tells whether a compiled function is up to date: the files of the kernels it calls, by time and size.

    numba itself looks only at the file of the function, and would go on calling what a kernel in another file once was.
    """
    seen.add(id(function))
    file = Path(function.__code__.co_filename).stat()
    stamps = [_source_stamp(each, seen) for each in _inner(function) if id(each) not in seen]
    return (file.st_mtime, file.st_size, *stamps)


def code_size(function: Callable[..., Any]) -> int:
    """Return the bytes of a function's code and of what it calls, a measure of how long it takes to be compiled."""
    return len(function.__code__.co_code) + sum(map(code_size, _inner(function)))


def _watch(dispatcher: Any, function: Callable[..., Any]) -> None:
    """Have the dispatcher's cache compare `_source_stamp`, where this version of numba has a place for it."""
    cache: Any = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if hasattr(cache, "_source_stamp"):
        cache._source_stamp = _source_stamp(function, set())


def _input(name: str, declared: types.Array) -> Callable[[Any], Any]:
    """Return what makes an array argument the declared one; it is copied if it is not contiguous."""
    dtype, ndim = as_dtype(declared.dtype), declared.ndim

    def take(value: Any) -> Any:
        array = np.ascontiguousarray(value)
        if array.dtype is not dtype and array.dtype != dtype:
            array = array.astype(dtype, casting="safe")
        if array.ndim != ndim:
            raise TypeError(f"{name}: an array of {array.ndim} dimensions was given, {ndim} are declared")
        return array

    return take


def _output(name: str, declared: types.Array) -> Callable[[Any], Any]:
    """Return what passes an output on; a copy of one would be lost."""
    dtype, ndim = as_dtype(declared.dtype), declared.ndim

    def take(array: Any) -> Any:
        if array.dtype != dtype or array.ndim != ndim or not (array.flags.c_contiguous and array.flags.writeable):
            raise TypeError(f"{name}: an output must be a writable, contiguous array of {ndim} dimensions of {dtype}")
        return array

    return take


def _argument(name: str, declared: Any) -> Callable[[Any], Any]:
    if isinstance(declared, types.Array):
        return _output(name, declared) if declared.mutable else _input(name, declared)
    return operator.index if declared == I else bool if declared == B else float


class Kernel(CPUDispatcher):  # type: ignore[misc]
    """A function with one compiled form, to Python and to the kernels that call it.

    numba's own dispatcher compiles another form for every mixture of read-only and writable arrays that it is given.
    """

    def __init__(self, function: Callable[..., Any], declared: tuple[Any, ...]) -> None:
        super().__init__(function, targetoptions={"nopython": True, "nogil": True, "error_model": "numpy", "boundscheck": None})
        self._declared = declared
        self._arguments = tuple(_argument(function.__name__, each) for each in declared)
        self._compiled: Callable[..., Any] | None = None

    def compile(self, _types: Any = None) -> Any:
        """Make or load the declared form, whatever is asked for; calls from other kernels come here, too."""
        entry = super().compile(self._declared)
        self._compiled = entry
        return entry

    def __call__(self, *values: Any) -> Any:
        """Call the compiled form."""
        compiled = self._compiled or self.compile()
        return compiled(*[take(value) for take, value in zip(self._arguments, values, strict=True)])


def kernel(*argument_types: Any, inline: bool = False) -> Callable[[Function], Function]:
    """Compile a function with numba: cached, without the GIL, IEEE arithmetic (no fastmath: same bytes everywhere).

    Args:
        argument_types: numba types of the positional arguments, e.g. `kernel(F2, I, OUT1)`.
        inline: a small helper called only from other kernels; it takes its types from them and is not pre-compiled.
    """

    def decorate(function: Function) -> Function:
        dispatcher = numba.njit(nogil=True, error_model="numpy")(function) if inline else Kernel(function, argument_types)
        keep(dispatcher, function)
        if not inline:
            register(dispatcher, argument_types)
        return cast("Function", dispatcher)

    return decorate


def keep(compiled: Any, function: Callable[..., Any]) -> None:
    """Have numba keep what it compiles: beside the source, in the user's cache, or else in a temporary folder of the user's."""
    with suppress(RuntimeError):  # no folder can be written to
        try:
            compiled.enable_caching()
        except RuntimeError:
            if numba.config.CACHE_DIR or not (folder := _last_resort()):
                raise
            numba.config.CACHE_DIR = folder
            compiled.enable_caching()
        _watch(compiled, function)


def _last_resort() -> str | None:
    """Return a folder for temporary files that is this user's alone: what is kept there is run."""
    folder = Path(tempfile.gettempdir()) / f"scenario_gen_kernels_{os.getuid()}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return None
    own = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o022
    return str(folder) if own else None


def register(compiled: Any, argument_types: Any) -> None:
    """Count among the kernels what `compile(argument_types)` compiles, or loads."""
    _registry.append((compiled, argument_types))


def registered() -> list[tuple[Any, Any]]:
    """Return the kernels of all modules that have been imported, with the types of their arguments."""
    return list(_registry)


def import_all() -> None:
    """Import every module that may have kernels; one whose extra is not installed cannot be called."""
    import scenario_gen

    for module in pkgutil.walk_packages(scenario_gen.__path__, "scenario_gen."):
        if ".nodes" not in module.name and not module.name.endswith("__main__"):
            try:
                importlib.import_module(module.name)
            except ModuleNotFoundError as error:
                if (error.name or "scenario_gen").startswith("scenario_gen"):
                    raise


def cache_folder() -> Path | None:
    """Return the folder of the first kernel's cache; None if nothing can be kept."""
    path = getattr(_registry[0][0]._cache, "cache_path", None) if _registry else None
    return Path(path) if path else None


def is_cached(compiled: Any, argument_types: Any) -> bool:
    """Say whether a kernel is in the cache; only the cache's index is read. numba has no public question for it."""
    if getattr(compiled, "overloads", None):
        return True  # in this process, too
    cache = compiled._cache
    if not hasattr(cache, "_cache_file"):
        return False
    return cache._index_key(argument_types, compiled.targetctx.codegen()) in cache._cache_file._load_index()

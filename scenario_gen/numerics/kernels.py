# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Compiled kernels: `numba.njit` with declared types, compiled at the first call and kept by numba's own cache.

Inputs are `F1`, `I2`, …, which the kernel only reads; outputs are `OUT1`, `OUTI2`, …. `kernel_cache.py` says where
numba's cache lies; `compiling.py` compiles several kernels at once.
"""

from collections.abc import Callable, Sequence
from functools import update_wrapper
import importlib
from pathlib import Path
from threading import RLock
from typing import Any, cast, TypeVar

import numba
from numba import types
from numba.extending import typeof_impl
import numpy as np

from scenario_gen.numerics.arrays import sealed
from scenario_gen.numerics.compiling import make_ready
from scenario_gen.numerics.kernel_cache import folder, PACKAGE, sources

Function = TypeVar("Function", bound=Callable[..., Any])


def _array(dtype: Any, ndim: int, *, readonly: bool) -> types.Array:
    return types.Array(dtype, ndim, "C", readonly=readonly)


F = types.float64
I = types.int64  # noqa: E741 - the field's letter for integers
B = types.boolean
F1, F2, F3, F4 = (_array(F, n, readonly=True) for n in (1, 2, 3, 4))
I1, I2 = (_array(I, n, readonly=True) for n in (1, 2))
N2 = _array(types.int32, 2, readonly=True)  # counts of cells
B1, B2 = (_array(B, n, readonly=True) for n in (1, 2))
OUT1, OUT2, OUT3, OUT4 = (_array(F, n, readonly=False) for n in (1, 2, 3, 4))
OUTI1, OUTI2 = (_array(I, n, readonly=False) for n in (1, 2))
OUTB1, OUTB2 = (_array(B, n, readonly=False) for n in (1, 2))

OPTIONS = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
_one_at_a_time = RLock()  # threads that need the same kernel
_kernels: list["Kernel"] = []


def named(of: type[Any], *fields: Any) -> Any:
    """Return the type of an argument that is a NamedTuple, from the types of its fields."""
    return types.BaseTuple.from_types(fields, of)


def _compiler(function: Callable[..., Any], **options: Any) -> Any:
    """`numba.njit`, with its cache in our folder; the setting is the user's again afterwards."""
    user = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder(Path(function.__code__.co_filename)))
    try:
        return numba.njit(**OPTIONS, **options)(function)
    finally:
        numba.config.CACHE_DIR = user


def _reader(declared: Any) -> Callable[[Any], Any]:
    """What makes an argument the declared one: inputs contiguous and of their type; outputs stay (a copy would be lost)."""
    if isinstance(declared, types.BaseTuple):
        return _record_reader(declared)
    if not isinstance(declared, types.Array) or declared.mutable:
        return _same
    dtype = np.dtype(str(declared.dtype))

    def read(value: Any) -> Any:
        array = np.ascontiguousarray(value)
        return array if array.dtype == dtype else array.astype(dtype, casting="safe")

    return read


def _record_reader(declared: Any) -> Callable[[Any], Any]:
    """The same for a NamedTuple. numba converts nothing inside of one: inputs are read-only, numbers have their type.

    The same one as the last time is not looked at anew.
    """
    seen: list[tuple[Any, Any]] = [(None, None)]
    readers = [_field_reader(kind) for kind in declared.types]

    def read_record(value: Any) -> Any:
        last = seen[0]  # one look: other threads have tuples of their own
        if last[0] is not value:
            last = (
                value,
                type(value)(*[read(each) for read, each in zip(readers, value, strict=True)]),
            )
            seen[0] = last
        return last[1]

    return read_record


def _field_reader(declared: Any) -> Callable[[Any], Any]:
    """The same for a field of one."""
    if not isinstance(declared, types.Array) or declared.mutable:
        return {F: float, I: int, B: bool}.get(declared) or _reader(declared)
    read_array = _reader(declared)

    def read(value: Any) -> Any:
        array = read_array(value)
        return sealed(array.view()) if array.flags.writeable else array

    return read


def _same(value: Any) -> Any:
    return value


class Kernel:
    """A function that numba compiles for its declared types, for Python and for the kernels that call it."""

    def __init__(self, function: Callable[..., Any], declared: Sequence[Any]) -> None:
        """Declare it; it is compiled, or loaded, when it is called."""
        update_wrapper(self, function)
        self.declared, self.dispatcher = tuple(declared), _compiler(function, cache=True)
        self._readers, self._is_ready = [_reader(kind) for kind in declared], False

    @property
    def name(self) -> str:
        """What tells it from all others: its module and its name."""
        return f"{self.__module__}:{self.__name__}"  # type: ignore[attr-defined]

    @property
    def size(self) -> int:
        """Bytes of its own code: about how long it takes to be compiled."""
        return len(self.dispatcher.py_func.__code__.co_code)

    @property
    def mark(self) -> Path:
        """The empty file that says that it is in the cache."""
        return folder(Path(self.dispatcher.py_func.__code__.co_filename)) / f"{self.name}.ready"

    def compile(self) -> Any:
        """Make or load the compiled form, once, and return numba's function."""
        with _one_at_a_time:
            if not self._is_ready:
                self.dispatcher.compile(self.declared)
                self.dispatcher.disable_compile()
                self.mark.touch()
                self._is_ready = True
        return self.dispatcher

    def __call__(self, *values: Any) -> Any:
        """Call the compiled form."""
        if not self._is_ready:
            if not self.mark.exists():
                make_ready(registered())
            self.compile()
        return self.dispatcher(
            *[read(value) for read, value in zip(self._readers, values, strict=True)]
        )


@typeof_impl.register(Kernel)  # type: ignore[untyped-decorator]
def _typeof_kernel(kernel: Kernel, context: Any) -> Any:
    """To numba a kernel is the function that it compiled."""
    return typeof_impl(kernel.compile(), context)


def kernel(
    *declared: Any, inline: bool = False, forced: bool = False
) -> Callable[[Function], Function]:
    """Compile a function with numba: cached, without the GIL, IEEE arithmetic (no fastmath).

    Args:
        declared: numba types of the positional arguments, e.g. `kernel(F2, I, OUT1)`.
        inline: a small helper called only from kernels; it takes its types from them and is compiled, and kept, with them.
        forced: it becomes part of its caller however large it is: else a call counts the references of the arrays it is given.
    """

    def decorate(function: Function) -> Function:
        if inline:
            return cast(
                "Function", _compiler(function, no_cpython_wrapper=True, forceinline=forced)
            )
        _kernels.append(Kernel(function, declared))
        return cast("Function", _kernels[-1])

    return decorate


def registered() -> list[Kernel]:
    """Return the kernels of all modules that have been imported."""
    return list(_kernels)


def import_all(packages: Sequence[str] = ()) -> None:
    """Import every module that has kernels, or those of some packages; one whose extra is not installed cannot be called."""
    for file in sources():
        parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
        if not packages or parts[1] in packages:
            try:
                importlib.import_module(".".join(parts))
            except ImportError as error:
                if (error.name or "scenario_gen").startswith("scenario_gen"):
                    raise

# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Compiled kernels: `numba.njit` with declared types, compiled at the first call.

Inputs are `F1`, `I2`, …, which the kernel only reads; outputs are `OUT1`, `OUTI2`, ….
`kernel_cache.py` chooses the folder of the cache; `compiling.py` compiles kernels in parallel.
"""

from collections.abc import Callable, Sequence
from functools import cached_property, update_wrapper
from hashlib import sha256
import importlib
from pathlib import Path
from threading import RLock
from typing import Any, cast, TypeVar

from filelock import FileLock
import numpy as np

from scenario_gen.base.folders import sync
from scenario_gen.numerics.arrays import sealed
from scenario_gen.numerics.compiling import make_ready
from scenario_gen.numerics.kernel_cache import folder, OPTIONS, PACKAGE, sources, used_by_numba
from scenario_gen.numerics.numba_import import numba

types = numba.types
Function = TypeVar("Function", bound=Callable[..., Any])


def _array(dtype: Any, ndim: int, *, readonly: bool) -> Any:
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

_one_at_a_time = RLock()  # threads that need the same kernel
_kernels: list["Kernel"] = []


def named(of: type[Any], *fields: Any) -> Any:
    """Return the numba type of a NamedTuple from the types of its fields."""
    return types.BaseTuple.from_types(fields, of)


def _reader(declared: Any) -> Callable[[Any], Any]:
    """Return a function that converts an argument to its declared type.

    Inputs become contiguous arrays. Outputs are not converted, because a copy would be lost.
    """
    if isinstance(declared, types.BaseTuple):
        return _record_reader(declared)
    if not isinstance(declared, types.Array) or declared.mutable:
        return lambda value: value
    dtype = np.dtype(str(declared.dtype))

    def read(value: Any) -> Any:
        array = np.ascontiguousarray(value)
        return array if array.dtype == dtype else array.astype(dtype, casting="safe")

    return read


def _record_reader(declared: Any) -> Callable[[Any], Any]:
    """Return a converter of NamedTuples, whose fields numba does not convert.

    The last record is remembered: kernels are called many times with the same one.
    """
    readers = [_field_reader(kind) for kind in declared.types]
    last: tuple[Any, Any] = (None, None)  # record, converted record

    def read_record(record: Any) -> Any:
        nonlocal last
        source, converted = last  # read once, because other threads may assign it
        if source is not record:
            fields = [read(field) for read, field in zip(readers, record, strict=True)]
            converted = type(record)(*fields)
            last = (record, converted)
        return converted

    return read_record


def _field_reader(declared: Any) -> Callable[[Any], Any]:
    """Return a converter of one field of a NamedTuple: arrays read-only, numbers of their type."""
    if not isinstance(declared, types.Array) or declared.mutable:
        return {F: float, I: int, B: bool}.get(declared) or _reader(declared)
    read_array = _reader(declared)

    def read(value: Any) -> Any:
        array = read_array(value)
        return sealed(array.view()) if array.flags.writeable else array

    return read


class Kernel:
    """A function that numba compiles for its declared types, for Python and other kernels."""

    def __init__(
        self, function: Callable[..., Any], declared: Sequence[Any], *, on_demand: bool
    ) -> None:
        """Declare the kernel; its first call compiles or loads it."""
        update_wrapper(self, function)
        self.function = function
        self.declared = tuple(declared)
        self.source = Path(function.__code__.co_filename)
        self.group = str(self.source.parent) if on_demand else ""
        self._readers = [_reader(kind) for kind in declared]
        self._is_ready = False

    @cached_property
    def dispatcher(self) -> Any:
        """Numba's function, with the cache in our folder."""
        with used_by_numba(self.source):
            return numba.njit(cache=True, **OPTIONS)(self.function)

    @property
    def name(self) -> str:
        """Its module and function name, which no other kernel has."""
        return f"{self.__module__}:{self.__name__}"  # type: ignore[attr-defined]

    @property
    def size(self) -> int:
        """Bytes of its bytecode, a measure of its compile time."""
        return len(self.function.__code__.co_code)

    @property
    def mark(self) -> Path:
        """The file with the hash of the cached kernel, which exists once the kernel is cached."""
        return folder(self.source) / f"{self.name}.sha256"

    def compile(self) -> Any:
        """Compile or load it, once, and return numba's function."""
        with _one_at_a_time:
            if not self._is_ready:
                if not self._load():
                    self._replace()
                self.dispatcher.disable_compile()
                self._is_ready = True
        return self.dispatcher

    def _cached(self) -> list[Path]:
        """Return its files in the cache."""
        return sorted(self.mark.parent.glob(f"*.{self.function.__name__}-*"))

    def _digest(self) -> str:
        """Return the hash of its files in the cache."""
        return sha256(b"".join(file.read_bytes() for file in self._cached())).hexdigest()

    def _load(self) -> bool:
        """Load the kernel from the cache; return whether that has a whole one.

        A damaged one must not be loaded: LLVM ends the process.
        """
        try:
            if self.mark.read_text(encoding="utf-8") != self._digest():
                return False
            self.dispatcher.compile(self.declared)
        except Exception:  # it is gone, or refers to Python code that is gone
            return False
        return True

    def _replace(self) -> None:
        """Compile the kernel and put it into the cache, unless another process just did."""
        with FileLock(self.mark.with_suffix(".lock")):
            if self._load():
                return
            for file in self._cached():
                file.unlink()
            self.dispatcher.compile(self.declared)
            for file in self._cached():
                sync(file)
            self.mark.write_text(self._digest(), encoding="utf-8")
            sync(self.mark)

    def __call__(self, *values: Any) -> Any:
        """Call the compiled function."""
        if not self._is_ready:
            if not self.mark.exists():
                make_ready([other for other in _kernels if other.group in ("", self.group)])
            self.compile()
        arguments = [read(value) for read, value in zip(self._readers, values, strict=True)]
        return self.dispatcher(*arguments)


@numba.extending.typeof_impl.register(Kernel)  # type: ignore[untyped-decorator]
def _typeof_kernel(kernel: Kernel, context: Any) -> Any:
    """Let numba see a kernel as its compiled function."""
    return numba.extending.typeof_impl(kernel.compile(), context)


def _without_literals(compile_types: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Let a helper that is called with `1` or `True` be compiled once, for any number or truth."""
    return lambda argument_types: compile_types(tuple(map(types.unliteral, argument_types)))


def kernel(
    *declared: Any,
    inline: bool = False,
    forced: bool = False,
    merged: bool = False,
    on_demand: bool = False,
) -> Callable[[Function], Function]:
    """Compile a function with numba: cached, without the GIL, IEEE arithmetic (no fastmath).

    With NUMBA_DISABLE_JIT=1 it stays a function of Python, for debuggers and coverage.

    Args:
        declared: numba types of the positional arguments, e.g. `kernel(F2, I, OUT1)`.
        inline: a helper that only kernels call; it gets its types from them and is compiled with
            them.
        forced: the caller includes the helper whatever its size; a call would count the references
            of its array arguments.
        merged: the helper is copied into its only caller and compiled as a part of it, so that its
            code, and that of all helpers that it calls, is not optimised once more.
        on_demand: it is compiled when it, or another one on demand in its folder, is called for
            the first time, and not with all others.
    """

    def decorate(function: Function) -> Function:
        if numba.config.DISABLE_JIT:
            return function
        if inline:
            copied = "always" if merged else "never"
            options = OPTIONS | {"forceinline": forced, "inline": copied}
            helper = numba.njit(no_cpython_wrapper=True, **options)(function)
            helper.compile = _without_literals(helper.compile)
            return cast("Function", helper)
        _kernels.append(Kernel(function, declared, on_demand=on_demand))
        return cast("Function", _kernels[-1])

    return decorate


def registered(*, on_demand: bool = True) -> list[Kernel]:
    """Return the kernels of all modules that have been imported, with those on demand or not."""
    return [each for each in _kernels if on_demand or not each.group]


def import_all(packages: Sequence[str]) -> None:
    """Import the modules with kernels of all or some packages, unless their extra is missing."""
    for file in sources():
        parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
        if packages and parts[1] not in packages:
            continue
        try:
            importlib.import_module(".".join(parts))
        except ImportError as error:
            if (error.name or "scenario_gen").startswith("scenario_gen"):
                raise

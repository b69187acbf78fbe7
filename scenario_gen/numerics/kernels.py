# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Compiled kernels: one decorator, explicit types, compiled once and cached on disk.

Every kernel names its argument types and has one compiled form, which is made (or loaded from the cache) at its first call.
`python -m scenario_gen.numerics.compiling` compiles every kernel of the project; `make` runs it at installation,
and nodes that find one missing run it (`scenario_gen/numerics/compiling.py`).
Inputs are `F1`, `I2`, …, read-only to the kernel; outputs are `OUT1`, `OUTI2`, ….
"""

from collections.abc import Callable, Sequence
import importlib
import operator
from pathlib import Path
import re
from typing import Any, cast, TypeVar

from numba import types
from numba.core.registry import CPUDispatcher
from numba.np.numpy_support import as_dtype
import numpy as np

from scenario_gen.numerics.kernel_cache import keep

Function = TypeVar("Function", bound=Callable[..., Any])


def _array(dtype: types.Type, ndim: int, *, readonly: bool) -> types.Array:
    return types.Array(dtype, ndim, "C", readonly=readonly)


F = types.float64
I = types.int64  # noqa: E741 - the field's letter for integers
B = types.boolean
F1, F2, F3, F4 = (_array(F, n, readonly=True) for n in (1, 2, 3, 4))
I1, I2 = (_array(I, n, readonly=True) for n in (1, 2))
N2, OUTN2 = (_array(types.int32, 2, readonly=each) for each in (True, False))  # counts of cells
B1, B2 = (_array(B, n, readonly=True) for n in (1, 2))
OUT1, OUT2, OUT3, OUT4 = (_array(F, n, readonly=False) for n in (1, 2, 3, 4))
OUTI1, OUTI2 = (_array(I, n, readonly=False) for n in (1, 2))
OUTB1, OUTB2 = (_array(B, n, readonly=False) for n in (1, 2))

OPTIONS = {"nopython": True, "nogil": True, "error_model": "numpy", "boundscheck": None, "no_cfunc_wrapper": True}
_DECORATED = re.compile(r"^@(kernel\(|elementwise$)", re.MULTILINE)
_registry: list[tuple[Any, tuple[Any, ...]]] = []


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


def named(fields: type, *declared: Any) -> types.NamedTuple:
    """Return the type of an argument that is a NamedTuple, from the types of its fields."""
    return types.NamedTuple(declared, fields)


def _tuple(name: str, declared: types.NamedTuple) -> Callable[[Any], Any]:
    """Return what makes a NamedTuple the declared one; the same one again, of which all was right, is not looked at anew."""
    takes = [_argument(f"{name}: {field}", each) for field, each in zip(declared.fields, declared.types, strict=True)]
    right = None

    def take(values: Any) -> Any:
        nonlocal right
        if values is right:
            return values
        taken = declared.instance_class(*[take(value) for take, value in zip(takes, values, strict=True)])
        if all(one is other for one, other in zip(taken, values, strict=True)):
            right = None if any(getattr(each, "mutable", False) for each in declared.types) else values  # outputs are large
        return taken

    return take


def _argument(name: str, declared: Any) -> Callable[[Any], Any]:
    if isinstance(declared, types.NamedTuple):
        return _tuple(name, declared)
    if isinstance(declared, types.Array):
        return _output(name, declared) if declared.mutable else _input(name, declared)
    return operator.index if declared == I else bool if declared == B else float


class Kernel(CPUDispatcher):  # type: ignore[misc]
    """A function with one compiled form, to Python and to the kernels that call it.

    numba's own dispatcher compiles another form for every mixture of read-only and writable arrays that it is given.
    """

    def __init__(self, function: Callable[..., Any], declared: tuple[Any, ...]) -> None:
        super().__init__(function, targetoptions=OPTIONS)
        self._declared = declared
        self._arguments = tuple(_argument(function.__name__, each) for each in declared)
        self._compiled: Callable[..., Any] | None = None

    def compile(self, _types: Any = None) -> Any:
        """Make or load the declared form, whatever signature is requested; calls from other kernels come here, too."""
        keep(self)
        entry = super().compile(self._declared)
        self._compiled = entry
        return entry

    def __call__(self, *values: Any) -> Any:
        """Call the compiled form."""
        compiled = self._compiled or self.compile()
        return compiled(*[take(value) for take, value in zip(self._arguments, values, strict=True)])


class Helper(CPUDispatcher):  # type: ignore[misc]
    """A function that kernels alone call: nothing is compiled for calls from Python, which takes a quarter of the time off."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function, targetoptions=OPTIONS | {"no_cpython_wrapper": True})

    def __call__(self, *_: Any) -> Any:
        """Refuse."""
        raise TypeError(f"{self.__name__} is called by kernels alone; its Python form is {self.__name__}.py_func")


def kernel(*argument_types: Any, inline: bool = False) -> Callable[[Function], Function]:
    """Compile a function with numba: cached, without the GIL, IEEE arithmetic (no fastmath: same bytes everywhere).

    Args:
        argument_types: numba types of the positional arguments, e.g. `kernel(F2, I, OUT1)`.
        inline: a small helper called only from other kernels; it takes its types from them and is compiled, and kept, with them.
    """

    def decorate(function: Function) -> Function:
        if inline:
            return cast("Function", Helper(function))
        dispatcher = Kernel(function, argument_types)
        register(dispatcher, argument_types)
        return cast("Function", dispatcher)

    return decorate


def register(compiled: Any, argument_types: Any) -> None:
    """Count among the kernels what `compile(argument_types)` compiles, or loads."""
    _registry.append((compiled, argument_types))


def registered() -> list[tuple[Any, Any]]:
    """Return the kernels of all modules that have been imported, with the types of their arguments."""
    return list(_registry)


def import_all(packages: Sequence[str] = ()) -> None:
    """Import every module that has kernels, or those of some packages; one whose extra is not installed cannot be called."""
    root = Path(__file__).parents[1]
    for file in sorted(file for package in packages or ("",) for file in (root / package).rglob("*.py")):
        if _DECORATED.search(file.read_text(encoding="utf-8")):
            name = ".".join(file.relative_to(root.parent).with_suffix("").parts)
            try:
                importlib.import_module(name)
            except ImportError as error:
                if (error.name or "scenario_gen").startswith("scenario_gen"):
                    raise


def is_cached(compiled: Any, argument_types: Any) -> bool:
    """Say whether a kernel is in the cache; only the cache's index is read. numba has no public question for it."""
    if getattr(compiled, "overloads", None):
        return True  # in this process, too
    cache = keep(compiled)
    if not hasattr(cache, "_cache_file"):
        return False
    return cache._index_key(argument_types, compiled.targetctx.codegen()) in cache._cache_file._load_index()

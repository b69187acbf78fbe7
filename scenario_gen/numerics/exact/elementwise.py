# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Ufuncs of numpy from compiled functions of numbers, kept on disk whole.

`numba.vectorize` keeps only the function and compiles the loop around it anew in every process: a second for our twelve. Here the
loop is a C callback, which numba keeps like any kernel, and it is loaded when the function is first called from Python.
"""

from collections.abc import Callable
import inspect
from typing import Any, overload, Protocol

from llvmlite import ir
from numba import types
from numba.core.ccallback import CFunc
from numba.extending import intrinsic
from numba.np.ufunc import _internal  # type: ignore[attr-defined,unused-ignore]
import numpy as np

from scenario_gen.numerics.arrays import Floats
from scenario_gen.numerics.kernel_cache import keep
from scenario_gen.numerics.kernels import F, I, kernel, register

ADDRESSES = types.CPointer(I)
LOOP = types.void(ADDRESSES, ADDRESSES, ADDRESSES, I)  # of the arrays, the number of elements, the strides [B], and nothing
LOOPS = {
    1: """
def {name}_loop(arrays, counts, steps, _):
    x, out = arrays[0], arrays[1]
    if steps[0] == 8 and steps[1] == 8:
        for k in range(counts[0]):
            _write(out, k, {name}(_read(x, k)))
    else:
        for k in range(counts[0]):
            _write(out + steps[1] * k, 0, {name}(_read(x + steps[0] * k, 0)))
""",
    2: """
def {name}_loop(arrays, counts, steps, _):
    x, y, out = arrays[0], arrays[1], arrays[2]
    for k in range(counts[0]):
        _write(out + steps[2] * k, 0, {name}(_read(x + steps[0] * k, 0), _read(y + steps[1] * k, 0)))
""",
}


def _pointer(builder: Any, address: Any, k: Any) -> Any:
    return builder.gep(builder.inttoptr(address, ir.PointerType(ir.DoubleType())), [k])


@intrinsic  # type: ignore[untyped-decorator,unused-ignore]
def _read(_context: Any, _address: Any, _k: Any) -> Any:
    """The k-th float64 behind an address."""
    return F(I, I), lambda _, builder, __, arguments: builder.load(_pointer(builder, *arguments))


@intrinsic  # type: ignore[untyped-decorator,unused-ignore]
def _write(_context: Any, _address: Any, _k: Any, _value: Any) -> Any:
    """Put the k-th float64 behind an address."""

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        address, k, value = arguments
        builder.store(value, _pointer(builder, address, k))
        return context.get_dummy_value()

    return types.void(I, I, F), generate


class Function(Protocol):
    """A ufunc of one argument."""

    @overload
    def __call__(self, x: Floats, /) -> Floats: ...
    @overload
    def __call__(self, x: float, /) -> float: ...


class Function2(Protocol):
    """A ufunc of two arguments."""

    @overload
    def __call__(self, x: Floats, y: Floats | float, /) -> Floats: ...
    @overload
    def __call__(self, x: float, y: Floats, /) -> Floats: ...
    @overload
    def __call__(self, x: float, y: float, /) -> float: ...


class Elementwise:
    """A function of numbers: a ufunc to Python, and a kernel to the kernels that call it."""

    def __init__(self, function: Callable[..., float]) -> None:
        self.__name__, self.__doc__, self.__module__ = function.__name__, function.__doc__, function.__module__
        self.__wrapped__ = function
        self._scalar: Any = kernel(inline=True)(function)
        self._arguments = len(inspect.signature(function).parameters)
        self._ufunc: Any = None
        around = function.__globals__ | {"_read": _read, "_write": _write, function.__name__: self}
        source = "\n" * (function.__code__.co_firstlineno - 1) + LOOPS[self._arguments].format(name=function.__name__)
        exec(compile(source, function.__code__.co_filename, "exec"), around)  # numba keeps what has a file
        options = {"nopython": True, "error_model": "numpy"}
        loop: Any = CFunc(around[f"{function.__name__}_loop"], (LOOP.args, LOOP.return_type), {}, options)
        self._loop = loop
        self.targetctx = loop._targetdescr.target_context
        register(self, LOOP)

    @property
    def _cache(self) -> Any:
        return keep(self._loop)

    @property
    def _numba_type_(self) -> Any:
        return self._scalar._numba_type_

    def compile(self, _signature: Any = None) -> None:
        """Make the ufunc, of a loop that is in the cache or of one that is compiled."""
        if self._ufunc is None:
            keep(self._loop)
            self._loop.compile()
            kinds = [np.dtype(float).num] * (self._arguments + 1)
            results = (self.__name__, self.__doc__, [self._loop.address], [kinds], self._arguments, 1, [None], [self._loop])
            self._ufunc = _internal.fromfunc(*results, _internal.PyUFunc_None)

    def __call__(self, *values: Any) -> Any:
        """Apply it to numbers or arrays."""
        if self._ufunc is None:
            self.compile()
        return self._ufunc(*values)


@overload
def elementwise(function: Callable[[float], float]) -> Function: ...
@overload
def elementwise(function: Callable[[float, float], float]) -> Function2: ...
def elementwise(function: Callable[..., float]) -> Any:
    """Make a ufunc of a function of one or two numbers."""
    return Elementwise(function)

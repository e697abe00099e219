"""Compile loops with numba: cached on disk, without the GIL, with arithmetic as written."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np

from renderer.compiled.kernel_cache import KernelCache
from renderer.compiled.lanes import Lanes, intrinsic, lanes_among, multiply_add
from renderer.compiled.numba_inside import cgutils, ir, numba, types

Function = TypeVar("Function", bound=Callable[..., object])


def jit(function: Function) -> Function:
    """Compile a function with numba when it is first called, or load it from the cache.

    mypy still sees its type, which numba's own decorator hides.
    """
    compiled: Any = numba.njit(nogil=True, error_model="numpy")(function)
    compiled._cache = KernelCache(function)
    return cast(Function, compiled)


def inline(function: Function) -> Function:
    """Compile a function into those that call it. Passing lanes or arrays to it then costs nothing.

    It must not make arrays: its references to them are not counted. Atomic counts took a third of the time of exact
    rays.
    """
    return cast(Function, numba.njit(nogil=True, error_model="numpy", forceinline=True, _nrt=False)(function))


@intrinsic
def _fma(_: Any, x: Any, y: Any, z: Any) -> Any:
    """Call LLVM's instruction; a processor without it computes the same result step by step."""
    kind = lanes_among((x, y, z)) or x
    if not (isinstance(kind, Lanes) or (x == y == z and isinstance(x, types.Float))):
        return None
    return kind(kind, kind, kind), lambda _context, builder, _signature, arguments: multiply_add(
        builder, kind, arguments
    )


# x * y + z, rounded once; in compiled loops only.
fma = cast(Callable[[np.float32, np.float32, np.float32], np.float32], _fma)


@intrinsic
def _prefetch(_: Any, address: Any) -> Any:
    """Give LLVM's hint; 3 and 1 ask for data in the first-level cache."""

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        pointer, number = ir.PointerType(ir.IntType(8)), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [pointer, number, number, number])
        hint = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        builder.call(hint, [builder.inttoptr(arguments[0], pointer), number(0), number(3), number(1)])
        return context.get_dummy_value()

    return types.void(types.int64), generate


# Hints that the memory at an address, if any, is read soon; in compiled loops only.
prefetch = cast(Callable[[int], None], _prefetch)

"""The one way in which this program compiles a loop: cached on disk, without the GIL, arithmetic kept as written."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

Function = TypeVar("Function", bound=Callable[..., object])


def jit(function: Function) -> Function:
    """Compile with numba; the type of the function is kept, which numba's own decorator does not do for mypy.

    Where no folder for the cache can be written, neither beside the module nor in the user's home, as in a container
    with a read-only file system, every process compiles for itself.
    """
    try:
        return cast(Function, njit(cache=True, nogil=True, error_model="numpy")(function))
    except RuntimeError:  # "no locator available": numba looks for the folder right here
        return cast(Function, njit(nogil=True, error_model="numpy")(function))

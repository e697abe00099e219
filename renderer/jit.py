"""The one way in which this program compiles a loop: cached on disk, without the GIL, arithmetic kept as written."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

Function = TypeVar("Function", bound=Callable[..., object])


def jit(function: Function) -> Function:
    """Compile with numba; the type of the function is kept, which numba's own decorator does not do for mypy."""
    return cast(Function, njit(cache=True, nogil=True, error_model="numpy")(function))

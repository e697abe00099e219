"""Imports numba and the private parts of it that this room uses, and names settings with which it cannot work.

They have no types.
"""
# ruff: noqa: E402, F401  imports follow the guarded one of numba; others import them from here

from __future__ import annotations

import importlib
import re
import resource
import sys
import warnings
from functools import cache
from typing import Any

from renderer.errors import InputError

# Below this limit LLVM, OpenBLAS or glibc end the process, without an exception, even if nothing has to be compiled.
_LEAST_ADDRESS_SPACE = 5 << 28
# Where scipy is installed, numba imports scipy.linalg, which takes as long as numba itself, to see whether np.convolve
# can use its BLAS. Here the answer is no, without the import: no loop calls np.convolve.
_SCIPY_BLAS, _ASKS_FOR_SCIPY = "scipy.linalg.cython_blas", "numba.np.arraymath"


def _import_numba() -> Any:
    """Import numba; raise InputError if a variable of the environment keeps it from working, or MemoryError."""
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit != resource.RLIM_INFINITY and limit < _LEAST_ADDRESS_SPACE:
        raise MemoryError("address space is limited too far")
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("error", "Environment variable", RuntimeWarning)
            found = importlib.import_module("numba")
    except RuntimeWarning as error:
        name, value = re.findall("'(.*?)'", str(error))[:2]
        expected = "another value, or not set"
        raise InputError("numba cannot read this setting", where=name, got=value, expected=expected) from None
    except ValueError as error:
        if "threads" not in str(error):
            raise
        expected = "a whole number above 0, or not set"
        got = str(sys.modules["numba.core.config"].NUMBA_NUM_THREADS)
        raise InputError(
            "numba cannot be used with this setting", where="NUMBA_NUM_THREADS", got=got, expected=expected
        ) from None
    if found.config.DISABLE_JIT:
        raise InputError(
            "numba is told not to compile, and frames are drawn by compiled loops",
            where="NUMBA_DISABLE_JIT",
            got=str(found.config.DISABLE_JIT),
            expected="0, or not set",
        )
    return found


numba: Any = _import_numba()

from llvmlite import binding, ir
from numba import extending
from numba.core import cgutils, imputils, typeconv, types as _types
from numba.core.compiler import CompileResult
from numba.core.registry import cpu_target
from numba.core.serialize import dumps
from numba.core.typing import templates
from numba.np.arrayobj import make_array

types: Any = _types  # mypy takes the imported name for Python's own module


@cache
def import_functions() -> None:
    """Import numba's own compiled functions, without scipy.linalg. Call it before anything is compiled or loaded."""
    if _SCIPY_BLAS in sys.modules:
        return
    sys.modules[_SCIPY_BLAS] = None  # type: ignore[assignment]
    try:
        importlib.import_module(_ASKS_FOR_SCIPY)
    finally:
        del sys.modules[_SCIPY_BLAS]

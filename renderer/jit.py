"""The one way in which this program compiles a loop: cached on disk, without the GIL, arithmetic kept as written.

numba looks at a function's own file to see whether its cache is stale, not at the files of what it calls. The cache is
therefore kept in a folder named by all sources together: an edit anywhere compiles everything again, once.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., object])

_config: Any = numba.config  # its attributes are made at run time


def _cache_folder() -> Path | None:
    """A writable folder for this version of the sources: beside them, or in the user's home; None if there is none."""
    here = Path(__file__).resolve().parent
    digest = hashlib.blake2b(numba.__version__.encode(), digest_size=8)
    for source in sorted(here.glob("*.py")):
        digest.update(source.read_bytes())
    asked_for = [Path(_config.CACHE_DIR)] if _config.CACHE_DIR else []
    for base in (*asked_for, here / "__pycache__", Path.home() / ".cache" / "hsplat"):
        folder = base / f"kernels-{digest.hexdigest()}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    return None


_FOLDER = _cache_folder()
if _FOLDER is not None:
    _config.CACHE_DIR = str(_FOLDER)


def has_compiled_before() -> bool:
    """Whether kernels of these sources are in the cache; if not, the first calls take as long as compiling does."""
    return _FOLDER is not None and any(_FOLDER.rglob("*.nbi"))


def jit(function: Function) -> Function:
    """Compile with numba; the type of the function is kept, which numba's own decorator does not do for mypy.

    Where no folder for the cache can be written, as in a container with a read-only file system, every process compiles
    for itself.
    """
    return cast(Function, numba.njit(cache=_FOLDER is not None, nogil=True, error_model="numpy")(function))

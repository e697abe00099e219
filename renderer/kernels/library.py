"""Find the library of kernels for this processor, and load it only if it has the same bytes as when it was built.

A damaged library may end the process while it is loaded, so its digest is compared first.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
from functools import cache
from pathlib import Path

from renderer.errors import InputError, RenderError
from renderer.kernels.build import BUILT, LEVELS, MANIFEST, best_level, sources_digest, this_target

# The environment variable that asks for kernels of a lower level than the processor offers: for tests, and to compare
# machines.
LEVEL_VARIABLE = "HSPLAT_PROCESSOR_LEVEL"
_ROOT = Path(__file__).resolve().parents[2]


@cache
def processor_level() -> int:
    """Return the level of the processors that this process's kernels are compiled for.

    The level is 1, 3 or 4 on x86-64, and 0 on other machines: the highest one that the processor offers and that was
    compiled. Raises InputError if the environment asks for a level that the processor does not offer, and RenderError
    if the library that finds the level cannot be loaded.
    """
    offered = best_level(_load("processor").processor_level(), this_target())
    wanted = os.environ.get(LEVEL_VARIABLE, "")  # noqa: TID251  read once, before anything is drawn
    if not wanted:
        built = _manifest()[1]
        levels = [level for level in _levels() if level <= offered and f"kernels-{level}.so" in built]
        return max(levels, default=offered)
    known = [str(level) for level in _levels() if level <= offered]
    if wanted not in known:
        raise InputError(
            "this processor has no such level",
            where=LEVEL_VARIABLE,
            got=wanted,
            expected=", ".join(known) + ", or not set",
        )
    return int(wanted)


def num_lanes() -> int:
    """Return the number of rays that a kernel marches at the same time, one in each lane of a vector: 16, 8 or 4."""
    _, lanes = _levels()[processor_level()]
    return lanes


def _levels() -> dict[int, tuple[str, int]]:
    return LEVELS[this_target().partition("-")[2]]


def describe_kernels() -> str:
    """Describe the processors that the kernels of this process are for, in a few words."""
    machine = platform.machine()
    level = f" level {processor_level()}" if machine == "x86_64" else ""
    return f"for {machine}{level}, {num_lanes()} rays in step"


def load_library() -> ctypes.CDLL:
    """Return the library of kernels for this processor. Raise RenderError if there is none, or if it is damaged."""
    return _load(f"kernels-{processor_level()}")


def _manifest() -> tuple[str, dict[str, str]]:
    """Return the digest of the sources that were compiled, and of each library, by its name."""
    sources, *lines = (BUILT / MANIFEST).read_text("ascii").splitlines()
    return sources, {name: digest for digest, _, name in (line.partition(" ") for line in lines)}


def _load(name: str) -> ctypes.CDLL:
    path = BUILT / f"{name}.so"
    try:
        sources, digests = _manifest()
        if sources != sources_digest():
            raise _unusable(path, "the compiled kernels are of other sources than these")
        digest = hashlib.blake2b(path.read_bytes(), digest_size=16).hexdigest()
        if digests.get(path.name) != digest:
            raise _unusable(path, "the compiled kernels are damaged")
        return ctypes.CDLL(str(path))
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise _unusable(path, f"the compiled kernels cannot be read ({reason})") from None


def _unusable(path: Path, fault: str) -> RenderError:
    is_checkout = (_ROOT / "pyproject.toml").is_file()
    command = "python -m renderer.kernels.build" if is_checkout else "pip install --force-reinstall hsplat"
    return RenderError(
        fault, where=str(path), got=f"machine {platform.machine()}", hint=f"`{command}` makes them again"
    )

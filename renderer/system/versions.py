"""Find the versions of the packages and the sources that make an output."""

from __future__ import annotations

import functools
import hashlib
import os
import platform
import subprocess
from importlib import metadata
from pathlib import Path

# The packages on which measured numbers depend, in addition to the packages on which pixels depend.
MEASURING_PACKAGES = ("flip-evaluator", "scikit-image")
# The packages on which the pixels and the files of a film depend.
_PACKAGES = (
    *("hsplat", "imagecodecs", "imageio-ffmpeg", "moderngl", "nibabel", "numpy", "pydicom", "python-gdcm"),
    "tifffile",
)

# The folder that holds the packages `renderer` and `hsplat_cli`.
_ROOT = Path(__file__).resolve().parents[2]


def package_versions(*more: str) -> dict[str, str]:
    """Return the versions of Python and of the packages on which an output depends.

    The version of hsplat is a commit if it runs from its sources. A missing package is `not installed`. more: the names
    of further packages.
    """
    return {"python": platform.python_version()} | {name: _version(name) for name in (*_PACKAGES, *more)}


def _version(package: str) -> str:
    try:
        return _installed_version(package)
    except metadata.PackageNotFoundError:
        is_known = package == "hsplat" and (sources := commit()) != "unknown"
        return f"commit {sources}" if is_known else "not installed"


@functools.cache  # a package's metadata take milliseconds to parse, and each film records the versions
def _installed_version(package: str) -> str:
    return metadata.version(package)


def commit() -> str:
    """Return the commit of the sources of hsplat, with `-dirty` after changes; `unknown` without git or history."""
    if not (_ROOT / ".git").exists():  # a repository further up would belong to another project
        return "unknown"
    try:
        name, changes = _git("describe", "--always"), _git("status", "--porcelain", "--untracked-files=no")
    except OSError:
        return "unknown"
    return name + "-dirty" * bool(changes) if name else "unknown"


def _git(*arguments: str) -> str:
    """Return the output of a git command in hsplat's repository. Git takes no lock, since other programs may use it."""
    command = ["git", "--no-optional-locks", *arguments]
    return subprocess.run(command, check=False, cwd=_ROOT, capture_output=True, text=True).stdout.strip()


def sources_digest(package: str = "renderer") -> str:
    """Return the digest of the sources of a package, in all languages: 32 hexadecimal digits."""
    found = hashlib.blake2b(digest_size=16)
    for folder, folders, names in os.walk(_ROOT / package):
        folders.sort()
        for name in sorted(names):
            if name.endswith((".py", ".cpp", ".h", ".glsl")):
                found.update(Path(folder, name).read_bytes())
    return found.hexdigest()

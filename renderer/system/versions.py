"""Find the versions of what made an output."""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
from importlib import metadata
from pathlib import Path

# What the pixels or the files depend on, and what measured numbers do besides.
MEASURING_PACKAGES = ("flip-evaluator", "scikit-image")
_PACKAGES = (
    *("hsplat", "imagecodecs", "imageio-ffmpeg", "moderngl", "nibabel", "numpy", "pydicom", "python-gdcm"),
    "tifffile",
)

_ROOT = Path(__file__).resolve().parents[2]


def package_versions(*more: str) -> dict[str, str]:
    """Return the versions of Python and of the packages that an output depends on, for its sidecar, and of some more.

    The version of hsplat is a commit if it runs from its sources. A missing package is `not installed`.
    """
    return {"python": platform.python_version()} | {name: _version(name) for name in (*_PACKAGES, *more)}


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        is_known = package == "hsplat" and (sources := commit()) != "unknown"
        return f"commit {sources}" if is_known else "not installed"


def commit() -> str:
    """Return the commit of these sources, with `-dirty` after changes; `unknown` without git or history."""
    if not (_ROOT / ".git").exists():  # a repository further up would be another project's
        return "unknown"
    try:
        name, changes = _git("describe", "--always"), _git("status", "--porcelain", "--untracked-files=no")
    except OSError:
        return "unknown"
    return name + "-dirty" * bool(changes) if name else "unknown"


def _git(*arguments: str) -> str:
    """Return what git prints, without a lock on the repository, which others may be using."""
    command = ["git", "--no-optional-locks", *arguments]
    return subprocess.run(command, check=False, cwd=_ROOT, capture_output=True, text=True).stdout.strip()


def sources_digest(package: str = "renderer") -> str:
    """Return 32 hexadecimal digits that change with the sources of a package, in all languages; renderer/ draws."""
    found = hashlib.blake2b(digest_size=16)
    for folder, folders, names in os.walk(_ROOT / package):
        folders.sort()
        for name in sorted(names):
            if name.endswith((".py", ".cpp", ".h", ".glsl")):
                found.update(Path(folder, name).read_bytes())
    return found.hexdigest()

"""Which versions of what made an output."""

from __future__ import annotations

import platform
from importlib import metadata

# What the pixels or the files depend on, and what measured numbers do besides.
MEASURING = ("flip-evaluator", "scikit-image", "vtk")
_PACKAGES = ("hsplat", "imageio-ffmpeg", "llvmlite", "moderngl", "nibabel", "numba", "numpy", "SimpleITK")


def package_versions(*more: str) -> dict[str, str]:
    """Python's version and those of the packages that an output depends on, for its sidecar, and of some more.

    A package that runs without being installed, such as hsplat from its source tree, is `not installed`.
    """
    return {"python": platform.python_version()} | {name: _version(name) for name in (*_PACKAGES, *more)}


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"

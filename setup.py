"""Compile the kernels when a wheel is built: one for each platform and any Python, as ctypes calls them."""

from __future__ import annotations

import os
import runpy
import shutil
import tempfile
from pathlib import Path
from typing import ClassVar

from setuptools import Command, Distribution, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build import build

ROOT = Path(__file__).resolve().parent
KERNELS = runpy.run_path(str(ROOT / "renderer" / "kernels" / "build.py"))  # not imported: the package needs numpy
# One of TARGETS in build.py, to compile for another machine than this.
TARGET = os.environ.get("HSPLAT_BUILD_TARGET") or KERNELS["this_target"]()
# `own` compiles for the level of this processor alone, in a third of the time; the wheel is for this machine.
IS_FOR_OWN_LEVEL = os.environ.get("HSPLAT_BUILD_LEVELS") == "own"
MAC_NAMES = {"aarch64": "arm64", "x86_64": "x86_64"}


class BuildKernels(Command):
    """A step of `build`: writes the libraries into the wheel, or beside the sources for an editable installation."""

    description = "compile the kernels"
    user_options: ClassVar[list[tuple[str, str, str]]] = []
    editable_mode = False

    def initialize_options(self) -> None:
        """Set what `finalize_options` finds."""
        self.build_lib: str | None = None

    def finalize_options(self) -> None:
        """Find the folder of the package that is built."""
        self.set_undefined_options("build", ("build_lib", "build_lib"))

    def run(self) -> None:
        """Compile the kernels. A folder has what the compiler keeps for its next run, and is removed with it."""
        with tempfile.TemporaryDirectory() as cache:
            os.environ |= {"ZIG_GLOBAL_CACHE_DIR": cache, "ZIG_LOCAL_CACHE_DIR": cache}
            levels = {KERNELS["own_level"](TARGET)} if IS_FOR_OWN_LEVEL else None
            KERNELS["build"](KERNELS["BUILT"] if self.editable_mode else self._built, TARGET, levels=levels)

    def get_source_files(self) -> list[str]:
        """Return what a source distribution needs for this step."""
        return [str(path.relative_to(ROOT)) for path in KERNELS["source_files"]()]

    def get_outputs(self) -> list[str]:
        """Return what this step has written."""
        return [str(path) for path in self._built.glob("*")]

    def get_output_mapping(self) -> dict[str, str]:
        """Return an empty table: no output is a copy of a source."""
        return {}

    @property
    def _built(self) -> Path:
        return Path(self.build_lib or "") / KERNELS["BUILT"].relative_to(ROOT)


class Build(build):
    """The usual build, and the kernels, without what an earlier build left: files that are gone since."""

    sub_commands: ClassVar[list[tuple[str, None]]] = [*build.sub_commands, ("build_kernels", None)]

    def run(self) -> None:
        """Build into an empty folder."""
        shutil.rmtree(self.build_lib, ignore_errors=True)
        super().run()


class PlatformWheel(bdist_wheel):
    """A wheel for one platform and any Python."""

    def get_tag(self) -> tuple[str, str, str]:
        """Return the tag: the libraries work with the C libraries that TARGETS of build.py says, and newer ones.

        On Linux they name no C library, and take the few functions that they need from the one that Python has: glibc
        or musl.
        """
        system, machine = TARGET.split("-")
        linux = f"manylinux_2_17_{machine}.musllinux_1_1_{machine}"
        platform = linux if system == "linux" else f"macosx_11_0_{MAC_NAMES[machine]}"
        return "py3", "none", platform


class PlatformDistribution(Distribution):
    """A distribution that is not the same on all platforms."""

    def has_ext_modules(self) -> bool:
        """Return true."""
        return True


setup(
    distclass=PlatformDistribution,
    cmdclass={"build": Build, "build_kernels": BuildKernels, "bdist_wheel": PlatformWheel},
)

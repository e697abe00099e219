"""Compiled loops never come from a stale cache, and work without a cache."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any, cast

import numba
import pytest

from renderer.compiled import compiler

COMPILED = Path(compiler.__file__).parent
INNER = """
from renderer.compiled import jit

@jit
def number() -> int:
    return {number}
"""
OUTER = """
from renderer.inner import number
from renderer.compiled import has_cached_kernels, jit

@jit
def doubled() -> int:
    return 2 * number()

before = has_cached_kernels()
print(doubled(), before, has_cached_kernels())
"""


def _package(folder: Path, number: int) -> None:
    package = folder / "renderer"
    package.mkdir(exist_ok=True)
    (package / "__init__.py").touch()
    shutil.copytree(COMPILED, package / "compiled", ignore=shutil.ignore_patterns("__pycache__"), dirs_exist_ok=True)
    (package / "inner.py").write_text(INNER.format(number=number))
    (package / "outer.py").write_text(OUTER)


def _run(folder: Path, home: str, numba_cache_dir: str = "") -> str:
    environment = os.environ | {"PYTHONPATH": str(folder), "HOME": home, "NUMBA_CACHE_DIR": numba_cache_dir}
    command = [sys.executable, "-m", "renderer.outer"]
    return subprocess.run(
        command, cwd=folder, env=environment, check=True, capture_output=True, text=True
    ).stdout.strip()


def _set_age(folder: Path, days: int) -> None:
    then = time.time() - days * 86400
    os.utime(folder, (then, then))


@pytest.mark.parametrize("is_ours", [True, False])
def test_a_change_in_another_file_compiles_again_and_removes_old_caches(tmp_path: Path, is_ours: bool) -> None:
    """Only those that hsplat has made, and none in a folder that the user has set."""
    _package(tmp_path, 21)
    caches = tmp_path / ("renderer/__pycache__" if is_ours else "of the user")
    run = partial(_run, tmp_path, str(tmp_path), "" if is_ours else str(caches))
    assert run() == "42 False True"
    (first,) = caches.glob("kernels-*")
    of_others = [caches / "kernels-0123456789abcdef", caches / "kernels-of-mine"]
    for folder in of_others:
        folder.mkdir()
        (folder / "file").touch()
        _set_age(folder, 400)
    _set_age(first, 29)
    _package(tmp_path, 4)
    assert run() == "8 False True"
    assert run() == "8 True True"
    (second,) = {*caches.glob("kernels-*")} - {first, *of_others}
    _set_age(first, 31)
    _package(tmp_path, 5)
    assert run() == "10 False True"
    assert second.is_dir() and first.is_dir() != is_ours
    assert all((folder / "file").exists() for folder in of_others)


def test_the_cache_of_other_loops_is_where_it_was() -> None:
    cache: Any = cast(Any, compiler.jit(_doubled))._cache
    assert "kernels-" in cache.cache_path
    assert os.environ.get("NUMBA_CACHE_DIR", "") == numba.config.CACHE_DIR


def test_loops_work_where_no_cache_can_be_written(tmp_path: Path) -> None:
    _package(tmp_path, 21)
    (tmp_path / "renderer" / "__pycache__").touch()  # in the way of the folder, even for root
    assert _run(tmp_path, "/proc/nowhere") == "42 False False"


def test_processes_that_compile_at_once_do_not_mix_up_their_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second one writes its entry while the first, which has read the index, has not written its own."""
    first, second = (compiler._KernelFiles(str(tmp_path), "loop", 1) for _ in range(2))
    load = first._load_index

    def interrupted() -> dict[object, str]:
        overloads: dict[object, str] = load()
        second.save("uint8", "code for uint8")
        return overloads

    monkeypatch.setattr(first, "_load_index", interrupted)
    first.save("float32", "code for float32")
    monkeypatch.undo()
    assert first.load("float32") == "code for float32"
    assert second.load("uint8") in ("code for uint8", None)  # None: it is compiled again
    second.save("uint8", "code for uint8")
    assert (first.load("float32"), first.load("uint8")) == ("code for float32", "code for uint8")


def test_loops_are_cached_in_files_named_by_signature() -> None:
    """Numba's cache is replaced by one attribute of its own; a version that renames it must fail here."""
    assert isinstance(cast(Any, compiler.jit(_doubled))._cache._cache_file, compiler._KernelFiles)


def _doubled(number: int) -> int:
    return 2 * number


def test_a_user_without_a_home_has_a_cache_beside_the_sources_or_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The system of a container may not know its user."""

    def no_home(_: Path) -> Path:
        raise RuntimeError

    monkeypatch.setattr(Path, "home", no_home)
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    assert compiler._cache_folder() is not None
    monkeypatch.setattr(compiler, "__file__", str(tmp_path / "compiled" / "compiler.py"))
    monkeypatch.setattr(compiler._config, "CACHE_DIR", "")
    (tmp_path / "__pycache__").touch()
    assert compiler._cache_folder() is None

"""Compiled loops never come from a stale cache, and work without a cache."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, cast

import pytest

import renderer.jit

INNER = """
from renderer.jit import jit

@jit
def number() -> int:
    return {number}
"""
OUTER = """
from renderer.inner import number
from renderer.jit import has_cached_kernels, jit

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
    shutil.copy(renderer.jit.__file__, package / "jit.py")
    (package / "inner.py").write_text(INNER.format(number=number))
    (package / "outer.py").write_text(OUTER)


def _run(folder: Path, home: str) -> str:
    environment = os.environ | {"PYTHONPATH": str(folder), "HOME": home, "NUMBA_CACHE_DIR": ""}
    command = [sys.executable, "-m", "renderer.outer"]
    return subprocess.run(
        command, cwd=folder, env=environment, check=True, capture_output=True, text=True
    ).stdout.strip()


def test_a_change_in_another_file_compiles_again_and_removes_old_caches(tmp_path: Path) -> None:
    """Young caches and other folders stay."""
    _package(tmp_path, 21)
    caches = tmp_path / "renderer" / "__pycache__"
    now = time.time()
    for name, days in (("kernels-old", 31), ("kernels-young", 29), ("else", 400)):
        (caches / name).mkdir(parents=True)
        (caches / name / "file").touch()
        os.utime(caches / name, (now - days * 86400, now - days * 86400))
    assert _run(tmp_path, str(tmp_path)) == "42 False True"
    left = {path.name for path in caches.iterdir() if path.is_dir()}
    assert {"kernels-young", "else"} < left
    assert "kernels-old" not in left
    assert _run(tmp_path, str(tmp_path)) == "42 True True"
    _package(tmp_path, 4)
    assert _run(tmp_path, str(tmp_path)) == "8 False True"


def test_loops_work_where_no_cache_can_be_written(tmp_path: Path) -> None:
    _package(tmp_path, 21)
    (tmp_path / "renderer" / "__pycache__").touch()  # in the way of the folder, even for root
    assert _run(tmp_path, "/proc/nowhere") == "42 False False"


def test_processes_that_compile_at_once_do_not_mix_up_their_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second one writes its entry while the first, which has read the index, has not written its own."""
    first, second = (renderer.jit._KernelFiles(str(tmp_path), "loop", 1) for _ in range(2))
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
    assert isinstance(cast(Any, renderer.jit.jit(_doubled))._cache._cache_file, renderer.jit._KernelFiles)


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
    assert renderer.jit._cache_folder() is not None
    monkeypatch.setattr(renderer.jit, "__file__", str(tmp_path / "jit.py"))
    monkeypatch.setattr(renderer.jit._config, "CACHE_DIR", "")
    (tmp_path / "__pycache__").touch()
    assert renderer.jit._cache_folder() is None

"""Compiled loops never come from a stale or damaged cache, and work without a cache. Importing them changes nothing."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from commands import python

from renderer.compiled import kernel_cache, remove_unused_caches

RENDERER = Path(kernel_cache.__file__).parents[1]
INNER = """
from renderer.compiled import jit

@jit
def number() -> int:
    return {number}
"""
OUTER = """
from renderer.inner import number
from renderer.compiled import cache_problem, has_cached_kernels, jit

@jit
def doubled() -> int:
    return 2 * number()

before = has_cached_kernels()
print(doubled(), before, has_cached_kernels(), sum(doubled._cache_hits.values()), cache_problem())
"""
EDITED = """
from pathlib import Path
from renderer.compiled import cache_problem, has_cached_kernels
from renderer.inner import number

Path("renderer/inner.py").write_text("")
print(number(), has_cached_kernels(), cache_problem())
"""


def _package(folder: Path, number: int) -> None:
    package = folder / "renderer"
    package.mkdir(exist_ok=True)
    (package / "__init__.py").touch()
    shutil.copy(RENDERER / "errors.py", package)
    for room in ("compiled", "system"):
        shutil.copytree(
            RENDERER / room, package / room, ignore=shutil.ignore_patterns("__pycache__"), dirs_exist_ok=True
        )
    (package / "inner.py").write_text(INNER.format(number=number))
    (package / "outer.py").write_text(OUTER)


def _run(folder: Path, home: str, numba_cache_dir: str = "", program: str = "renderer.outer") -> str:
    variables = {"PYTHONPATH": str(folder), "HOME": home, "NUMBA_CACHE_DIR": numba_cache_dir}
    return python("-m", program, folder=folder, **variables).stdout.strip()


def _set_age(folder: Path, days: int) -> None:
    then = time.time() - days * 86400
    os.utime(folder, (then, then))


def test_a_change_in_another_file_compiles_again(tmp_path: Path) -> None:
    _package(tmp_path, 21)
    assert _run(tmp_path, str(tmp_path)) == "42 False True 0 None"
    _package(tmp_path, 4)
    assert _run(tmp_path, str(tmp_path)) == "8 False True 0 None"
    assert _run(tmp_path, str(tmp_path)) == "8 True True 1 None"


def test_caches_are_removed_when_they_are_old(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folders = [tmp_path / name for name in ("kernels-now", "kernels-old", "kernels-young", "kernels-of-mine")]
    for folder, days in zip(folders, (0, 31, 29, 31), strict=True):
        folder.mkdir()
        if folder.name != "kernels-of-mine":
            (folder / "CACHEDIR.TAG").write_text(kernel_cache._TAG)
        _set_age(folder, days)
    store = kernel_cache._Store()
    store.folder = folders[0]
    monkeypatch.setattr(kernel_cache, "_store", store)
    monkeypatch.setattr(kernel_cache.numba.config, "CACHE_DIR", str(tmp_path))
    remove_unused_caches()
    assert [folder.is_dir() for folder in folders] == [True] * 4
    monkeypatch.setattr(kernel_cache.numba.config, "CACHE_DIR", "")
    remove_unused_caches()
    assert [folder.is_dir() for folder in folders] == [True, False, True, True]


def test_imports_change_nothing(tmp_path: Path) -> None:
    caches = tmp_path / "caches"
    program = (
        "import sys\n"
        "from renderer.compiled import compiler, kernel_cache, lanes\n"
        "from renderer.pyramid.nodes import _build_first_level as loop\n"
        "print(lanes.num_lanes.cache_info().currsize, 'numba.np.arraymath' in sys.modules, len(loop.overloads))"
    )
    got = python("-c", program, NUMBA_CACHE_DIR=str(caches))
    assert got.stdout.split() == ["0", "False", "0"]
    assert not caches.exists()


def test_loops_work_where_no_cache_can_be_written(tmp_path: Path) -> None:
    _package(tmp_path, 21)
    (tmp_path / "renderer" / "__pycache__").touch()  # in the way of the folder, even for root
    *got, problem = _run(tmp_path, "/proc/nowhere").split(maxsplit=4)
    assert got == ["42", "False", "False", "0"]
    assert "/proc/nowhere" in problem


def test_loops_work_where_the_disk_is_full(tmp_path: Path) -> None:
    _package(tmp_path, 21)
    limited = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096)); import renderer.outer"
    (tmp_path / "limited.py").write_text(limited)
    *got, problem = _run(tmp_path, str(tmp_path), str(tmp_path / "caches"), "limited").split(maxsplit=4)
    assert got == ["42", "False", "False", "0"]
    (folder,) = (tmp_path / "caches").iterdir()
    assert problem == f"{folder}: File too large"
    assert [file.name for file in folder.iterdir()] == ["CACHEDIR.TAG"]


def test_loops_that_were_imported_before_an_edit_are_not_taken_for_later_ones(tmp_path: Path) -> None:
    _package(tmp_path, 21)
    (tmp_path / "edited.py").write_text(EDITED)
    caches = tmp_path / "caches"
    got = _run(tmp_path, str(tmp_path), str(caches), "edited")
    assert got == "21 False the sources of hsplat have changed since it was started"
    assert not caches.exists()


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a package and a cache of its loops."""
    folder = tmp_path_factory.mktemp("compiled")
    _package(folder, 21)
    assert _run(folder, str(folder), str(folder / "caches")) == "42 False True 0 None"
    return folder


def _with_a_flipped_bit(data: bytes) -> bytes:
    middle = len(data) // 2
    return data[:middle] + bytes([data[middle] ^ 1]) + data[middle + 1 :]


@pytest.mark.parametrize(
    "damage",
    [
        lambda _: b"",
        lambda data: data[: len(data) // 2],
        lambda data: bytes(len(data)),
        lambda data: data[:-4096] + bytes(4096),
        _with_a_flipped_bit,
        lambda _: b"something else",
    ],
    ids=["emptied", "halved", "zeroed", "its end zeroed", "a bit flipped", "foreign"],
)
def test_damaged_files_are_compiled_again(damage: Callable[[bytes], bytes], compiled: Path) -> None:
    for file in compiled.glob("caches/*/*.nbc"):
        file.write_bytes(damage(file.read_bytes()))
    run = partial(_run, compiled, str(compiled), str(compiled / "caches"))
    assert run() == "42 True True 0 None"
    assert run() == "42 True True 1 None"


def test_files_of_other_loops_are_compiled_again(compiled: Path) -> None:
    """As a file system may mix them up, or a copy of a cache."""
    (inner,), (outer,) = (compiled.glob(f"caches/*/*.{name}-*.nbc") for name in ("number", "doubled"))
    shutil.copy(inner, outer)
    run = partial(_run, compiled, str(compiled), str(compiled / "caches"))
    assert run() == "42 True True 0 None"
    assert run() == "42 True True 1 None"


def test_a_user_without_a_home_has_a_cache_beside_the_sources_or_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The system of a container may not know its user."""

    def no_home(_: Path) -> Path:
        raise RuntimeError

    monkeypatch.setattr(Path, "home", no_home)
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    monkeypatch.setattr(kernel_cache.numba.config, "CACHE_DIR", "")
    monkeypatch.setattr(kernel_cache, "_IMPORTED", kernel_cache._source_states())  # whatever is edited during the tests
    assert kernel_cache._Store().folder is not None
    monkeypatch.setattr(kernel_cache, "_SOURCES", tmp_path)
    (tmp_path / "__pycache__").touch()
    monkeypatch.setattr(kernel_cache, "_IMPORTED", {})
    assert kernel_cache._Store().folder is None

"""Entries of a cache folder are whole or missing, bounded, and found again by their facts alone."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from threading import Event
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from commands import environment

from renderer.cache import CacheFolder, cache_folder, caching_in
from renderer.errors import InputError

ARRAYS = {"low": np.arange(6).reshape(2, 3), "high": np.float32([1.5, np.nan])}


def test_entries_are_found_by_kind_and_facts(tmp_path: Path) -> None:
    folder = CacheFolder(tmp_path)
    folder.add("blocks", ("brain", 3), ARRAYS)
    found = folder.find("blocks", ("brain", 3))
    assert found is not None and found.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        np.testing.assert_array_equal(found[name], array)
        assert not found[name].flags.writeable
    assert folder.find("blocks", ("brain", 4)) is None
    assert folder.find("levels", ("brain", 3)) is None


def test_an_entry_that_failed_is_missing(tmp_path: Path) -> None:
    folder = CacheFolder(tmp_path)

    def fail() -> None:
        with folder.adding("blocks", 1) as making:
            np.save(making / "half.npy", ARRAYS["low"])
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert folder.find("blocks", 1) is None
    assert not list(tmp_path.iterdir())


def test_of_two_equal_entries_one_is_kept(tmp_path: Path) -> None:
    folder = CacheFolder(tmp_path)
    with folder.adding("blocks", 1) as making:
        np.save(making / "late.npy", ARRAYS["low"])
        folder.add("blocks", 1, ARRAYS)
    found = folder.find("blocks", 1)
    assert found is not None and found.keys() == ARRAYS.keys()
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("content", [b"", b"\x93NUMPY", b"not an array"])
def test_a_damaged_entry_is_removed(tmp_path: Path, content: bytes) -> None:
    folder = CacheFolder(tmp_path)
    folder.add("blocks", 1, ARRAYS)
    next(tmp_path.glob("*/high.npy")).write_bytes(content)
    assert folder.find("blocks", 1) is None
    assert not list(tmp_path.iterdir())


def test_the_least_recently_used_entry_goes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = CacheFolder(tmp_path)
    for number in range(3):
        folder.add("blocks", number, {"values": np.zeros(1000, np.uint8)})
    for age, entry in enumerate(sorted(tmp_path.iterdir(), key=lambda each: each.stat().st_mtime_ns)):
        os.utime(entry, (100 + age, 100 + age))
    assert folder.find("blocks", 0) is not None  # now the most recently used one
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=8000))
    folder.add("blocks", 3, {"values": np.zeros(1000, np.uint8)})
    assert [number for number in range(4) if folder.find("blocks", number) is not None] == [0, 3]


def test_what_a_killed_process_left_is_removed(tmp_path: Path) -> None:
    folder = CacheFolder(tmp_path)
    with folder.adding("blocks", 1):  # another process that makes an entry
        left = tmp_path / "making-left"
        left.mkdir()
        os.utime(left, (1000, 1000))
        folder.add("blocks", 2, ARRAYS)
        assert not left.exists()
        assert len(list(tmp_path.glob("making-*"))) == 1


def test_a_full_disk_is_no_error(tmp_path: Path) -> None:
    folder = CacheFolder(tmp_path)
    with folder.adding("blocks", 1):
        raise OSError(28, "No space left on device")
    assert folder.find("blocks", 1) is None


def test_a_process_has_a_folder_while_a_block_runs(tmp_path: Path) -> None:
    assert cache_folder() is None
    with caching_in(tmp_path / "new" / "folder"):
        assert cache_folder() == CacheFolder(tmp_path / "new" / "folder")
        with caching_in(None):
            assert cache_folder() is None
    assert cache_folder() is None


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("text")
    with pytest.raises(InputError, match="cannot keep anything"), caching_in(tmp_path / "file"):
        raise AssertionError("the block must not run")


def test_an_entry_that_can_only_be_read_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = CacheFolder(tmp_path)
    folder.add("blocks", 1, ARRAYS)

    def refuse(_: Path) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "utime", refuse)
    assert folder.find("blocks", 1) is not None


# Makes an entry alone, tells whether it had to, and waits for a line before the entry is whole.
_MAKER = """
import sys
from pathlib import Path
import numpy as np
from renderer.cache import CacheFolder
folder = CacheFolder(Path(sys.argv[1]), lambda text: print(text, flush=True))
with folder.alone("blocks", 1) as is_alone:
    found = folder.find("blocks", 1)
    if found is None:
        with folder.adding("blocks", 1, resumes=is_alone) as making:
            left = sorted(file.name for file in making.iterdir())
            print("makes after", *left, flush=True)
            np.save(making / "values.npy", np.arange(3))
            (making / "journal").touch()
            print("has made", flush=True)
            sys.stdin.readline()
    else:
        print("finds", *sorted(found), flush=True)
"""


@pytest.fixture
def makers(tmp_path: Path) -> Iterator[Callable[[], subprocess.Popen[str]]]:
    """Return a function that starts a process which makes the same entry."""
    with ExitStack() as stack:

        def start() -> subprocess.Popen[str]:
            command = [sys.executable, "-c", _MAKER, str(tmp_path)]
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
            maker = stack.enter_context(subprocess.Popen(command, env=environment(), text=True, **pipes))
            stack.callback(maker.kill)
            return maker

        yield start


def _line(maker: subprocess.Popen[str]) -> str:
    assert maker.stdout is not None
    return maker.stdout.readline().strip()


def test_one_process_makes_an_entry_and_others_wait(tmp_path: Path, makers: Callable[[], Any]) -> None:
    one = makers()
    assert [_line(one), _line(one)] == ["makes after", "has made"]
    others = [makers(), makers()]
    for other in others:
        assert _line(other) == "another process reads or builds the same for the cache folder; this one waits for it"
    assert one.communicate("\n")[0] == ""
    for other in others:
        assert other.communicate()[0] == "finds values\n"
    assert [entry.name.partition("-")[0] for entry in tmp_path.iterdir()] == ["blocks"]
    assert [file.name for file in tmp_path.glob("*/*")] == ["values.npy"]


def test_a_process_goes_on_with_the_entry_of_a_killed_one(tmp_path: Path, makers: Callable[[], Any]) -> None:
    """Its lock ends with it, also while another process waits."""
    one = makers()
    assert [_line(one), _line(one)] == ["makes after", "has made"]
    other = makers()
    assert _line(other).startswith("another process")
    one.kill()
    assert [_line(other), _line(other)] == ["makes after journal values.npy", "has made"]
    other.communicate("\n")
    assert [file.name for file in tmp_path.glob("*/*")] == ["values.npy"]


def test_an_entry_that_failed_may_leave_its_files_for_the_next_time(tmp_path: Path) -> None:
    folder = CacheFolder(tmp_path)

    def fail(error: BaseException) -> None:
        with folder.adding("blocks", 1, resumes=True) as making:
            assert not (making / "half").exists()
            (making / "half").touch()
            raise error

    with pytest.raises(KeyboardInterrupt):
        fail(KeyboardInterrupt())
    assert folder.find("blocks", 1) is None
    with folder.adding("blocks", 1, resumes=True) as making:
        assert (making / "half").exists()
        np.save(making / "whole.npy", ARRAYS["low"])
    assert [file.name for file in tmp_path.glob("*/*")] == ["whole.npy"]
    folder.remove("blocks", 1)
    fail(OSError("the disk is full"))  # room is given back
    assert not list(tmp_path.iterdir())


def test_locks_of_killed_processes_are_removed(tmp_path: Path) -> None:
    folder = CacheFolder(tmp_path)
    left = tmp_path / "making-blocks-1.lock"
    left.touch()
    os.utime(left, (1000, 1000))
    with folder.alone("blocks", 2):
        folder.add("blocks", 2, ARRAYS)
        assert len(list(tmp_path.glob("*.lock"))) == 1 and not left.exists()
    assert len(list(tmp_path.iterdir())) == 1


def test_a_process_that_waited_keeps_later_ones_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Though the lock file that it waited for is removed. Threads stand in for processes."""
    monkeypatch.setattr(sys.modules[CacheFolder.__module__], "_PATIENCE", 0.0)
    has_told, has_entered, may_leave = Event(), [Event(), Event()], Event()
    folder = CacheFolder(tmp_path, lambda _: has_told.set())

    def enter(number: int) -> None:
        with folder.alone("blocks", 1):
            has_entered[number].set()
            may_leave.wait()

    with ThreadPoolExecutor(2) as pool:
        with folder.alone("blocks", 1):
            pool.submit(enter, 0)
            assert has_told.wait(60)
        assert has_entered[0].wait(60)
        has_told.clear()
        pool.submit(enter, 1)
        is_out = has_told.wait(20) and not has_entered[1].is_set()
        may_leave.set()
    assert is_out and has_entered[1].is_set()
    assert not list(tmp_path.iterdir())

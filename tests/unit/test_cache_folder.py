"""Entries of a cache folder are whole or missing, bounded, and found again by their facts alone."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

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

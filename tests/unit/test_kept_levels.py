"""Levels of stores are kept in a cache folder: the same voxels come from it, and only for an unchanged store."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from store_files import field, halves, scaled, write_ome
from store_server import served_folder
from volume_files import read

from renderer.cache import caching_in
from renderer.readers import read_volume
from renderer.scene import UrlSource, VolumeSpec
from renderer.volume import Volume

FIELD = field()
LEVELS = [FIELD, halves(FIELD, 2, 2, 2)]
PLACES = [scaled(1.0, 1.0, 1.0), scaled(2.0, 2.0, 2.0)]


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Use a cache folder, and keep no image in this process."""
    monkeypatch.setattr("renderer.readers.volume_reading._SHARE_OF_DISK", 0)
    with caching_in(tmp_path / "cache"):
        yield tmp_path / "cache"


@pytest.fixture
def store(tmp_path: Path) -> Path:
    return write_ome(tmp_path / "a.ome.zarr", LEVELS, PLACES)


def facts(volume: Volume) -> object:
    return volume.world_from_index.tolist(), volume.levels, volume.note, volume.length_unit, volume.fingerprint


@pytest.mark.parametrize("level", [None, 0, 1])
def test_a_kept_level_is_the_same_volume(store: Path, cache: Path, level: int | None) -> None:
    first, second = read(store, level=level), read(store, level=level)
    with caching_in(None):
        plain = read(store, level=level)
    assert len(list(cache.glob("level-*"))) == 1
    assert facts(first) == facts(second) == facts(plain)
    np.testing.assert_array_equal(second.values, plain.values)


def test_a_changed_store_is_read_again(store: Path, cache: Path) -> None:
    read(store, level=0)
    shutil.rmtree(store)
    write_ome(store, [FIELD + 1, halves(FIELD + 1, 2, 2, 2)], PLACES)
    np.testing.assert_array_equal(read(store, level=0).values, FIELD + 1)
    assert len(list(cache.glob("level-*"))) == 2


@pytest.mark.parametrize("content", [b"", b"damaged"])
def test_a_damaged_entry_is_made_again(store: Path, cache: Path, content: bytes) -> None:
    read(store, level=0)
    for file in cache.glob("level-*/*.npy"):
        file.write_bytes(content)
    np.testing.assert_array_equal(read(store, level=0).values, FIELD)


def test_chunks_of_a_server_are_requested_once(store: Path, cache: Path) -> None:
    with served_folder(store.parent) as server:
        spec = VolumeSpec(UrlSource(f"{server.url}/{store.name}"), level=0)
        first, second = read_volume(spec), read_volume(spec)
        chunks = [path for path in server.asked if path.rpartition("/")[2][0].isdigit()]
    np.testing.assert_array_equal(first.values, second.values)
    assert chunks and len(set(chunks)) == len(chunks)
    assert facts(first) == facts(replace(second, name=first.name))

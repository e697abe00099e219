"""Levels of stores are kept in a cache folder: the same voxels come from it, and only for an unchanged store."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np
import pytest
from commands import environment
from processes import wait_until
from store_files import field, halves, scaled, write_array, write_ome
from store_server import STALL, ServedFolder, served_folder
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


def test_passes_over_a_new_entry_are_kept(store: Path, cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Entries stay as they are, so that it does not matter that their files were written a moment ago."""
    monkeypatch.setattr("renderer.readers.voxel_limits._MIN_MAPPED_BYTES", 1)
    assert read(store, level=0).fingerprint
    assert len(list(cache.glob("fingerprint-*"))) == 1


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


# The voxels along z, y and x of a level that is read in three pieces of four chunks each.
LARGE = (192, 1024, 1024)
CHUNKS = (64, 512, 512)

# Reads a level into a cache folder, whole or as blocks, and prints its sum, or the sentence that it waits.
_READ = """
import sys
from pathlib import Path
from renderer.cache import caching_in
from renderer.readers import Blocks, read_part, read_volume
from renderer.scene import UrlSource, VolumeSpec
url, cache, *in_blocks = sys.argv[1:]
spec = VolumeSpec(UrlSource(url), level=0)
with caching_in(Path(cache), lambda text: print(text, flush=True)):
    if in_blocks:
        blocks = Blocks.of_level(read_part(spec, None).levels[0])
        blocks.wanted[:] = True
        print(read_part(spec, blocks).values.sum(), flush=True)
    else:
        print(read_volume(spec).values.sum(), flush=True)
"""


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServedFolder]:
    """Serve a level of three pieces, of which each plane has another value."""
    folder = tmp_path_factory.mktemp("large")
    values = np.broadcast_to(np.arange(1, LARGE[0] + 1, dtype=np.uint8)[:, None, None], LARGE)
    codecs = [{"name": "bytes"}, {"name": "zstd", "configuration": {"level": 1}}]
    write_array(folder / "a", values, version=3, chunks=CHUNKS, codecs=codecs)
    with served_folder(folder) as server:
        yield server


@contextmanager
def _reading(server: ServedFolder, cache: Path, *in_blocks: str) -> Iterator[subprocess.Popen[str]]:
    """Run another process that reads the level, whole or as blocks."""
    command = [sys.executable, "-c", _READ, f"{server.url}/a", str(cache), *in_blocks]
    with subprocess.Popen(command, env=environment(), text=True, stdout=subprocess.PIPE) as process:
        yield process
        process.kill()


def _sum_by(process: subprocess.Popen[str]) -> int:
    return int(process.communicate()[0].split()[-1])


def _asked(server: ServedFolder) -> list[str]:
    """Return the chunks that were asked for since the last call, by the numbers along z, y and x."""
    found = sorted(path.partition("/c/")[2] for path in server.asked if "/c/" in path)
    server.asked.clear()
    return found


PIECES = [[f"{z}/{y}/{x}" for y in range(2) for x in range(2)] for z in range(3)]
SUM = LARGE[1] * LARGE[2] * LARGE[0] * (LARGE[0] + 1) // 2


def _num_finished(cache: Path) -> int:
    """Return the number of pieces that journals in the cache folder have."""
    return sum(file.read_bytes().count(b"]\n") for file in cache.glob("*/pieces.txt"))


def _kill_at(chunk: str, num: int, server: ServedFolder, cache: Path, *in_blocks: str) -> Path:
    """Kill a process that has read some pieces and waits for a chunk. Return the folder that it leaves.

    num: the number of pieces that can be read without the chunk.
    """
    server.faults = {f"c/{chunk}": [STALL]}
    with _reading(server, cache, *in_blocks) as process:
        assert wait_until(lambda: _num_finished(cache) == num, 60)
        assert wait_until(lambda: sum("/c/" in path for path in server.asked) == len([*chain(*PIECES)]), 60)
        process.kill()
    server.faults = {}
    assert _asked(server) == sorted(chain(*PIECES))
    (left,) = cache.glob("making-*/")
    return left


@pytest.mark.slow
def test_a_killed_process_loses_no_piece(large: ServedFolder, tmp_path: Path) -> None:
    left = _kill_at("2/1/1", 2, large, tmp_path)
    with _reading(large, tmp_path) as process:
        assert _sum_by(process) == SUM
    assert _asked(large) == PIECES[2] and not left.exists()
    (entry,) = tmp_path.glob("level-*")
    assert sorted(file.name for file in entry.iterdir()) == ["answer.npy", "voxels.npy"]
    with _reading(large, tmp_path) as process:
        assert _sum_by(process) == SUM
    assert _asked(large) == []


@pytest.mark.slow
def test_a_killed_process_loses_no_block(large: ServedFolder, tmp_path: Path) -> None:
    """Blocks by which levels are compared are pieces, too. A power failure has left zeros in one of them."""
    left = _kill_at("0/0/1", 11, large, tmp_path, "in blocks")
    with (left / "voxels.npy").open("r+b") as file:
        file.seek(1 << 20)
        file.write(bytes(4096))
    for num_asked in (2, 0):
        with _reading(large, tmp_path, "in blocks") as process:
            assert _sum_by(process) == SUM
        asked = _asked(large)
        assert len(asked) == num_asked and ("0/0/1" in asked) == bool(asked) and not left.exists()
    with _reading(large, tmp_path) as process:
        assert _sum_by(process) == SUM
    assert _asked(large) == []


@pytest.mark.slow
def test_pieces_that_did_not_reach_the_disk_are_read_again(large: ServedFolder, tmp_path: Path) -> None:
    """A power failure leaves zeros in a piece, or half a line of the journal."""
    left = _kill_at("2/1/1", 2, large, tmp_path)
    with (left / "voxels.npy").open("r+b") as file:
        file.seek(1 << 20)
        file.write(bytes(4096))
    with (left / "pieces.txt").open("ab") as file:
        file.write(b'["half')
    with _reading(large, tmp_path) as process:
        assert _sum_by(process) == SUM
    assert _asked(large) == sorted(PIECES[0] + PIECES[2])


@pytest.mark.slow
def test_two_processes_read_a_level_once(large: ServedFolder, tmp_path: Path) -> None:
    """One waits, and says so, until the other one has read the level, or is killed, and goes on where it was."""
    large.faults = {"c/2/1/1": [STALL]}
    with _reading(large, tmp_path) as first:
        assert wait_until(lambda: any(path.endswith("c/2/1/1") for path in large.asked), 60)
        with _reading(large, tmp_path) as second:
            assert second.stdout is not None and second.stdout.readline().startswith("another process reads")
            first.kill()
            assert _sum_by(second) == SUM
    assert len(_asked(large)) <= len(PIECES) * 4 + 2 * 4
    large.faults = {}
    shutil.rmtree(next(tmp_path.glob("level-*")))
    with _reading(large, tmp_path) as first, _reading(large, tmp_path) as second:
        assert _sum_by(first) == _sum_by(second) == SUM
    assert _asked(large) == sorted(chain(*PIECES))

"""The level of a store is chosen for another camera or look from blocks that are kept in a cache folder."""

from __future__ import annotations

import multiprocessing
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from store_files import halves, scaled, write_ome
from store_server import served_folder

from renderer.cache import caching_in
from renderer.draw import open_rasterizer
from renderer.frame import prepare_stage, render_frames
from renderer.kernels import PlacedVoxels
from renderer.layers import number_labels
from renderer.readers import (
    Blocks,
    Image,
    RecentImages,
    find_marks,
    looking_once,
    read_isolated,
    read_part,
    read_volume,
    state_of_store,
)
from renderer.resolve import resolve_scene
from renderer.scene import FileSource, FilmScene, LevelChoice, VolumeSpec, parse_scene, with_tolerance
from renderer.volume import Array, make_volume

SIDE = 64
CHUNK = 16
LOOK = [{"value": 20, "color": "navy", "opacity": 0}, {"value": 250, "color": "orange", "opacity": 0.2}]
OTHER_LOOK = [{"value": 100, "color": "black", "opacity": 0}, {"value": 200, "color": "white", "opacity": 0.5}]


def field(*, is_rough: bool) -> Array:
    z, y, x = np.meshgrid(*[np.linspace(-1, 1, SIDE)] * 3, indexing="ij")
    waves = np.sin(60 * x) * np.sin(60 * y) * np.sin(60 * z) > 0
    return (250 * np.exp(-3 * (x**2 + y**2 + z**2)) * (waves | (not is_rough))).astype(np.uint8)


def write_store(folder: Path, finest: Array) -> Path:
    """Write a store whose levels are means of 2^3 voxels of the one before."""
    levels = [finest]
    for _ in range(2):
        levels.append(halves(levels[-1], 2, 2, 2))
    places = [scaled(*[2.0**k] * 3, translation=[0.5 * (2.0**k - 1)] * 3) for k in range(3)]
    return write_ome(folder, levels, places, chunks=[CHUNK] * 3)


@pytest.fixture(params=[False, True], ids=["smooth", "rough"])
def store(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """Write a store of which a coarse level is exact enough, or one that needs the finest."""
    return write_store(tmp_path / "stores" / "a", field(is_rough=request.param))


@pytest.fixture(autouse=True)
def _few_rays(monkeypatch: pytest.MonkeyPatch) -> None:
    """Measure with rays that leave chunks out, and keep small arrays, too."""
    monkeypatch.setattr("renderer.resolve.level_errors._NUM_CELLS", 2)
    monkeypatch.setattr("renderer.cache.kept_arrays.LEAST_BYTES", 0)


def scene_of(place: Path | str, elevation: float = 20, look: Any = None) -> FilmScene:
    tree = {
        "version": 1,
        "volume": {"file": str(place)},
        "transfer_function": {"points": look or LOOK},
        "camera": {"path": {"type": "turntable", "frames": 1, "elevation": elevation}},
        "error": {"psnr": 40},
        "output": {"file": "/film-{frame}.png", "size": [48, 48]},
    }
    return parse_scene(tree, base=Path("/"))


def chosen(scene: FilmScene) -> LevelChoice:
    """Return the level that is chosen for a scene, and forget what this process has read, as another process does."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("renderer.readers.volume_reading._RECENT_IMAGES", RecentImages(lambda _: 1e9))
        volume = resolve_scene(scene, read_volume).at(0).layers[0].volume
        read_volume(volume)
    assert volume.chosen is not None
    return volume.chosen


def chosen_in(cache: Path | None, place: str, elevation: float) -> LevelChoice:
    with caching_in(cache):
        return chosen(scene_of(place, elevation))


@pytest.mark.slow
def test_no_chunk_is_asked_for_twice_by_films_of_other_cameras_and_looks(store: Path, tmp_path: Path) -> None:
    with served_folder(store.parent) as server, caching_in(tmp_path / "cache"):
        url, found, counts = f"{server.url}/a", list[LevelChoice](), list[int]()
        for scene in (scene_of(url), scene_of(url, -50), scene_of(url, look=OTHER_LOOK)):
            found.append(chosen(scene))
            counts.append(sum("/a/0/" in path and path[-1].isdigit() for path in server.asked))
        chunks = Counter(path for path in server.asked if path[-1].isdigit())
    assert max(chunks.values()) == 1
    # Another camera meets other chunks, unless the whole level is drawn.
    if found[0].number == 0:
        assert counts == [(SIDE // CHUNK) ** 3] * 3
    else:
        assert counts[0] < counts[1] < (SIDE // CHUNK) ** 3
    assert found[1] == chosen(scene_of(store, -50))


@pytest.mark.parametrize("store", [False], indirect=True)
def test_blocks_take_the_room_of_their_chunks(store: Path, tmp_path: Path) -> None:
    with caching_in(tmp_path / "cache"):
        read = chosen(scene_of(store)).num_measured
    (file,) = (tmp_path / "cache").glob("part-*/voxels.npy")
    # A chunk has the bytes of a page, and lies in two of them, as the file begins with a header.
    most = 2 * read + 8192
    assert 0 < most < SIDE**3 < file.stat().st_size
    assert 512 * file.stat().st_blocks <= most


@pytest.mark.slow
@pytest.mark.parametrize("store", [False], indirect=True)
def test_a_damaged_part_is_read_again(store: Path, tmp_path: Path) -> None:
    plain = chosen(scene_of(store, -50))
    with caching_in(tmp_path / "cache"):
        chosen(scene_of(store))
        (file,) = (tmp_path / "cache").glob("part-*/blocks.npy")
        np.save(file, np.ones(3))
        assert chosen(scene_of(store, -50)) == plain


@pytest.mark.slow
@pytest.mark.parametrize("store", [False], indirect=True)
def test_two_processes_at_once_choose_the_same(store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(Path(__file__).parents[2])  # where the processes find this module
    cameras = (20.0, -50.0)
    plain = [chosen_in(None, str(store), elevation) for elevation in cameras]
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn"), initializer=few_rays) as processes:
        found = [processes.submit(chosen_in, tmp_path / "cache", str(store), elevation) for elevation in cameras]
        assert [each.result() for each in found] == plain


def few_rays() -> None:
    pytest.MonkeyPatch().setattr("renderer.resolve.level_errors._NUM_CELLS", 2)


@pytest.mark.slow
@pytest.mark.parametrize("store", [False], indirect=True)
def test_pictures_are_the_same_with_and_without_the_cache(store: Path, tmp_path: Path) -> None:
    scenes = [scene_of(store), scene_of(store, -50)]
    plain = [picture(scene) for scene in scenes]
    with caching_in(tmp_path / "cache"):
        for scene, expected in zip(scenes * 2, plain * 2, strict=True):
            np.testing.assert_array_equal(picture(scene), expected)


def picture(scene: FilmScene) -> npt.NDArray[np.float32]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("renderer.readers.volume_reading._RECENT_IMAGES", RecentImages(lambda _: 1e9))
        film = with_tolerance(resolve_scene(scene, read_volume), 0.1)
        with prepare_stage(film, clock=lambda: 0.0, num_threads=2) as stage, open_rasterizer(film) as rasterizer:
            (frame,) = render_frames(stage, [0], rasterizer, clock=lambda: 0.0)
            return frame.radiance


@pytest.mark.usefixtures("one_process")
def test_the_rest_of_a_cropped_level_is_read_beside_its_blocks(tmp_path: Path) -> None:
    finest = field(is_rough=True)
    spec = VolumeSpec(FileSource(write_store(tmp_path / "a", finest)), level=0, crop=((10, 50), None, (3, 64)))
    plan = read_part(spec, None)
    assert plan is not None
    for number in range(2):  # blocks are added to those that were read before
        blocks = Blocks.of_level(plan.levels[0])
        blocks.wanted[number : number + 2, 1, :3] = True
        part = read_part(spec, blocks)
    assert part is not None and part.blocks is not None and part.box is not None
    assert part.blocks.wanted.sum() == 9
    z, y, x = part.blocks.places(part.box)
    found = part.values.reshape(-1)[z[:, None, None] + y[:, None] + x]
    np.testing.assert_array_equal(found[: 48 - 3, 16:32, : 48 - 10], finest[3:48, 16:32, 10:48])
    assert np.count_nonzero(found) == np.count_nonzero(finest[3:48, 16:32, 10:48])
    np.testing.assert_array_equal(read_volume(spec).values, finest[3:, :, 10:50])


def test_a_part_may_lack_labels_of_the_whole_volume() -> None:
    volume = make_volume(np.zeros((1, 1, 3), np.uint8), np.eye(4), "a")
    places = [np.arange(length) for length in volume.values.shape]
    part = PlacedVoxels(np.array([0, 7, 7], np.uint8), *places)
    numbered = number_labels(replace(volume, voxels=part), [2, 7])
    assert numbered.voxels is not None
    np.testing.assert_array_equal(numbered.voxels.values, [0, 2, 2])


@pytest.mark.parametrize("store", [False], indirect=True)
def test_a_film_of_another_camera_reads_blocks_alone(
    store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All blocks are read at once, and the same film reads nothing. A choice looks at the files of the store once."""
    reads, looks = list[Any](), list[Path]()
    look = find_marks

    def counted_read(*arguments: Any, **options: Any) -> Image:
        reads.append(options.get("blocks"))
        return read_isolated(*arguments, **options)

    def counted_look(place: Path) -> str:
        looks.append(place)
        return look(place)

    monkeypatch.setattr("renderer.readers.volume_reading.read_isolated", counted_read)
    monkeypatch.setattr("renderer.readers.kept_levels.find_marks", counted_look)
    with caching_in(tmp_path / "cache"):
        assert chosen(scene_of(store)).number > 0 and () in reads
        for scene, num_reads in ((scene_of(store), 0), (scene_of(store, -50), 1)):
            reads.clear()
            looks.clear()
            monkeypatch.setattr("renderer.readers.volume_reading._RECENT_IMAGES", RecentImages(lambda _: 1e9))
            resolve_scene(scene, read_volume)
            assert len(reads) == num_reads and all(reads) and looks == [store]


def test_a_store_is_looked_at_again_after_a_choice(store: Path) -> None:
    spec = VolumeSpec(FileSource(store), level=0)
    with looking_once():
        before = state_of_store(spec)
        (store / "more").write_bytes(b"")
        with looking_once():
            assert state_of_store(spec) != before
        assert state_of_store(spec) == before
    assert state_of_store(spec) != before

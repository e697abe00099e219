"""Films from a cache have the same bytes, and neither changed files nor damaged entries are taken for the volume."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import product
from pathlib import Path
from threading import Barrier
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner

from hsplat_cli.commands.info import info
from hsplat_cli.commands.init import init
from renderer.cache import caching_in
from renderer.draw import open_rasterizer
from renderer.frame import prepare_stage, render_frames
from renderer.pyramid import Pyramid, build_pyramid
from renderer.readers import read_volume
from renderer.resolve import resolve_scene
from renderer.scene import FilmScene, parse_scene
from renderer.volume import Array, MappedFile

# Voxels along x, y and z: no multiples of the sides of blocks and bricks.
SHAPE = (50, 41, 37)
TIMES = 3
POINTS = [{"value": 60, "color": "navy", "opacity": 0}, {"value": 200, "color": "orange", "opacity": 0.5}]
LIGHT = {"light": [1, 1, 1], "ambient": 0.3, "diffuse": 0.7}
LOOK: dict[str, Any] = {"transfer_function": {"points": POINTS}}
OPAQUE = {"transfer_function": {"points": [{**POINTS[0], "value": 150}, {**POINTS[1], "opacity": 1.0}]}}
LOOKS: dict[str, dict[str, Any]] = {
    "plain": LOOK,
    "lit": {**LOOK, "shading": LIGHT},
    "occluded": {**LOOK, "shading": {**LIGHT, "occlusion": 0.6, "shadow": 0.5}},
    "clipped": {
        **LOOK,
        "shading": {**LIGHT, "occlusion": 0.6},
        "clip": [{"plane": {"point": [20, 20, 20], "normal": [1, 1, 0]}}],
    },
    "opaque": OPAQUE,
    "maximum": {**LOOK, "mode": {"type": "maximum"}},
    "scalar": {**LOOK, "error": {"of": "scalar", "measure": "rms", "tolerance": 2.0}},
}


@pytest.fixture(autouse=True)
def _all_volumes_are_large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep what is made of volumes of any size, whose voxels stay in their files."""
    monkeypatch.setattr("renderer.readers.voxel_limits._MIN_MAPPED_BYTES", 1)
    monkeypatch.setattr("renderer.cache.kept_arrays.LEAST_BYTES", 1)


def ball(dtype: str, seed: int = 0) -> Array:
    """Return a ball of noise in nothing."""
    z, y, x = (np.linspace(-1, 1, num) for num in SHAPE[::-1])
    radius = np.sqrt(x**2 + y[:, None] ** 2 + z[:, None, None] ** 2)
    noise = np.random.default_rng(seed).integers(0, 60, radius.shape)
    return np.where(radius < 0.7, 120 + noise, 0).astype(dtype)


def scene_of(folder: Path, values: Array, look: str | dict[str, Any]) -> dict[str, Any]:
    """Write a volume that was changed long ago, and return its scene as plain data."""
    file = folder / "volume.npy"
    np.save(file, values)
    os.utime(file, (1000, 1000))
    return {
        "volume": {"file": str(file), "spacing": [1, 1, 1.5]},
        "camera": {"path": {"type": "turntable", "frames": 8}},
        "output": {"file": "film.mp4", "size": [40, 30]},
        **(LOOKS[look] if isinstance(look, str) else look),
    }


def picture(tree: dict[str, Any], cache: Path | None, frame: int = 0) -> npt.NDArray[np.float32]:
    """Return a frame of a film."""
    with caching_in(cache):
        return drawn(resolve_scene(parse_scene(tree, base=Path("/")), read_volume), frame)


def drawn(scene: FilmScene, frame: int) -> npt.NDArray[np.float32]:
    with (
        prepare_stage(scene, clock=lambda: 0.0, num_threads=2) as stage,
        open_rasterizer(scene) as rasterizer,
    ):
        (made,) = render_frames(stage, [frame], rasterizer, clock=lambda: 0.0)
        return made.radiance


def kinds_in(cache: Path) -> set[str]:
    """Return the kinds of entries in a folder."""
    return {entry.name.partition("-")[0] for entry in cache.iterdir()}


@pytest.fixture
def no_builds(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Return a function after whose call no pass over voxels for a layer or a fingerprint succeeds."""

    def fail(*_: object, **__: object) -> None:
        raise AssertionError("the voxels were read again")

    def forbid() -> None:
        for place in ("bricks.bricks.build_pyramid", "lighting.light_grid._factors", "volume.fingerprint.iter_slabs"):
            monkeypatch.setattr(f"renderer.{place}", fail)

    return forbid


@pytest.mark.parametrize(
    ("look", "dtype"),
    [
        *product(LOOKS, ("uint8", "float32")),
        *product(
            ("plain", "occluded"), ("uint16", "int16", "float64")
        ),  # kept as they are, and as what is made of them
    ],
)
def test_films_from_the_cache_have_the_same_bytes(
    look: str, dtype: str, tmp_path: Path, no_builds: Callable[[], None]
) -> None:
    """The second film, of another camera, builds nothing."""
    tree, cache = scene_of(tmp_path, ball(dtype), look), tmp_path / "cache"
    plain = [picture(tree, None, frame) for frame in (0, 3)]
    assert plain[0].any()
    np.testing.assert_array_equal(picture(tree, cache), plain[0])
    no_builds()
    np.testing.assert_array_equal(picture(tree, cache, 3), plain[1])


def of_absent(folder: Path) -> dict[str, Any]:
    values = ball("float32")
    values[10:20, 5:30, 8:40] = np.nan
    return scene_of(folder, values, "lit")


def of_labels(folder: Path) -> dict[str, Any]:
    look = {"labels": {"colors": {120: "red"}, "opacity": 0.5, "hide": [160]}, "shading": LIGHT}
    return scene_of(folder, ball("uint8") // 40 * 40, look)


def of_mask(folder: Path) -> dict[str, Any]:
    mask = folder / "mask.npy"
    np.save(mask, (np.indices(SHAPE[::-1])[2] > 24).astype(np.uint8))
    os.utime(mask, (1000, 1000))
    tree = scene_of(folder, ball("uint8"), "plain")
    return {**tree, "mask": {"file": str(mask), "spacing": [1, 1, 1.5], "show": [1]}}


def of_crop(folder: Path) -> dict[str, Any]:
    tree = scene_of(folder, ball("uint16"), "lit")
    return {**tree, "volume": {**tree["volume"], "crop": {"z": [4, 30]}}}


def of_mixed_times(folder: Path) -> dict[str, Any]:
    tree = of_times(folder)
    motion = {0: 0, 7: 2}
    return {**tree, "volume": {**tree["volume"], "time": motion, "interpolate": True}}


def of_times(folder: Path) -> dict[str, Any]:
    tree = scene_of(folder, np.stack([ball("uint8", seed) for seed in range(TIMES)]), "plain")
    return {**tree, "volume": {**tree["volume"], "time": 1}}


@pytest.mark.parametrize("make", [of_absent, of_labels, of_mask, of_crop, of_times, of_mixed_times])
def test_all_kinds_of_volumes_have_the_same_bytes(make: Callable[[Path], dict[str, Any]], tmp_path: Path) -> None:
    tree, cache = make(tmp_path), tmp_path / "cache"
    plain = picture(tree, None, 5)
    assert plain.any()
    for _ in range(2):
        np.testing.assert_array_equal(picture(tree, cache, 5), plain)
    assert "bricks" in kinds_in(cache)


def test_another_look_after_the_first_one(tmp_path: Path) -> None:
    tree, cache = scene_of(tmp_path, ball("uint8"), "plain"), tmp_path / "cache"
    picture(tree, cache)
    for look in LOOKS.values():
        changed = {**tree, **look}
        np.testing.assert_array_equal(picture(changed, cache), picture(changed, None))


def two_blocks(dtype: str) -> Array:
    """Return a block of low noise and a block of high noise, side by side along x, each four bricks long."""
    values = np.random.default_rng(0).integers(90, 110, (64, 64, 128)).astype(dtype)
    values[..., 64:] += 100
    values[0, 0, :2] = 0, 255  # the range stays the same, whatever is written into bricks
    return values


def write_unnoticed(file: Path, hidden: slice) -> int:
    """Write high values into the middles of bricks of a volume, `hidden` along x, and return how many bricks it were.

    Halos reach one voxel into a brick.
    """
    values = np.load(file, mmap_mode="r+")
    bricks = values[..., hidden].reshape(4, 16, 4, 16, -1, 16)
    bricks[:, 1:-1, :, 1:-1, :, 1:-1] = 250
    values.flush()
    os.utime(file, (1000, 1000))
    return bricks.shape[0] * bricks.shape[2] * bricks.shape[4]


HIGH: dict[str, Any] = {
    "transfer_function": {"points": [{**POINTS[0], "value": 150}, {**POINTS[1], "value": 250, "opacity": 0.2}]}
}
HIGH_LOOKS: dict[str, dict[str, Any]] = {
    "plain": HIGH,
    "lit": {**HIGH, "shading": LIGHT},
    "occluded": {**HIGH, "shading": {**LIGHT, "occlusion": 0.6, "shadow": 0.5}},
    "averaged opacities": {**HIGH, "pyramid": {"average": "opacity"}},
    "splats": {**HIGH, "splat": {"footprint": "gaussian"}, "error": {"tolerance": 1.0}},
}


@pytest.mark.parametrize(
    ("first", "look", "dtype"),
    [
        *product([0], HIGH_LOOKS, ["uint8"]),
        *product([32], HIGH_LOOKS, ["float32"]),
        *product([0, 32], ["plain"], ["int16", "uint16"]),
    ],
)
def test_another_look_reads_no_bricks_that_it_does_not_show(
    look: str, dtype: str, first: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After the first look, other voxels are in bricks that the second one does not show, and nobody can notice.

    first: the first plane of the volume.
    """
    tree, cache = scene_of(tmp_path, two_blocks(dtype), LOOK), tmp_path / "cache"
    tree["volume"]["crop"] = {"z": [first, 64]}
    changed = {**tree, **HIGH_LOOKS[look]}
    plain = picture(changed, None)
    assert plain.any()
    monkeypatch.setattr("renderer.volume.kept_passes.time_of_change", lambda _: 0)
    monkeypatch.setattr(MappedFile, "require_unchanged", lambda _: None)
    picture(tree, cache)
    assert write_unnoticed(Path(tree["volume"]["file"]), slice(16, 48)) == 32
    np.testing.assert_array_equal(picture(changed, cache), plain)
    assert not np.array_equal(picture(changed, None), plain)


def of_two_labels(folder: Path) -> list[dict[str, Any]]:
    """Return the scenes of a volume of two labels, each of which shows one of them."""
    values = np.full((64, 64, 128), 1, np.uint8)
    values[..., 64:] = 2
    return [scene_of(folder, values, {"labels": {"opacity": 0.5, "hide": [label]}}) for label in (1, 2)]


def of_two_masks(folder: Path) -> list[dict[str, Any]]:
    """Return the scenes of a volume: the maximum in one half, and light in the other half."""
    tree = scene_of(folder, two_blocks("uint8"), LOOK)
    mask = folder / "mask.npy"
    np.save(mask, np.repeat(np.uint8([1, 2]), 64) + np.zeros((64, 64, 1), np.uint8))
    os.utime(mask, (1000, 1000))
    masks = [{"mask": {"file": str(mask), "spacing": [1, 1, 1.5], "show": [label]}} for label in (1, 2)]
    return [{**tree, **masks[0], "mode": {"type": "maximum"}}, {**tree, **masks[1]}]


@pytest.mark.parametrize("make", [of_two_labels, of_two_masks])
def test_ranges_of_voxels_that_a_look_changed_are_not_kept(
    make: Callable[[Path], list[dict[str, Any]]], tmp_path: Path
) -> None:
    one, other = make(tmp_path)
    cache = tmp_path / "cache"
    picture(one, cache)
    assert "bricks" in kinds_in(cache) and "ranges" not in kinds_in(cache)
    plain = picture(other, None)
    assert plain.any()
    np.testing.assert_array_equal(picture(other, cache), plain)


@pytest.mark.parametrize(
    "dtype", ["uint8", *(pytest.param(each, marks=pytest.mark.slow) for each in ("int16", "int32")), "float32"]
)
def test_the_second_look_at_a_volume_passes_over_no_voxels(
    dtype: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`info` and `init` print the same, with a cache and without one."""
    tree, cache = scene_of(tmp_path, ball(dtype), "plain"), tmp_path / "cache"
    file = tree["volume"]["file"]

    def said(*options: str) -> list[str]:
        results = [
            CliRunner().invoke(command, [file, *options, *more], catch_exceptions=False)
            for command, more in ((info, ["--json"]), (init, []))
        ]
        assert [result.exit_code for result in results] == [0, 0]
        return [result.stdout for result in results]

    plain = said()
    assert said("--cache", str(cache)) == plain

    def of_memory(values: Array, source: MappedFile | None, _: int) -> Iterator[Array]:
        assert source is None, "the file was read again"
        return (values[k : k + 1] for k in range(len(values)))

    monkeypatch.setattr("renderer.volume.slabs._slabs", of_memory)
    assert said("--cache", str(cache)) == plain


def changed_files(tree: dict[str, Any]) -> Iterator[Callable[[], None]]:
    """Yield functions that change the file of a scene, but neither its name nor its size."""
    file = Path(tree["volume"]["file"])

    def write_into(time: int) -> None:
        with file.open("r+b") as opened:
            opened.seek(-30000, os.SEEK_END)
            opened.write(bytes([255] * 10000))
        os.utime(file, (time, time))

    def replace() -> None:
        np.save(file.with_name("new.npy"), ball("uint8", 7))
        file.with_name("new.npy").replace(file)
        os.utime(file, (1000, 1000))

    # The earlier time of change is 1000, too.
    yield from (partial(write_into, 2000), partial(write_into, 1000), replace)


@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_changed_file_is_read_again(number: int, tmp_path: Path) -> None:
    tree, cache = scene_of(tmp_path, ball("uint8"), "plain"), tmp_path / "cache"
    before = picture(tree, cache)
    [*changed_files(tree)][number]()
    now = picture(tree, cache)
    assert not np.array_equal(now, before)
    np.testing.assert_array_equal(now, picture(tree, None))
    np.testing.assert_array_equal(picture({**tree, **OPAQUE}, cache), picture({**tree, **OPAQUE}, None))


def test_a_file_that_has_just_changed_is_not_trusted(tmp_path: Path) -> None:
    tree, cache = scene_of(tmp_path, ball("uint8"), "plain"), tmp_path / "cache"
    os.utime(tree["volume"]["file"])
    picture(tree, cache)
    assert kinds_in(cache) == {"bricks", "ranges"}  # found by the voxels themselves, which are read again


@pytest.mark.slow
def test_damaged_entries_are_made_again(tmp_path: Path) -> None:
    tree, cache = scene_of(tmp_path, ball("uint8"), "occluded"), tmp_path / "cache"
    plain = picture(tree, cache)
    files = sorted(cache.glob("*/*.npy"))
    assert len(files) > 20
    for file in files:
        whole = file.read_bytes()
        file.write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))
        np.testing.assert_array_equal(picture(tree, cache), plain)
        assert file.read_bytes() == whole, file
    files[0].unlink()
    np.testing.assert_array_equal(picture(tree, cache), plain)
    assert files[0].exists()


def test_two_films_at_a_time_build_a_layer_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each thread stands in for a process: its lock keeps the other one out, too."""
    tree, cache = scene_of(tmp_path, ball("uint8"), "occluded"), tmp_path / "cache"
    built, are_there = list[int](), Barrier(2)
    plain = picture(tree, None)

    def build(*arguments: Any, **options: Any) -> Pyramid:
        built.append(1)
        return build_pyramid(*arguments, **options)

    monkeypatch.setattr("renderer.bricks.bricks.build_pyramid", build)
    scene = resolve_scene(parse_scene(tree, base=Path("/")), read_volume)

    def draw(_number: int) -> npt.NDArray[np.float32]:
        are_there.wait()
        return drawn(scene, 0)

    with caching_in(cache), ThreadPoolExecutor(2) as pool:
        for found in pool.map(draw, range(2)):
            np.testing.assert_array_equal(found, plain)
    assert len(built) == 1

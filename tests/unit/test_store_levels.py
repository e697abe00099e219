"""The level of a store that is drawn: the coarsest one that is exact enough, measured by rays that read few chunks."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from click.testing import CliRunner
from store_files import halves, scaled, write_ome

from hsplat_cli.commands.check import check
from hsplat_cli.commands.info import info
from hsplat_cli.commands.init import init
from hsplat_cli.commands.render import render
from renderer.accuracy import TRUTH_TOLERANCE, ErrorSamples, compute_truth, psnr
from renderer.cache import caching_in
from renderer.frame import FilmStage, prepare_stage, view_of
from renderer.readers import Blocks, read_part, read_volume
from renderer.resolve import LevelErrors, mean_around, resolve_scene
from renderer.scene import FileSource, FilmScene, LevelChoice, VolumeSpec, parse_scene, scene_to_dict, with_tolerance
from renderer.stores import Store
from renderer.truth import SceneRays, pixel_centres
from renderer.volume import Array, Float64, Volume, VolumeLevel

SIDE = 64
POINTS = [
    {"value": 20, "color": "#000040", "opacity": 0},
    {"value": 120, "color": "#ff8000", "opacity": 0.05},
    {"value": 250, "color": "#ffffff", "opacity": 0.2},
]


def _grid() -> Float64:
    """Return the coordinates of voxels along z, y and x, from -1 to 1."""
    return np.array(np.meshgrid(*[np.linspace(-1, 1, SIDE)] * 3, indexing="ij"))


def smooth() -> Array:
    return (250 * np.exp(-3 * (_grid() ** 2).sum(axis=0))).astype(np.uint8)


def rough() -> Array:
    return (smooth() * (np.prod(np.sin(60 * _grid()), axis=0) > 0)).astype(np.uint8)


def write_store(folder: Path, finest: Array, chunk: int = 8, num: int = 4) -> Path:
    """Write a store whose levels are means of 2^3 voxels of the one before."""
    levels, places = [finest], []
    for _ in range(num - 1):
        levels.append(halves(levels[-1], 2, 2, 2))
    for k in range(num):
        places.append(scaled(*[2.0**k] * 3, translation=[0.5 * (2.0**k - 1)] * 3))
    return write_ome(folder, levels, places, chunks=[chunk] * 3)


def scene_of(volume: Path, *, frames: int = 4, **keys: Any) -> FilmScene:
    tree = {
        "version": 1,
        "volume": {"file": str(volume), **keys},
        "transfer_function": {"points": POINTS},
        "camera": {"path": {"type": "turntable", "frames": frames}},
        "error": {"psnr": 40},
        "output": {"file": "film-{frame}.png", "size": [48, 48]},
    }
    return parse_scene(tree, base=volume.parent)


def choice_of(scene: FilmScene) -> LevelChoice:
    """Return the level that is chosen for a scene's volume."""
    volume = resolve_scene(scene, read_volume).at(0).layers[0].volume
    assert volume.chosen is not None and volume.level == volume.chosen.number
    return volume.chosen


def at_level(number: int) -> Callable[[VolumeSpec], Volume]:
    return lambda volume: read_volume(replace(volume, level=number))


def stage_of(scene: FilmScene, level: int) -> FilmStage:
    leveled = scene.changed(lambda each: each.with_layers(volume=replace(each.layers[0].volume, level=level)))
    return prepare_stage(leveled, clock=lambda: 0.0, num_threads=2)


@pytest.mark.usefixtures("one_process")
def test_a_smooth_field_takes_a_coarse_level_and_a_rough_one_the_finest(tmp_path: Path) -> None:
    found = choice_of(scene_of(write_store(tmp_path / "a", smooth(), 16)))
    assert found.number in (1, 2) and found.num_levels == 4 and found.psnr and found.psnr > 43
    assert found.num_bytes == (SIDE >> found.number) ** 3
    assert choice_of(scene_of(write_store(tmp_path / "b", rough(), 16))).number == 0
    finest = choice_of(with_tolerance(scene_of(tmp_path / "a"), 0.0))
    assert finest.number == 0 and finest.num_measured == 0


@pytest.mark.slow
@pytest.mark.usefixtures("one_process")
@pytest.mark.parametrize("field", [smooth, rough])
def test_the_error_is_that_of_whole_exact_pictures(tmp_path: Path, field: Any) -> None:
    scene = scene_of(write_store(tmp_path / "a", field()))
    coarse = stage_of(scene, 2)
    samples = LevelErrors(coarse, lambda _: True, at_level(3)).error_of(at_level(2))
    # The cameras of both stages are those of the coarse level.
    camera = replace(coarse.scene.at(0).camera, target=coarse.target, distance=coarse.distance)
    framed = scene.changed(lambda each: replace(each, camera=camera))
    true = []
    for frame in (0, 1, 2):
        one, two = (compute_truth(stage_of(framed, level), frame, TRUTH_TOLERANCE) for level in (0, 2))
        noise = one.means.variances.mean() + two.means.variances.mean()
        true.append(((one.picture - two.picture) ** 2).mean() - noise)
    assert abs(psnr(samples.mean) - psnr(float(np.mean(true)))) < 2.5
    low, high = samples.interval
    assert low <= np.mean(true) <= high


class _Reads:
    """The boxes of each level that stores have read."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.boxes: dict[int, list[tuple[slice, ...]]] = {}
        original = Store.read_box

        def read_box(store: Store, level: int, box: Sequence[Any], out: Array) -> None:
            self.boxes.setdefault(level, []).append(tuple(box))
            original(store, level, box, out)

        monkeypatch.setattr(Store, "read_box", read_box)

    def num_voxels(self, level: int) -> int:
        return sum(int(np.prod([part.stop - part.start for part in box])) for box in self.boxes.get(level, []))


@pytest.mark.usefixtures("one_process")
def test_only_the_chunks_near_rays_are_read_and_each_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_store(tmp_path / "a", smooth())
    reads = _Reads(monkeypatch)
    monkeypatch.setattr("renderer.resolve.level_errors._NUM_CELLS", 2)
    found = choice_of(scene_of(folder, frames=1))
    assert 0 < found.num_measured == reads.num_voxels(0) < SIDE**3 / 4
    read = np.zeros([SIDE] * 3, np.int64)
    for box in reads.boxes[0]:
        read[box] += 1
    assert read.max() == 1
    # The chosen level and coarser ones were read. Level 3, with too few voxels, says where errors are.
    assert found.number < 3 and sorted(reads.boxes) == [0, *range(found.number, 4)]


@pytest.mark.usefixtures("one_process")
def test_chunks_that_were_measured_are_not_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the finest level is drawn, the rest of it is read, and the voxels are those of the whole level."""
    scene = scene_of(write_store(tmp_path / "a", rough()), frames=1)
    reads = _Reads(monkeypatch)
    monkeypatch.setattr("renderer.resolve.level_errors._NUM_CELLS", 2)
    volume = resolve_scene(scene, read_volume).at(0).layers[0].volume
    assert volume.level == 0 and 0 < reads.num_voxels(0) < SIDE**3
    np.testing.assert_array_equal(read_volume(volume).values, rough())
    read = np.zeros([SIDE] * 3, np.int64)
    for box in reads.boxes[0]:
        read[box] += 1
    assert read.min() == read.max() == 1


@pytest.mark.usefixtures("one_process")
def test_a_kept_choice_takes_no_measurement(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is measured again for another look, for a changed store, and where the entry is damaged."""
    scene = scene_of(write_store(tmp_path / "a", smooth()), frames=1)
    monkeypatch.setattr("renderer.cache.kept_arrays.LEAST_BYTES", 0)
    monkeypatch.setattr("renderer.resolve.level_errors._NUM_CELLS", 2)
    plain, measured = choice_of(scene), list[LevelErrors]()
    original = LevelErrors.error_of

    def error_of(errors: LevelErrors, volume_of: Callable[[VolumeSpec], Volume]) -> Any:
        measured.append(errors)
        return original(errors, volume_of)

    monkeypatch.setattr(LevelErrors, "error_of", error_of)

    def is_measured(changed: FilmScene) -> bool:
        measured.clear()
        choice_of(changed)
        return bool(measured)

    with caching_in(tmp_path / "cache"):
        assert choice_of(scene) == plain and measured
        measured.clear()
        assert choice_of(scene) == plain and not measured
        tree = scene_to_dict(scene)
        elsewhere = tree["output"] | {"file": "/b-{frame}.png"}
        assert not is_measured(parse_scene(tree | {"output": elsewhere}, base=tmp_path))
        path = tree["camera"]["path"] | {"elevation": 50}
        assert is_measured(parse_scene(tree | {"camera": tree["camera"] | {"path": path}}, base=tmp_path))
        other = tree["output"] | {"background": "#ff0000"}
        assert is_measured(parse_scene(tree | {"output": other}, base=tmp_path))
        for file in (tmp_path / "cache").glob("choice-*/*.npy"):
            file.write_bytes(b"damaged")
        assert is_measured(scene) and not is_measured(scene)
        chunk = next(path for path in (tmp_path / "a" / "0").rglob("*") if path.is_file() and path.name.startswith("0"))
        chunk.write_bytes(chunk.read_bytes())
        assert is_measured(scene)


@pytest.mark.usefixtures("one_process")
def test_an_error_near_the_allowed_one_is_measured_by_more_rays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once, and each chunk is read once. An error above the allowed one leads to a finer level at once."""
    scene = scene_of(write_store(tmp_path / "a", smooth()), frames=1)
    most, found, reads = 0.5 * 10**-4.0, list[ErrorSamples](), _Reads(monkeypatch)
    original = LevelErrors.error_of
    monkeypatch.setattr("renderer.resolve.level_errors._NUM_CELLS", 4)
    monkeypatch.setattr("renderer.resolve.level_errors._MANY_CELLS", 1)  # elsewhere

    def choice_if(means: Sequence[float]) -> LevelChoice:
        """Return the choice if these are the means of errors, each with a deviation of half the allowed error."""
        found.clear()

        def error_of(errors: LevelErrors, volume_of: Callable[[VolumeSpec], Volume]) -> ErrorSamples:
            num = original(errors, volume_of).num
            found.append(ErrorSamples(num, most * means[len(found)], num * (0.5 * most) ** 2, most))
            return found[-1]

        monkeypatch.setattr(LevelErrors, "error_of", error_of)
        return choice_of(scene)

    assert choice_if([2.0, 0.2]).number == 1 and [each.num for each in found] == [4, 4]
    few = reads.num_voxels(0)
    choice = choice_if([2.0, 0.5, 0.2])
    assert choice.number == 1 and [each.num for each in found] == [4, 4, 1]
    assert choice.num_measured == reads.num_voxels(0) > few
    assert choice_if([0.5, 0.5, 0.5]).number == 0 and [each.num for each in found] == [4, 1, 1]
    read = np.zeros([SIDE] * 3, np.int64)
    for box in reads.boxes[0]:
        read[box] += 1
    assert read.max() == 1


def test_rays_go_to_cells_beside_those_with_errors() -> None:
    """One ray through a cell of fine detail may find no difference of two levels, and rays beside it do."""
    one = np.zeros((9, 9))
    one[0, 4] = 9.0
    expected = np.zeros((9, 9))
    expected[:2, 3:6] = [[2.0] * 3, [1.0] * 3]  # the cells at the border are repeated beyond it
    np.testing.assert_allclose(mean_around(one), expected)


@pytest.mark.usefixtures("one_process")
@pytest.mark.parametrize("mode", ["emission", "maximum"])
def test_rays_meet_the_voxels_that_were_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: str) -> None:
    """The colours of rays through the parts of the finest level are those of rays through the whole level."""
    shading = {"ambient": 0.3, "specular": 0.2} if mode == "emission" else None
    tree = scene_to_dict(scene_of(write_store(tmp_path / "a", rough()), frames=3))
    tree |= {"shading": shading} if shading else {"mode": {"type": mode}}
    scene = parse_scene(tree, base=tmp_path)
    whole = read_volume(VolumeSpec(FileSource(tmp_path / "a"), level=0))
    errors = LevelErrors(stage_of(scene, 3), lambda _: True, at_level(2))
    assert errors.num_bytes < SIDE**3
    same = errors.error_of(lambda spec: replace(whole, finest_share=1.0))
    assert same.mean == same.largest == 0.0
    assert errors.error_of(at_level(2)).mean > 0


@pytest.mark.usefixtures("one_process")
def test_a_level_that_does_not_fit_leaves_a_lower_accuracy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_of(write_store(tmp_path / "a", rough(), 16))
    monkeypatch.setattr("renderer.readers.volume_reading.free_bytes", lambda: 4 * (SIDE // 2) ** 3)
    found = choice_of(scene)
    assert found.number == 1 and not found.is_exact and found.psnr and found.psnr < 40
    assert "fits into a quarter of the free memory" in found.note and "40 dB are asked for" in found.note


@pytest.mark.usefixtures("one_process")
def test_a_level_by_hand_and_a_single_level_are_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    by_hand = scene_of(write_store(tmp_path / "a", smooth()), level=3)
    reads = _Reads(monkeypatch)
    assert resolve_scene(by_hand, read_volume) == by_hand
    alone = scene_of(write_store(tmp_path / "b", smooth(), num=1))
    assert resolve_scene(alone, read_volume) == alone and not reads.boxes
    assert scene_of(tmp_path / "a", level="auto") == scene_of(tmp_path / "a")


@pytest.mark.usefixtures("one_process")
def test_opacities_are_of_the_finest_level(tmp_path: Path) -> None:
    """Without `unit`, pictures of a constant field have the same opacity at all levels."""
    scene = scene_of(write_store(tmp_path / "a", np.full([SIDE] * 3, 120, np.uint8), 16))
    pictures = []
    for level in (0, 3):
        stage = stage_of(scene, level).first
        pictures.append(SceneRays(stage).integrate(view_of(stage, 0), pixel_centres((48, 48)), 1.0)[:, 3])
    assert pictures[0].max() > 0.9
    np.testing.assert_allclose(*pictures, atol=2e-3)


@pytest.mark.slow
def test_check_the_terminal_and_the_sidecar_say_it(tmp_path: Path) -> None:
    """In the child process that reads stores, from the command to the record, and from the record again."""
    write_store(tmp_path / "a", smooth(), 16)
    tree = scene_to_dict(scene_of(tmp_path / "a", frames=2))
    tree["volume"] = {"file": "a"}
    tree["output"] = {"file": str(tmp_path / "film-{frame}.png"), "size": [48, 48]}
    scene = tmp_path / "scene.json"
    scene.write_text(json.dumps(tree))
    told = CliRunner().invoke(check, [str(scene)], catch_exceptions=False).output
    assert "level    level " in told and "the coarsest that is exact enough" in told
    said = CliRunner().invoke(render, [str(scene)], catch_exceptions=False).output
    sentence = next(line for line in said.splitlines() if line.startswith("level "))
    assert sentence in told
    record = json.loads((tmp_path / "film-frames.json").read_text())
    level = record["volume"]["level"]
    assert record["scene"]["volume"]["level"] == level["number"] > 0 and sentence in record["notes"]
    assert level["exact"] and level["least"] <= level["psnr"] and level["asked"] == 40 and level["num_measured"] > 0
    assert "up to date" in CliRunner().invoke(render, [str(scene)], catch_exceptions=False).output
    again = CliRunner().invoke(
        render, [str(tmp_path / "film-frames.json"), "--output", str(tmp_path / "b{frame}.png")], catch_exceptions=False
    )
    assert again.exit_code == 0 and (tmp_path / "b1.png").read_bytes() == (tmp_path / "film-1.png").read_bytes()


@pytest.mark.usefixtures("one_process")
@pytest.mark.parametrize("command", [info, init])
def test_a_large_store_is_described_by_a_coarse_level(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: click.Command
) -> None:
    """No voxels of finer levels are read for a description, which says so; the scene leaves the level open."""
    folder = write_store(tmp_path / "a", smooth(), 16)
    reads = _Reads(monkeypatch)
    monkeypatch.setattr("renderer.readers.overview._MOST_VOXELS", (SIDE // 4) ** 3)
    monkeypatch.setattr("hsplat_cli.commands.init._tell_faults", lambda *_: None)  # it draws a picture
    told = CliRunner().invoke(command, [str(folder)], catch_exceptions=False)
    assert sorted(reads.boxes) == [2]
    assert "level 2 is described, and not the finest; `--level 0` describes the finest" in told.stderr
    assert ("16 x 16 x 16 voxels (x, y, z)" in told.stdout) == (command is info)
    assert "level:" not in told.stdout
    reads.boxes.clear()
    told = CliRunner().invoke(command, [str(folder), "--level", "0"], catch_exceptions=False)
    assert sorted(reads.boxes) == [0] and "described" not in told.stderr


def test_blocks_are_whole_chunks_and_come_back_from_plain_data() -> None:
    blocks = Blocks.of_level(VolumeLevel((1000, 700, 900), (2, 2, 3), 1))
    assert blocks.wanted.size <= 2**18 and all(
        side % chunk == 0 for side, chunk in zip(blocks.size, (2, 2, 3), strict=True)
    )
    blocks.wanted[1, 2, 3:5] = blocks.wanted[-1, -1, -1] = True
    again = Blocks.from_plain(*json.loads(json.dumps(blocks.to_plain())))
    assert again.size == blocks.size and np.array_equal(again.wanted, blocks.wanted)
    x, y, z = blocks.size
    found = [*again.boxes(((0, 4 * x + 1), (0, 700), (z + 1, 900)))]
    assert found == [((3 * x, 4 * x + 1), (2 * y, 3 * y), (z + 1, 2 * z))]


@pytest.mark.usefixtures("one_process")
def test_a_part_has_the_place_and_the_voxels_of_its_level(tmp_path: Path) -> None:
    finest = smooth()
    write_store(tmp_path / "a", finest)
    spec = VolumeSpec(FileSource(tmp_path / "a", (1.0, 1.0, 2.0)), level=0, crop=((10, 50), None, (3, 64)))
    image = read_part(spec, None)
    assert image is not None and not image.values.any()
    blocks = Blocks.of_level(image.levels[0])
    blocks.wanted[2:4, 1, 1:3] = True
    part = read_part(spec, blocks)
    assert part is not None
    wanted = np.zeros_like(finest)
    wanted[16:32, 8:16, 8:24] = finest[16:32, 8:16, 8:24]
    assert part.blocks is not None and part.box is not None
    z, y, x = part.blocks.places(part.box)
    found = part.values.reshape(-1)[z[:, None, None] + y[:, None] + x]
    np.testing.assert_array_equal(found, wanted[3:, :, 10:50])
    np.testing.assert_array_equal(part.world_from_index, read_volume(spec).world_from_index)
    np.save(tmp_path / "b.npy", finest)
    assert read_part(VolumeSpec(FileSource(tmp_path / "b.npy")), None) is None


@pytest.mark.usefixtures("one_process")
def test_channels_and_steps_in_time_share_one_level(tmp_path: Path) -> None:
    """`component: all` and `time: auto` of a store; the level is that of the channels together."""
    levels = [smooth()]
    for _ in range(2):
        levels.append(halves(levels[-1], 2, 2, 2))
    stacked = [np.stack([np.stack([level, level[::-1]])] * 2) for level in levels]
    places = [scaled(1, 1, *[2.0**k] * 3, translation=[0, 0, *[0.5 * (2.0**k - 1)] * 3]) for k in range(3)]
    write_ome(tmp_path / "a", stacked, places, axes="tczyx", chunks=[1, 1, 16, 16, 16])
    tree = scene_to_dict(scene_of(tmp_path / "a", component="all", time="auto"))
    del tree["transfer_function"]
    found = resolve_scene(parse_scene(tree, base=tmp_path), read_volume)
    first = found.at(0)
    one, two = (layer.volume.level for layer in first.layers)
    assert one == two and one in (1, 2) and len(found.level_notes) == 1
    assert {found.at(frame).layers[0].volume.time for frame in range(4)} == {0, 1}


@pytest.mark.usefixtures("one_process")
@pytest.mark.parametrize("kind", ["labels", "absent"])
def test_labels_are_measured_and_voxels_without_data_are_not(tmp_path: Path, kind: str) -> None:
    finest = (smooth() // 90).astype(np.uint8) if kind == "labels" else smooth().astype(np.float32)
    if kind == "absent":
        finest[:8] = np.nan
    levels, places = [finest, finest[::2, ::2, ::2]], [scaled(1, 1, 1), scaled(2, 2, 2)]
    folder = write_ome(tmp_path / "a", levels, places, chunks=[16] * 3)
    tree = scene_to_dict(scene_of(folder))
    if kind == "labels":
        del tree["transfer_function"]
        tree["labels"] = {"opacity": 0.1}
    found = resolve_scene(parse_scene(tree, base=tmp_path), read_volume).at(0).layers[0].volume.chosen
    assert found is not None and found.number == 0 and (found.num_measured > 0) == (kind == "labels")
    assert ("voxels without data are not measured" in found.why) == (kind == "absent")

"""Stores are read as their arrays and metadata say: levels, places, axes, channels, labels, times and crops."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from store_files import (
    AXES,
    field,
    halves,
    scaled,
    sharded,
    write_array,
    write_json,
    write_n5,
    write_ome,
    write_precomputed,
    zipped_store,
)
from volume_files import read, refused

from renderer.readers import find_volume, read_volume, volumes_in
from renderer.scene import FileSource, VolumeSpec
from renderer.suggest import suggest_for
from renderer.volume import Array, Volume

pytestmark = pytest.mark.usefixtures("one_process")

FIELD = field()
LEVELS = [FIELD, halves(FIELD, 1, 2, 2), halves(FIELD, 3, 6, 6)]
# Scale factors 1:2:2 and 3:6:6, with the shift of the centre of the first block.
PLACES = [
    scaled(2.0, 0.5, 0.5, translation=(10.0, 20.0, 30.0)),
    scaled(2.0, 1.0, 1.0, translation=(10.0, 20.25, 30.25)),
    scaled(6.0, 3.0, 3.0, translation=(12.0, 21.25, 31.25)),
]


@pytest.fixture
def store(tmp_path: Path) -> Path:
    return write_ome(tmp_path / "a.ome.zarr", LEVELS, PLACES)


def _place(volume: Volume) -> tuple[list[float], list[float]]:
    return volume.spacing.tolist(), volume.world_from_index[:3, 3].tolist()


def _is(volume: Volume, values: Any) -> bool:
    np.testing.assert_array_equal(volume.values, values)
    return bool(volume.values.dtype == values.dtype)


@pytest.mark.parametrize("version", ["0.4", "0.5"])
@pytest.mark.parametrize("number", [0, 1, 2])
def test_each_level_has_its_voxels_and_its_place(tmp_path: Path, version: str, number: int) -> None:
    folder = write_ome(tmp_path / "a", LEVELS, PLACES, version=version)
    volume = read(folder, level=number)
    assert _is(volume, LEVELS[number]) and volume.length_unit == "µm"
    spacing, origin = ([0.5, 0.5, 2], [1, 1, 2], [3, 3, 6])[number], PLACES[number][1]["translation"][::-1]
    assert _place(volume) == (spacing, origin)
    assert [each.shape for each in volume.levels] == [each.shape[::-1] for each in LEVELS]
    assert [each.is_read for each in volume.levels] == [k == number for k in range(3)]
    assert volume.levels[0].chunks == (5, 5, 5) and volume.levels[0].num_bytes == FIELD.nbytes


@pytest.mark.parametrize(("free", "number"), [(4 * FIELD.nbytes, 0), (4 * FIELD.nbytes - 1, 1), (1, 2)])
def test_the_finest_level_that_fits_is_read(
    store: Path, monkeypatch: pytest.MonkeyPatch, free: int, number: int
) -> None:
    monkeypatch.setattr("renderer.readers.volume_reading.free_bytes", lambda: free)
    volume = read(store)
    assert _is(volume, LEVELS[number])
    why = ("the finest", "the finest that fits into a quarter of the free memory", "the coarsest")[number]
    assert volume.note == f"3 levels; level {number}, {why}, is drawn; `level: k` chooses another"


def test_levels_that_are_not_there(store: Path, tmp_path: Path) -> None:
    assert refused(store, match="there is no such level", level=3).expected == "0 to 2"
    np.save(tmp_path / "a.npy", FIELD)
    refused(tmp_path / "a.npy", match="only stores, Imaris and BigDataViewer have levels", level=1)


def test_a_crop_is_of_the_finest_level_and_reads_its_chunks_alone(store: Path) -> None:
    for path in store.glob("0/*"):
        if path.name != "1.1.1" and not path.name.startswith("."):
            path.write_bytes(b"damaged")
    crop = ((5, 10), (6, 9), (7, 8))
    volume = read(store, level=0, crop=crop)
    assert _is(volume, FIELD[7:8, 6:9, 5:10])
    assert _place(volume)[1] == [30 + 2.5, 20 + 3, 10 + 14]
    coarse = read(store, level=2, crop=crop)
    assert _is(coarse, LEVELS[2][2:3, 1:2, 0:2])
    assert _place(coarse)[1] == [31.25, 24.25, 24]
    refused(store, match="the crop does not fit the volume along y", crop=(None, (3, 15), None), level=2)


@pytest.mark.parametrize("axes", ["xyz", "zxy", "tczyx", "xyzct", "cyx", "yx", "tzyx"])
def test_axes_lie_in_any_order(tmp_path: Path, axes: str) -> None:
    lengths = {"t": 2, "c": 3, "z": 4, "y": 6, "x": 7}
    whole = field([lengths[name] for name in axes])
    scale = [{"t": 2.0, "c": 1.0, "z": 4.0, "y": 0.5, "x": 0.25}[name] for name in axes]
    folder = write_ome(tmp_path / "a", [whole], [scaled(*scale)], axes=axes)
    choice = {key: 1 for key, name in (("time", "t"), ("component", "c")) if name in axes}
    volume = read(folder, **choice)
    chosen = np.take(whole, 1, axes.index("t")) if "t" in axes else whole
    left = axes.replace("t", "")
    chosen = np.take(chosen, 1, left.index("c")) if "c" in left else chosen
    left = left.replace("c", "")
    expected = np.transpose(chosen, [left.index(name) for name in "zyx" if name in left])
    assert _is(volume, expected if expected.ndim == 3 else expected[np.newaxis])
    assert volume.spacing.tolist() == [0.25, 0.5, 4.0 if "z" in axes else 1.0]
    assert (volume.num_times, volume.times) == ((2, (0.0, 2.0)) if "t" in axes else (1, ()))
    assert volume.time_unit == ("s" if "t" in axes else "") and len(volume.channels) == (3 if "c" in axes else 0)


def test_channels_have_names_colours_and_windows(tmp_path: Path) -> None:
    whole = field((2, 4, 5, 6))
    window = {"start": 5, "end": 90, "min": 0, "max": 65535}
    channels = [
        {"label": "DAPI", "color": "0000FF", "window": window, "active": True},
        {"label": "GFP", "color": "00ff00"},
    ]
    folder = write_ome(
        tmp_path / "a", [whole], [scaled(1, 1, 1, 1)], axes="czyx", fields={"omero": {"channels": channels}}
    )
    volume = read(folder, component=1)
    assert _is(volume, whole[1])
    first, second = volume.channels
    assert (first.name, first.color, first.window, first.is_light) == ("DAPI", (0, 0, 1), (5, 90), True)
    assert (second.name, second.color, second.window) == ("GFP", (0, 1, 0), None)
    assert "2 components (DAPI, GFP); the first is drawn" in str(read(folder).note)


def test_channels_that_the_file_hides_are_no_layers(tmp_path: Path) -> None:
    """Unless the file hides all of them, as some programs write."""
    whole = field((3, 4, 5, 6))
    for hidden, shown in (((False, True, False), [0, 2]), ((True,) * 3, [0, 1, 2])):
        channels = [{"label": name, "active": not each} for name, each in zip("abc", hidden, strict=True)]
        fields = {"omero": {"channels": channels}}
        folder = write_ome(tmp_path / str(shown), [whole], [scaled(1, 1, 1, 1)], axes="czyx", fields=fields)
        spec = VolumeSpec(FileSource(folder))
        assert [each.is_hidden for each in read_volume(spec).channels] == list(hidden)
        found = suggest_for(spec, read_volume)
        assert [each.volume.component for each in found.layers] == shown
        assert [each.name for each in found.layers] == ["abc"[number] for number in shown]
        is_named = "hidden by the file, and not part of `component: all`: b" in str(read_volume(spec).note)
        assert is_named == (len(shown) == 2)


def test_labels_are_an_image_in_the_image(store: Path) -> None:
    ids = (FIELD // 500).astype("uint32")
    entry = {"colors": [{"label-value": 2, "rgba": [255, 0, 0, 51]}, {"label-value": 1, "rgba": [0, 0, 255, 255]}]}
    properties = [{"label-value": 2, "class": "nucleus"}]
    write_ome(store / "labels/cells", [ids], PLACES[:1], fields={"image-label": entry | {"properties": properties}})
    write_json(store / "labels/.zgroup", {"zarr_format": 2})
    write_json(store / "labels/.zattrs", {"labels": ["cells"]})
    for volume in (read(store, dataset="labels/cells"), read(store / "labels/cells"), read(store / "labels")):
        assert _is(volume, ids) and _place(volume) == _place(read(store, level=0))
        assert [(each.value, each.name, each.color, each.opacity) for each in volume.labels] == [
            (1, "", (0, 0, 1), 1),
            (2, "nucleus", (1, 0, 0), 0.2),
        ]
    assert refused(store, match="no such image", dataset="labels/cell").got == "dataset: labels/cell"


def test_a_store_of_several_images_needs_a_name(tmp_path: Path) -> None:
    root = {"zarr_format": 3, "node_type": "group", "attributes": {"ome": {"bioformats2raw.layout": 3}}}
    for number in range(2):
        write_ome(tmp_path / f"a/{number}", [FIELD + number], PLACES[:1], version="0.5")
    write_json(tmp_path / "a/zarr.json", root)
    error = refused(tmp_path / "a", match="this store holds 2 images")
    assert error.got == "0, 1" and error.expected == "`dataset: NAME`, such as `dataset: 0`"
    assert _is(read(tmp_path / "a", dataset="1"), FIELD + 1)


def test_fields_of_a_plate_are_images(tmp_path: Path) -> None:
    write_ome(tmp_path / "p/B/2/0", [FIELD], PLACES[:1])
    for folder, fields in (
        ("p", {"plate": {"wells": [{"path": "B/2"}]}}),
        ("p/B/2", {"well": {"images": [{"path": "0"}]}}),
    ):
        write_json(tmp_path / folder / ".zgroup", {"zarr_format": 2})
        write_json(tmp_path / folder / ".zattrs", fields)
    volume = read(tmp_path / "p")
    assert _is(volume, FIELD) and "the image B/2/0 is read" in str(volume.note)


def test_shards_are_read(tmp_path: Path) -> None:
    folder = write_ome(tmp_path / "a", [FIELD], PLACES[:1], version="0.5", chunks=(8, 8, 8), codecs=sharded(4, 4, 2))
    volume = read(folder)
    assert _is(volume, FIELD) and volume.levels[0].chunks == (2, 4, 4)


@pytest.mark.parametrize("version", ["0.4", "0.5"])
@pytest.mark.parametrize("name", ["a.ozx", "a.ome.zarr.zip"])
def test_an_archive_is_a_store(tmp_path: Path, version: str, name: str) -> None:
    folder = write_ome(tmp_path / "a", LEVELS, PLACES, version=version)
    volume = read(zipped_store(folder, tmp_path / name), level=1)
    assert _is(volume, LEVELS[1]) and _place(volume) == ([1, 1, 2], [30.25, 20.25, 10])


def test_a_damaged_archive_is_refused(tmp_path: Path, store: Path) -> None:
    file = zipped_store(store, tmp_path / "a.ozx")
    file.write_bytes(file.read_bytes()[:-200])
    assert refused(file).where


@pytest.mark.parametrize("version", [2, 3])
def test_arrays_without_ome(tmp_path: Path, version: int) -> None:
    write_array(tmp_path / "a/raw", FIELD, version=version)
    write_array(tmp_path / "a/deep/small", FIELD[:2], version=version)
    group = {"zarr_format": 3, "node_type": "group"} if version == 3 else {"zarr_format": 2}
    write_json(tmp_path / "a" / ("zarr.json" if version == 3 else ".zgroup"), group)
    assert _is(read(tmp_path / "a/raw"), FIELD)
    whole = read(tmp_path / "a")
    assert _is(whole, FIELD) and "the largest array, raw, is read; `dataset: NAME` reads another" in str(whole.note)
    assert _is(read(tmp_path / "a", dataset="deep/small"), FIELD[:2])
    assert _is(read(zipped_store(tmp_path / "a", tmp_path / "a.zip")), FIELD)


def test_values_are_scaled_as_cf_says(tmp_path: Path) -> None:
    """Also where the metadata have no numbers; values that mark absent voxels are stored ones."""
    write_array(tmp_path / "a", FIELD)
    write_json(tmp_path / "a/.zattrs", {"scale_factor": 0.1, "add_offset": -3, "_FillValue": 7})
    volume, expected = read(tmp_path / "a"), (FIELD * 0.1 - 3).astype(np.float32)
    expected[FIELD == 7] = np.nan
    assert _is(volume, expected) and volume.num_absent == 1
    np.testing.assert_array_equal(read(tmp_path / "a", crop=((2, 4), None, (3, 4))).values, expected[3:4, :, 2:4])
    write_json(tmp_path / "a/.zattrs", {"scale_factor": "half", "add_offset": [3]})
    assert _is(read(tmp_path / "a"), FIELD)


def test_n5_has_x_first(tmp_path: Path) -> None:
    sizes = {"pixelResolution": {"unit": "nm", "dimensions": [4, 5, 6]}}
    levels = [{"downsamplingFactors": [1, 1, 1], **sizes}, {"downsamplingFactors": [2, 2, 1], **sizes}]
    folder = write_n5(tmp_path / "a.n5", LEVELS[:2], levels)
    assert find_volume(folder)[1] == "store"
    for number, place in ((0, ([4, 5, 6], [0, 0, 0])), (1, ([8, 10, 6], [2, 2.5, 0]))):
        volume = read(folder, level=number)
        assert _is(volume, LEVELS[number]) and _place(volume) == place and volume.length_unit == "nm"
    assert _is(read(folder / "s1"), LEVELS[1])


def test_a_volume_of_neuroglancer(tmp_path: Path) -> None:
    scales = [{"voxel_offset": [10, 20, 30]}, {"voxel_offset": [5, 10, 30], "resolution": [8, 8, 40]}]
    folder = write_precomputed(tmp_path / "a", LEVELS[:2], scales)
    assert find_volume(folder)[1] == "store"
    fine, coarse = read(folder, level=0), read(folder, level=1)
    assert _is(fine, FIELD) and _is(coarse, LEVELS[1])
    assert _place(fine) == ([4, 4, 40], [42, 82, 1220]) and _place(coarse) == ([8, 8, 40], [44, 84, 1220])
    assert fine.length_unit == "nm"
    assert _is(read(folder, level=1, crop=((2, 6), None, None)), LEVELS[1][:, :, 1:3])


def test_coordinate_systems(tmp_path: Path) -> None:
    """Version 0.6: a sequence leads to the system of the levels, and an affine one from there to the world."""
    axes = [AXES[name] for name in "zyx"]
    matrix = [[0, 0, 1, 5], [0, 1, 0, 6], [-1, 0, 0, 7]]
    intrinsic, world = {"name": "intrinsic"}, {"name": "world"}
    sequence = {"type": "sequence", "input": {"path": "0"}, "output": intrinsic, "transformations": PLACES[0]}
    turn = {"type": "affine", "affine": matrix, "input": intrinsic, "output": world}
    image = {
        "axes": None,
        "coordinateSystems": [{**world, "axes": axes}, {**intrinsic, "axes": axes}],
        "coordinateTransformations": [turn],
    }
    volume = read(write_ome(tmp_path / "a", [FIELD], [[sequence]], version="0.6", image=image))
    expected = np.array(matrix, float)[:, :3] @ np.diag([2, 0.5, 0.5])
    assert _is(volume, FIELD) and "placed in its coordinate system world" in str(volume.note)
    np.testing.assert_allclose(volume.world_from_index[:3, :3], expected[::-1, ::-1])
    np.testing.assert_allclose(volume.world_from_index[:3, 3], [-10 + 7, 20 + 6, 30 + 5])
    image["coordinateTransformations"] = [turn | {"type": "displacements", "path": "field"}]
    named = read(write_ome(tmp_path / "b", [FIELD], [[sequence]], version="0.6", image=image))
    assert "not applied: coordinateTransformations.type" in str(named.note)
    assert _place(named) == ([0.5, 0.5, 2], [30, 20, 10])


def test_missing_chunks_have_the_fill_value(tmp_path: Path) -> None:
    folder = write_ome(tmp_path / "a", [FIELD], PLACES[:1], fill_value=77)
    (folder / "0/1.1.1").unlink()
    expected = FIELD.copy()
    expected[5:10, 5:10, 5:10] = 77
    assert _is(read(folder), expected)


@pytest.mark.parametrize(
    "damage", [lambda data: data[: len(data) // 2], lambda data: data[:40] + b"\xff" * 9 + data[49:]]
)
def test_damaged_chunks_are_named(tmp_path: Path, damage: Any) -> None:
    folder = write_ome(tmp_path / "a", [FIELD], PLACES[:1], version="0.5", chunks=(8, 8, 8), codecs=sharded(4, 4, 2))
    chunk = folder / "0/c/0/1/0"
    chunk.write_bytes(damage(chunk.read_bytes()))
    error = refused(folder, match="the voxels of this store cannot be read")
    assert error.got and str(chunk) in error.got and "copy or download it again" in str(error.hint)


def test_metadata_that_contradict_the_array(store: Path) -> None:
    attributes = json.loads((store / ".zattrs").read_text())
    attributes["multiscales"][0]["axes"].insert(0, AXES["c"])
    write_json(store / ".zattrs", attributes)
    error = refused(store, match="the metadata of this image contradict its array")
    assert error.got == "4 axes (c, z, y, x)" and "12 x 14 x 18" in str(error.expected)
    (store / "0/.zarray").unlink()
    assert str(store / "0") in str(refused(store, match="cannot be opened"))


@pytest.mark.parametrize("path", ["../b", "http://127.0.0.1:9/a", "/etc", "a|zip:", "0/../../b"])
def test_metadata_do_not_lead_out_of_the_store(store: Path, path: str) -> None:
    attributes = json.loads((store / ".zattrs").read_text())
    attributes["multiscales"][0]["datasets"][0]["path"] = path
    write_json(store / ".zattrs", attributes)
    assert refused(store, match="a place outside of it").got == path


def test_a_link_of_metadata_that_leads_out_is_not_followed(tmp_path: Path, store: Path) -> None:
    (store / ".zattrs").rename(tmp_path / "elsewhere.json")
    (store / ".zattrs").symlink_to(tmp_path / "elsewhere.json")
    assert "the largest array" in str(read(store).note)


@pytest.mark.parametrize("content", ["[" * 100_000, "{", "[]", "<html>", '{"multiscales": 5}', "\0"])
def test_metadata_that_are_no_metadata(store: Path, content: str) -> None:
    (store / ".zattrs").write_text(content)
    for name in ("0", "1", "2"):
        (store / name / ".zarray").unlink()
    assert refused(store).where


def test_nothing_is_written(store: Path) -> None:
    """Times of access change where a system keeps them."""

    def states() -> dict[Path, tuple[int, int, int]]:
        found = {path: path.stat() for path in store.rglob("*")}
        return {path: (state.st_size, state.st_mtime_ns, state.st_ctime_ns) for path, state in found.items()}

    before = states()
    read(store)
    assert states() == before


def test_a_folder_of_stores_has_several_volumes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_ome(tmp_path / name, [FIELD], PLACES[:1])
    assert volumes_in(tmp_path) == [tmp_path / "a", tmp_path / "b"] and volumes_in(tmp_path / "a") == []


def _zarr_python(folder: Path, values: Array) -> None:
    import zarr

    codec = zarr.codecs.BloscCodec(cname="zstd")
    array = zarr.create_array(
        folder, shape=values.shape, dtype=values.dtype, chunks=(4, 4, 4), shards=(8, 8, 8), compressors=codec
    )
    array[:] = values


def test_zarr_python_writes_what_is_read(tmp_path: Path) -> None:
    _zarr_python(tmp_path / "a.zarr", FIELD)
    assert _is(read(tmp_path / "a.zarr"), FIELD)


def test_without_tensorstore_the_command_is_told(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("renderer.errors.importlib.util.find_spec", lambda _: None)
    assert refused(store, match="the package tensorstore is not installed").hint == "pip install 'hsplat[zarr]'"


def test_times_of_a_store_are_steps_of_one_volume(tmp_path: Path) -> None:
    """A fill value that some steps have is sought in the crop alone, at the level that is drawn."""
    steps = field((3, 4, 5, 6), "int16") + 1
    steps[2, 1:3] = -9999
    folder = write_ome(tmp_path / "a", [steps], [scaled(0.5, 1, 1, 1)], axes="tzyx")
    mixed = read(folder, time=0.5, interpolate=True)
    np.testing.assert_array_equal(mixed.values, (steps[0] + steps[1]) / 2)
    assert read(folder, time=2).num_absent == steps[0, :2].size and mixed.times == (0, 0.5, 1)
    assert read(folder, time=2, crop=(None, None, (3, 4))).num_absent == 0

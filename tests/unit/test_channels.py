"""`component: all`, and the channels that files tell of: colours, names and windows written here by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tifffile
import yaml
from tiff_files import tiff_bytes

import renderer
from hsplat_cli import main
from hsplat_cli.scenes import SceneRequest, load_job
from renderer.errors import InputError, SceneError
from renderer.readers import read_volume
from renderer.resolve import resolve_scene
from renderer.scene import FileSource, VolumeSpec, parse_scene
from renderer.suggest import suggest_weight
from renderer.volume import make_volume

pytestmark = pytest.mark.usefixtures("one_process")

STEP = np.linspace(0, 255, 256)
RED, BLUE = (np.stack([STEP * on for on in color]).astype(np.uint8) for color in ((1, 0, 0), (0, 0, 1)))
PLANES = np.zeros((6, 8, 8), np.uint16)  # of two channels; channel 1 is brighter
PLANES[:3, 2:6, 2:6], PLANES[3:, 2:6, 2:6] = 100, 400


def ome_file(path: Path, first: str, second: str) -> Path:
    sizes = 'DimensionOrder="XYZCT" SizeX="8" SizeY="8" SizeZ="3" SizeC="2" SizeT="1"'
    channels = f"<Channel {first}/><Channel {second}/>"
    description = f'<OME><Image><Pixels Type="uint16" {sizes}>{channels}</Pixels></Image></OME>'
    path.write_bytes(tiff_bytes(PLANES, description=description))
    return path


def imagej_file(path: Path, **fields: object) -> Path:
    metadata = {"axes": "ZCYX", "mode": "composite", **fields}
    tifffile.imwrite(path, PLANES.reshape(2, 3, 8, 8).swapaxes(0, 1), imagej=True, metadata=metadata)
    return path


def scene_file(volume: Path, **keys: object) -> Path:
    tree = {
        "version": 1,
        "volume": {"file": str(volume), "component": "all"},
        "camera": {"path": {"type": "turntable", "frames": 2}},
        "output": {"file": "{frame}.png", "size": [16, 16]},
        "error": {"tolerance": 0.1},
        **keys,
    }
    path = volume.parent / "scene.yaml"
    path.write_text(yaml.safe_dump(tree))
    return path


def test_names_and_colors_of_ome(tmp_path: Path) -> None:
    # 0x0000FFFF is blue and opaque; -16776961 is the signed form of 0xFF0000FF, red and opaque.
    path = ome_file(tmp_path / "a.tif", 'Name="DAPI &amp; more" Color="65535"', 'Name="GFP" Color="-16776961"')
    blue, red = read_volume(VolumeSpec(FileSource(path))).channels
    assert (blue.name, blue.color) == ("DAPI & more", (0.0, 0.0, 1.0))
    assert (red.name, red.color) == ("GFP", (1.0, 0.0, 0.0))
    assert blue.is_light and red.window is None


def test_colors_that_tell_nothing_apart_are_left_out(tmp_path: Path) -> None:
    for first, second in (
        ('Color="-1"', 'Color="-1"'),
        ('Color="65535"', 'Color="255"'),
        ('Color="x"', 'Color="1e99"'),
    ):
        path = ome_file(tmp_path / "a.tif", first, second)
        assert [each.color for each in read_volume(VolumeSpec(FileSource(path))).channels] == [None, None]


def test_windows_and_colors_of_imagej(tmp_path: Path) -> None:
    labels = ["nuclei", "actin"] * 3
    path = imagej_file(tmp_path / "a.tif", Ranges=(10.0, 90.0, 50.0, 300.0), LUTs=[RED, BLUE], Labels=labels)
    job = load_job(SceneRequest(scene_file(path, blend="add")))
    found = [(each.volume.component, each.name, each.color, each.range) for each in job.scene.layers]
    assert found == [(0, "nuclei", (1, 0, 0), (10, 90)), (1, "actin", (0, 0, 1), (50, 300))]


def test_windows_that_are_none_are_left_out(tmp_path: Path) -> None:
    path = imagej_file(tmp_path / "a.tif", Ranges=(90.0, 90.0, float("nan"), 300.0))
    assert [each.window for each in read_volume(VolumeSpec(FileSource(path))).channels] == [None, None]


def test_channels_of_a_plain_file_have_colors_in_turn_and_windows_of_their_values(tmp_path: Path) -> None:
    np.save(path := tmp_path / "a.npy", np.moveaxis(PLANES.reshape(2, 3, 8, 8), 0, -1))
    green, magenta = load_job(SceneRequest(scene_file(path))).scene.layers
    assert (green.color, magenta.color) == ((0, 1, 0), (1, 0, 1))
    for layer, bright in ((green, 100), (magenta, 400)):
        assert layer.range is not None
        assert 0 < layer.range[0] < bright == layer.range[1]


def test_a_given_transfer_function_is_that_of_every_channel(tmp_path: Path) -> None:
    path = ome_file(tmp_path / "a.tif", 'Name="a"', 'Name="a"')
    points = [{"value": 0, "color": "red", "opacity": 0}, {"value": 9, "color": "red", "opacity": 1}]
    scene = load_job(SceneRequest(scene_file(path, transfer_function={"points": points}))).scene
    assert [layer.name for layer in scene.layers] == ["a", "a (2)"]
    assert all(layer.transfer_function.mapping[1].value == 9 for layer in scene.layers)


def test_the_sidecar_has_a_plain_list_that_makes_the_film_again(tmp_path: Path) -> None:
    path = ome_file(tmp_path / "a.tif", 'Name="a"', 'Name="b"')
    film = renderer.render(scene_file(path, blend="add"), output=tmp_path / "a.png", frames=0)
    recorded = yaml.safe_load(film.sidecar.read_text())["scene"]["volumes"]
    assert [(each["component"], each["name"]) for each in recorded] == [(0, "a"), (1, "b")]
    again = load_job(SceneRequest(film.sidecar, output=str(tmp_path / "b.png"))).scene
    assert [layer.name for layer in again.layers] == ["a", "b"]


def test_init_writes_channels_that_can_be_edited(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = imagej_file(tmp_path / "a.tif", Ranges=(10.0, 90.0, 50.0, 300.0), LUTs=[RED, BLUE])
    assert main.run(["init", str(path)]) == 0
    tree = yaml.safe_load(capsys.readouterr().out)
    assert tree["blend"] == "add"
    rows = [(each["component"], each["color"], each["range"]) for each in tree["volumes"]]
    assert rows == [(0, "#ff0000", [10, 90]), (1, "#0000ff", [50, 300])]


def test_init_takes_pictures_and_vectors_for_no_channels(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tifffile.imwrite(tmp_path / "rgb.tif", np.arange(768, dtype=np.uint8).reshape(4, 8, 8, 3), photometric="rgb")
    vectors = np.random.default_rng(1).normal(size=(2, 3, 4, 5, 3)).astype(np.float32)
    np.save(tmp_path / "vectors.npy", vectors)
    for name, options, component, told in (
        ("rgb.tif", [], "color", "voxels that are colours"),
        ("vectors.npy", ["--time", "0"], None, "3 components"),
    ):
        assert main.run(["init", str(tmp_path / name), *options]) == 0
        printed = capsys.readouterr()
        assert yaml.safe_load(printed.out)["volume"].get("component") == component, name
        assert told in printed.err


def test_no_layers_for_each_of_very_many_components(tmp_path: Path) -> None:
    np.save(path := tmp_path / "a.npy", np.zeros((9, 2, 2, 2000), np.uint8))
    with pytest.raises(InputError, match="too many components"):
        load_job(SceneRequest(scene_file(path)))


def test_splats_show_no_channels(tmp_path: Path) -> None:
    path = ome_file(tmp_path / "a.tif", "", "")
    with pytest.raises(SceneError, match="splats show one volume"):
        load_job(SceneRequest(scene_file(path, splat={"footprint": "gaussian"})))


def test_the_brightest_rays_are_about_full() -> None:
    """A cube whose sides are eight times as long as what is fully bright, in one half of which nothing is."""
    values = np.full((40, 40, 40), 250, np.uint8)
    assert suggest_weight(make_volume(values, np.eye(4), "test"), (50.0, 250.0)) == 0.12
    values = values.copy()
    values[:, :, 20:] = 50
    assert suggest_weight(make_volume(values, 3 * np.eye(4), "test"), (50.0, 250.0)) == 0.12


def test_files_of_one_channel_have_colors_of_their_own_in_a_list(tmp_path: Path) -> None:
    for name in ("nuclei", "membranes"):
        np.save(tmp_path / f"{name}.npy", PLANES[:3])
    volumes = [
        {"file": "nuclei.npy", "name": "nuclei", "component": "all"},
        {"file": "membranes.npy", "component": "all"},
    ]
    path = scene_file(tmp_path / "nuclei.npy", volumes=volumes)
    tree = {key: value for key, value in yaml.safe_load(path.read_text()).items() if key != "volume"}
    scene = resolve_scene(parse_scene(tree, base=tmp_path), read_volume)
    found = [(layer.name, layer.color) for layer in scene.at(0).layers]
    assert found == [("nuclei", (0.0, 1.0, 0.0)), ("", (1.0, 0.0, 1.0))]

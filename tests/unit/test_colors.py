"""`component: color`: voxels that are colours, of every format; what is suggested for them, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nibabel
import numpy as np
import pytest
import tifffile
import yaml
from small_scene import small_tree
from volume_files import write_image

from hsplat_cli import main
from hsplat_cli.scenes import SceneRequest, load_job
from renderer.errors import InputError, SceneError
from renderer.readers import read_volume
from renderer.scene import FileSource, VolumeSpec, parse_scene
from renderer.volume import Volume

RGBA = np.random.default_rng(4).integers(0, 256, (3, 4, 5, 4), np.uint8)
RGB = RGBA[..., :3]
LUMINANCE = np.rint(RGB @ np.array([0.2126, 0.7152, 0.0722]))


def read(path: Path, component: Any = "color", **keys: Any) -> Volume:
    return read_volume(VolumeSpec(FileSource(path), component=component, **keys))


def save_nifti(path: Path, voxels: Any, *, is_record: bool) -> None:
    stored = np.ascontiguousarray(np.moveaxis(voxels, (2, 1, 0), (0, 1, 2)))
    if is_record:
        stored = stored.view([(name, "u1") for name in "RGBA"[: voxels.shape[-1]]])[..., 0]
    nibabel.save(nibabel.Nifti1Image(stored if is_record else stored[:, :, :, None], np.eye(4)), path)


@pytest.mark.usefixtures("one_process")
@pytest.mark.parametrize("voxels", [RGB, RGBA], ids=["rgb", "rgba"])
def test_colors_of_every_format(tmp_path: Path, voxels: Any) -> None:
    for name in ("a.nrrd", "a.mha", "a.tif", "a.npy"):
        write_image(tmp_path / name, voxels, has_components=True)
    grid = "DATASET STRUCTURED_POINTS\nDIMENSIONS 5 4 3\nORIGIN 0 0 0\nSPACING 1 1 1\nPOINT_DATA 60\n"
    array = f"SCALARS a unsigned_char {voxels.shape[-1]}\nLOOKUP_TABLE default\n"
    text = f"# vtk DataFile Version 3.0\na\nBINARY\n{grid}{array}"
    (tmp_path / "a.vtk").write_bytes(text.encode() + voxels.tobytes())
    save_nifti(tmp_path / "record.nii.gz", voxels, is_record=True)
    save_nifti(tmp_path / "vector.nii", voxels, is_record=False)
    names = ("a.nrrd", "a.mha", "a.vtk", "a.tif", "a.npy", "record.nii.gz", "vector.nii")
    volumes = [read(tmp_path / name) for name in names]
    for volume in volumes:
        assert volume.colors is not None
        np.testing.assert_array_equal(volume.colors, RGB)
        assert np.abs(volume.values - LUMINANCE).max() <= 1
        assert (volume.values.dtype, volume.colors.flags.writeable) == (np.uint8, False)
        assert "component" not in (volume.note or "")
    assert len({volume.fingerprint for volume in volumes[:2]}) == 1
    if voxels is RGBA:
        np.testing.assert_array_equal(read(tmp_path / "a.tif", "color_alpha").values, RGBA[..., 3])


def test_crops_and_fingerprints(tmp_path: Path) -> None:
    np.save(path := tmp_path / "a.npy", RGB)
    part = read(path, crop=((1, 4), None, (0, 2)))
    np.testing.assert_array_equal(part.colors, RGB[:2, :, 1:4])
    assert part.world_from_index[0, 3] == 1
    swapped = RGB.copy()
    swapped[0, 0, 0] = 255 - swapped[0, 0, 0]
    np.save(other := tmp_path / "b.npy", swapped)
    assert read(other).fingerprint != read(path).fingerprint


@pytest.mark.parametrize(
    ("dtype", "factor", "white"), [("f4", 1 / 255, 1), ("f8", 1.0, 255), ("u2", 257, 65535), ("i2", 1, 255)]
)
def test_wider_colors_become_bytes(tmp_path: Path, dtype: str, factor: float, white: int) -> None:
    np.save(path := tmp_path / "a.npy", (RGB.astype(float) * factor).astype(dtype))
    volume = read(path)
    np.testing.assert_array_equal(volume.colors, RGB)
    assert f"become 8 bits: {white} is 255" in (volume.note or "")


@pytest.mark.parametrize(
    ("voxels", "component", "error"),
    [
        (RGBA[..., :2], "color", "2 components"),
        (np.concatenate([RGBA, RGBA[..., :1]], axis=-1), "color", "5 components"),
        (RGB[..., 0], "color", "1 component"),
        (RGB, "color_alpha", "3 components"),
        (RGB.astype("f4") - 1000, "color", "values from -9"),
    ],
)
def test_what_is_no_color_is_refused(tmp_path: Path, voxels: Any, component: str, error: str) -> None:
    np.save(path := tmp_path / "a.npy", voxels)
    with pytest.raises(InputError) as caught:
        read(path, component)
    assert caught.value.where == str(path)
    assert error in (caught.value.got or "")


def tree_of(path: Path, **sections: Any) -> dict[str, Any]:
    return small_tree(volume={"file": str(path), "component": "color"}, **sections)


@pytest.mark.parametrize(
    ("sections", "place"),
    [
        ({"shading": {"specular": 0.2}}, "shading.specular"),
        ({"shading": {"light": "camera", "two_sided": True}}, "shading.light shading.two_sided"),
        ({"shading": {"gradient_opacity": [[0, 0], [1, 1]]}}, "shading.gradient_opacity"),
        ({"mode": "maximum"}, "mode"),
        ({"error": {"measure": "rms", "of": "scalar"}}, "error.of"),
    ],
)
def test_what_colors_cannot_have_is_refused(tmp_path: Path, sections: Any, place: str) -> None:
    np.save(path := tmp_path / "a.npy", RGB)
    with pytest.raises(SceneError) as caught:
        parse_scene(tree_of(path, **sections), base=tmp_path)
    assert " ".join(problem.path for problem in caught.value.problems) == place


def test_opacities_alone_are_white_and_only_for_colors(tmp_path: Path) -> None:
    np.save(path := tmp_path / "a.npy", RGB)
    alone = {"opacity": [[0, 0], [255, 0.5]], "unit": 2}
    transfer = parse_scene(tree_of(path, transfer_function=alone), base=tmp_path).layers[0].transfer_function
    assert [(p.value, p.color, p.opacity) for p in transfer.mapping] == [(0, (1, 1, 1), 0), (255, (1, 1, 1), 0.5)]
    with pytest.raises(SceneError) as caught:
        parse_scene(small_tree(transfer_function=alone), base=tmp_path)
    assert [problem.path for problem in caught.value.problems] == [
        "transfer_function.colormap",
        "transfer_function.range",
    ]


@pytest.mark.parametrize(("alpha", "component"), [(None, "color"), (255, "color"), (RGBA[..., 3], "color_alpha")])
def test_a_scene_without_transfer_function_says_what_was_chosen(tmp_path: Path, alpha: Any, component: str) -> None:
    voxels = RGBA.copy()
    voxels[..., 3] = 0 if alpha is None else alpha
    np.save(path := tmp_path / "a.npy", RGB if alpha is None else voxels)
    tree = tree_of(path)
    del tree["transfer_function"]
    (tmp_path / "a.yaml").write_text(yaml.safe_dump(tree))
    assert load_job(SceneRequest(tmp_path / "a.yaml"), reads="nothing").scene.layers[0].volume.component == "color"
    scene = load_job(SceneRequest(tmp_path / "a.yaml")).scene
    assert (scene.layers[0].volume.component, scene.has_list) == (component, False)
    assert {point.color for point in scene.layers[0].transfer_function.mapping} == {(1.0, 1.0, 1.0)}
    assert scene.layers[0].transfer_function.mapping[0].opacity == 0


@pytest.mark.usefixtures("one_process")
def test_init_and_info_take_pictures_for_colors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tifffile.imwrite(path := tmp_path / "a.tif", np.tile(RGB, (2, 3, 3, 1)), photometric="rgb")

    def printed(*arguments: str) -> str:
        capsys.readouterr()
        assert main.run(arguments) == 0
        return capsys.readouterr().out

    assert yaml.safe_load(printed("init", str(path)))["volume"]["component"] == "color"
    assert "voxels that are colours" in printed("info", str(path))
    assert yaml.safe_load(printed("init", str(path), "--component", "1"))["volume"]["component"] == 1

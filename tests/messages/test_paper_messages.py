"""What a user reads when `hsplat paper` cannot do what was asked; and nothing is left lying."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from hsplat_cli import main
from hsplat_cli.commands.paper import SCENES

Fails = Callable[..., str]


@pytest.fixture
def fails(scene_folder: Path, capsys: pytest.CaptureFixture[str]) -> Fails:
    """Runs `hsplat paper` in a folder whose folder `figures` has the scenes given, as texts by name."""

    def run(*arguments: str, code: int = 2, **scenes: str) -> str:
        (scene_folder / "figures").mkdir()
        for name, text in scenes.items():
            (scene_folder / "figures" / f"{name.lstrip('_')}.yaml").write_text(text, "utf-8")
        before = set(scene_folder.rglob("*"))
        assert main.run(["paper", "figures", "--quiet", *arguments]) == code
        said = capsys.readouterr()
        assert said.out == ""
        assert set(scene_folder.rglob("*")) == before
        return said.err.replace(str(scene_folder), "/scans")

    return run


def config(name: str, old: str = "", new: str = "") -> str:
    text = (SCENES / name).read_text("utf-8")
    assert old in text
    return text.replace(old, new) if old else text


def test_no_scenes(fails: Fails) -> None:
    assert fails(other="version: 1") == (
        "figures: no scene files of the paper's figures\n"
        "  expected: 1_footprints.yaml, 2_opacity.yaml, 3_one_splat.yaml, 4_levels.yaml, 5_octrees.yaml, "
        "6_engine.yaml\n"
        "  hint: without FOLDER, the scenes that come with hsplat are used\n"
    )


def test_an_unknown_figure(fails: Fails) -> None:
    assert fails("--figure", "7") == "--figure 7: no such figure\n  expected: a number from 1 to 6\n"


def test_a_figure_without_its_scene(fails: Fails) -> None:
    text = config("3_one_splat.yaml")
    assert fails("--figure", "2", _3_one_splat=text) == (
        "--figure 2: the scene of this figure is missing\n  expected: figures/2_opacity.yaml\n"
    )


def test_a_scene_with_a_mistake(fails: Fails) -> None:
    text = config("5_octrees.yaml", "overlay: octree", "overlay: tree")
    assert fails("--volume", "scan.nrrd", _5_octrees=text) == (
        """\
figures/5_octrees.yaml:30:10: overlay: unknown value
    | overlay: tree
    |          ^
  got: 'tree'
  expected: none or octree
  hint: did you mean octree?
"""
    )


def test_a_volume_that_cannot_be_read(fails: Fails) -> None:
    said = fails("--volume", "scan.nrrd", _3_one_splat=config("3_one_splat.yaml"), _5_octrees=config("5_octrees.yaml"))
    assert said.startswith("/scans/scan.nrrd: ")


def test_a_volume_that_is_not_there(fails: Fails) -> None:
    """One that is asked for has no stand-in."""
    assert fails("--volume", "scan.nhdr", _5_octrees=config("5_octrees.yaml")) == (
        "--volume scan.nhdr: volume.file: no such file\n"
        "  got: /scans/scan.nhdr\n"
        "  expected: an NRRD, MetaImage, NIfTI, TIFF or .npy file, or a folder of DICOM or TIFF slices\n"
        "  hint: did you mean scan.nrrd?\n"
    )


def test_an_output_that_is_a_file(fails: Fails) -> None:
    assert fails("--output", "walnut.raw", _3_one_splat=config("3_one_splat.yaml")) == (
        "walnut.raw: the folder of the report is a file\n"
        "  got: a file\n"
        "  expected: a folder, or an unused name\n"
        "  hint: name another folder\n"
    )


def test_a_package_that_is_missing(fails: Fails, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert fails() == "the package jinja2 is not installed\n  hint: pip install 'hsplat[measure]'\n"


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        (
            "1_footprints",
            "shape: [1, 1, 1]",
            "shape: [2, 1, 1]",
            "figure 1 needs one splat in parallel projection\n  got: 2 splats, orthographic\n"
            "  hint: give it a volume of 1 x 1 x 1 voxels\n",
        ),
        (
            "2_opacity",
            "shape: [64, 16, 64]",
            "shape: [64, 15, 64]",
            "figure 2 needs a slab of one material\n"
            "  expected: volume.procedural: {name: constant, shape: [x, y, z]}, y a power of two, "
            "x and z at least 4 y, and transfer_function.points\n",
        ),
        (
            "3_one_splat",
            "name: constant",
            "name: single_voxel",
            "figure 3 needs a cube of one material\n"
            "  expected: volume.procedural: {name: constant, shape: [1, 1, 1]}\n",
        ),
        (
            "3_one_splat",
            'value: 0, color: "#ffd080", opacity: 0.1}',
            "value: 201, color: white, opacity: 0}\n    - {value: 202, color: white, opacity: 1}",
            "figure 3 needs a scene that is drawn as one splat\n  got: 0 splats\n",
        ),
        (
            "2_opacity",
            "  points:\n    - {value: 0, color: white, opacity: 0.05}",
            "  colormap: viridis\n  range: [0, 255]\n  opacity: [[0, 0.1]]",
            "figure 2 needs a slab of one material\n"
            "  expected: volume.procedural: {name: constant, shape: [x, y, z]}, y a power of two, "
            "x and z at least 4 y, and transfer_function.points\n",
        ),
        (
            "4_levels",
            "{name: constant, shape: [64, 64, 64]}",
            "{name: marschner_lobb, shape: [8, 8, 8]}",
            "figure 4 needs a volume of one material\n  hint: volume.procedural: {name: constant, ...}\n",
        ),
        (
            "2_opacity",
            "size: [128, 128]",
            "size: [8, 8]",
            "figure 2 needs the middle 16 x 16 voxels of the slab in the picture, larger than pixels\n"
            "  got: voxels of 0.125 pixels in a picture of 8 x 8 pixels\n"
            "  expected: voxels of 1.5 pixels or more, 16 of them along its height and its width\n"
            "  hint: output.size sets the number of pixels, camera.distance the number of voxels they show\n",
        ),
        (
            "2_opacity",
            "size: [128, 128]",
            "size: [16, 128]",
            "figure 2 needs the middle 16 x 16 voxels of the slab in the picture, larger than pixels\n"
            "  got: voxels of 2 pixels in a picture of 16 x 128 pixels\n"
            "  expected: voxels of 1.5 pixels or more, 16 of them along its height and its width\n"
            "  hint: output.size sets the number of pixels, camera.distance the number of voxels they show\n",
        ),
        (
            "3_one_splat",
            "opacity: 0.1}",
            "opacity: 0.6}",
            "figure 3 needs translucent splats\n"
            "  got: alpha 1 for a cube of 16^3 voxels of opacity 0.6\n"
            "  expected: alpha below 0.9999 for cubes of up to 32^3 voxels\n"
            "  hint: lower the opacities of the transfer function\n",
        ),
        (
            "3_one_splat",
            "target: visible",
            "target: [1.5, 0, 0]",
            "figure 3 needs a splat in the middle of the picture\n"
            "  got: alpha 0 in the middle\n"
            "  hint: camera.target: visible\n",
        ),
        (
            "4_levels",
            "shape: [64, 64, 64]",
            "shape: [3, 3, 3]",
            "figure 4 compares two levels or more, and this volume is too small for that\n"
            "  got: 3 x 3 x 3 voxels\n"
            "  expected: 8 or more along every side\n",
        ),
        (
            "4_levels",
            'value: 0, color: "#a0d0ff", opacity: 0.02}',
            "value: 201, color: white, opacity: 0}\n    - {value: 202, color: white, opacity: 1}",
            "figure 4 needs a visible volume\n"
            "  hint: raise the opacities of the transfer function, or point the camera at the volume\n",
        ),
        (
            "5_octrees",
            "tolerance: 1 ",
            "tolerance: 0 ",
            "figure 5 draws multiples of the scene's tolerance\n"
            "  got: error.tolerance: 0\n"
            "  expected: error.tolerance: a number above 0\n"
            "  hint: give the tolerance of its third octree of four, such as 1\n",
        ),
        (
            "5_octrees",
            "tolerance: 1 ",
            "psnr: 30 ",
            "figure 5 draws multiples of the scene's tolerance\n"
            "  got: error.psnr: 30\n"
            "  expected: error.tolerance: a number above 0\n"
            "  hint: give the tolerance of its third octree of four, such as 1\n",
        ),
    ],
)
def test_a_scene_of_something_else(fails: Fails, name: str, old: str, new: str, message: str) -> None:
    assert fails(**{f"_{name}": config(f"{name}.yaml", old, new)}) == f"figures/{name}.yaml: {message}"

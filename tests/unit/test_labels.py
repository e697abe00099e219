"""Labels and masks of a scene: which are shown, how they look, and the numbers by which they are drawn."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from volume_files import write_image

from hsplat_cli.commands.check import check
from hsplat_cli.scenes import SceneRequest, load_job
from renderer.errors import InputError, SceneError
from renderer.layers import leave_out_masked, mask_volume, number_labels
from renderer.readers import read_volume
from renderer.resolve import resolve_scene
from renderer.scene import (
    FileSource,
    LabelsSpec,
    LabelStyle,
    MaskSpec,
    Scene,
    SharedKeys,
    VolumeSpec,
    parse_scene,
    scene_to_dict,
)
from renderer.suggest import label_colors
from renderer.volume import Array, make_volume, move_volume

RED, GREEN, BLUE, WHITE, BLACK = (1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0), (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
PRESENT = [-3, 0, 1, 2, 5, 300]
TABLE = "1 liver 255 0 0 51\n2 kidney 0 255 0 255\n5 kidney 0 0 255 255\n9 lung 9 9 9 255\n"
KIDNEYS = ((2, "kidney", GREEN), (5, "kidney", BLUE))
AUTO = dict(zip([-3, 1, 2, 5, 300], label_colors(5), strict=True))
LIVER, RIGHT, LEFT = (LabelStyle(1, "liver", RED, 0.2), *(LabelStyle(*each, 1.0) for each in KIDNEYS))
OTHER, LAST = LabelStyle(-3, "", AUTO[-3], 1.0), LabelStyle(300, "", AUTO[300], 1.0)


@pytest.fixture(autouse=True)
def files(folder: Path) -> None:
    """Write a volume of labels with a table beside it, and one without."""
    save("organs.npy", np.repeat(np.array(PRESENT, np.int16), 9))
    Path("organs.ctbl").write_text(TABLE)
    save("bare.npy", np.repeat(np.array([0, 4, 6], np.uint8), 9))


def save(name: str, values: Array) -> None:
    np.save(name, values.reshape(-1, 3, 3) if values.size % 9 == 0 else values.reshape(-1, 1, 1))


def scene(*layers: dict[str, Any], **sections: Any) -> Scene:
    """Return a scene of volumes in a list, or of one volume by its sections."""
    camera, output = {"path": {"type": "turntable", "frames": 2}}, {"file": "a.mp4", "size": [16, 16]}
    many = {"volumes": list(layers)} if layers else {"volume": {"file": "organs.npy"}}
    return parse_scene({"version": 1, **many, "camera": camera, "output": output, **sections}, base=Path())


CHOICES: dict[str, tuple[dict[str, Any], list[LabelStyle]]] = {
    "all but 0": ({}, [OTHER, LIVER, RIGHT, LEFT, LAST]),
    "numbers": ({"show": [300, 5, -3]}, [OTHER, LEFT, LAST]),
    "a number as text": ({"show": ["5"]}, [LEFT]),
    "a name of several": ({"show": ["kidney", 2]}, [RIGHT, LEFT]),
    "hidden": ({"hide": ["kidney", -3]}, [LIVER, LAST]),
    "shown and hidden": ({"show": ["kidney", 300], "hide": [5]}, [RIGHT, LAST]),
    "0": ({"show": [0]}, [LabelStyle(0, "", WHITE, 1.0)]),
    "one that the table alone has": ({"show": [1, "lung"]}, [LIVER]),
    "an opacity": ({"show": [1, 2], "opacity": 0.4}, [LIVER._replace(opacity=0.4), RIGHT._replace(opacity=0.4)]),
    "opacities": ({"show": ["kidney"], "opacity": {"kidney": 0.4, 5: 0.0}}, [RIGHT._replace(opacity=0.4)]),
    "the table's opacity, with all numbers and colours": ({"show": [1], "colors": {1: "red"}}, [LIVER]),
    "opacities, not the table's": ({"show": [1], "opacity": {300: 0.5}}, [LIVER._replace(opacity=1.0)]),
    "colours": ({"show": ["kidney", 300], "colors": {"kidney": "white", 5: "black"}},
                [RIGHT._replace(color=WHITE), LEFT._replace(color=BLACK), LAST]),
    "auto": ({"show": [2], "colors": "auto"}, [RIGHT._replace(color=AUTO[2])]),
    "table": ({"show": ["kidney"], "colors": "table"}, [RIGHT, LEFT]),
    "names": ({"show": ["heart"], "names": {300: "heart", 1: "heart"}},
              [LIVER._replace(name="heart"), LAST._replace(name="heart")]),
    "names of a file": ({"show": ["x"], "names": "names.txt"}, [LabelStyle(300, "x", AUTO[300], 1.0)]),
}  # fmt: skip


@pytest.mark.parametrize("case", CHOICES)
def test_labels_are_chosen_with_their_looks(case: str) -> None:
    """The choice is written into the scene, which needs no voxels any more, and reads back."""
    Path("names.txt").write_text("300 x\n")
    section, expected = CHOICES[case]
    found = resolve_scene(scene(labels=section), read_volume)
    labels = found.layers[0].transfer_function.labels
    assert labels is not None
    assert labels.styles == tuple(style._replace(color=pytest.approx(style.color)) for style in expected)
    again = parse_scene(scene_to_dict(found), base=Path())
    assert not any(layer.depends_on_voxels for layer in again.layers)
    assert resolve_scene(again, pytest.fail) == again == found


@pytest.mark.parametrize(
    ("section", "place", "what", "hint"),
    [
        ({"show": [2, 7]}, "labels.show.1", "no such label in the volume", "the nearest is 5"),
        ({"hide": ["livr"]}, "labels.hide.0", "no such label in the volume", "did you mean liver?"),
        ({"colors": {"nix": "red"}}, "labels.colors.nix", "no such label in the volume", None),
        ({"opacity": {-4: 1}}, "labels.opacity.-4", "no such label in the volume", "the nearest is -3"),
        ({"show": ["lung"]}, "labels", "no label is shown", None),
        ({"opacity": 0}, "labels", "no label is shown", None),
        ({"colors": "table"}, "labels.colors", "the table has no such label", None),
    ],
)
def test_labels_that_are_not_there_are_told(section: dict[str, Any], place: str, what: str, hint: str | None) -> None:
    with pytest.raises(SceneError) as caught:
        resolve_scene(scene(labels=section), read_volume)
    (problem,) = caught.value.problems
    assert (problem.path, problem.what, problem.hint) == (place, what, hint)
    with pytest.raises(SceneError, match="its labels have no names"):
        resolve_scene(scene({"file": "bare.npy", "labels": {"show": ["x"]}}), read_volume)
    save("bare.npy", np.zeros(27, np.uint8))
    with pytest.raises(SceneError, match="all are 0\n  expected: labels other than 0"):
        resolve_scene(scene({"file": "bare.npy", "labels": {}}), read_volume)


def test_labels_that_are_not_there_are_told_with_their_lines() -> None:
    text = "version: 1\nvolume: {file: organs.npy}\nlabels: {show: [livr]}\noutput: {file: a.mp4}\n"
    Path("scene.yaml").write_text(text + "camera: {path: {type: turntable, frames: 2}}\n")
    with pytest.raises(SceneError, match=r"scene.yaml:3:17: labels.show.0: no such label"):
        load_job(SceneRequest(Path("scene.yaml")))
    with pytest.raises(SceneError, match=r"--set labels.show=\[7\]: labels.show.0: no such label"):
        load_job(SceneRequest(Path("scene.yaml"), ["labels.show=[7]"]))


def test_masks_choose_labels_and_may_be_a_volume_of_the_list() -> None:
    moved = {"transform": [[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}
    one = {"file": "bare.npy", "color": "red", "range": [0, 9], "mask": {"name": "organs", "hide": ["kidney"]}}
    two = {"file": "organs.npy", "name": "organs", **moved, "labels": {"show": [2]}}
    found = resolve_scene(scene(one, two, mask={"file": "bare.npy", "show": [6]}), read_volume)
    named, shared = (layer.mask for layer in found.layers)
    assert named is not None and shared is not None
    organs = found.layers[1]
    assert (named.volume, named.transform, named.labels.values) == (organs.volume, organs.transform, (-3, 1, 300))
    assert (shared.volume, shared.labels.values) == (VolumeSpec(FileSource(Path("bare.npy"))), (6,))
    again = parse_scene(scene_to_dict(found), base=Path())
    assert [layer.mask for layer in again.layers] == [named, shared]
    for mask, problem in (({"name": "organ"}, "did you mean organs"), ({"name": "organs", "time": 1}, "contradicts")):
        with pytest.raises(SceneError, match=rf"volumes\.0\.mask[^:]*: (.|\n)*{problem}"):
            scene({**one, "mask": mask}, two)
    heart = {**one, "mask": {"name": "organs", "show": ["heart"]}}
    found = resolve_scene(scene(heart, {**two, "labels": {"names": {5: "heart"}}}), read_volume)
    assert found.layers[0].mask == MaskSpec(organs.volume, LabelsSpec(show=(5,)), organs.transform)
    of_all = scene(one, two, mask={"name": "organs", "show": [1]})
    assert of_all.layers[1].mask == MaskSpec(organs.volume, LabelsSpec(show=(1,)), organs.transform)
    assert of_all.shared == SharedKeys(mask=of_all.layers[1].mask) and of_all.layers[0].mask != of_all.layers[1].mask
    with pytest.raises(SceneError, match=r"mask\.name: no volume of this name"):
        scene(labels={}, mask={"name": "organs"})
    with pytest.raises(SceneError, match=r"volumes\.1\.name: no name"):
        scene(one, {**two, "name": 3}, mask={"name": "organs"})
    with pytest.raises(SceneError, match=r"mask\.show: not a list"):
        scene(one, two, mask={"name": "organs", "show": 1})
    with pytest.raises(SceneError, match=r"volumes\.0\.mask\.show\.0: no such label"):
        resolve_scene(scene({**one, "mask": {"name": "organs", "show": ["nix"]}}, two), read_volume)


def test_labels_of_60_bits_can_be_read_again() -> None:
    save("a.npy", np.repeat(np.array([0, 2**60, 2**60 + 1], np.uint64), 9))
    found = scene_to_dict(resolve_scene(scene({"file": "a.npy", "labels": {}}), read_volume))
    labels = parse_scene(found, base=Path()).layers[0].transfer_function.labels
    assert labels is not None and labels.values == (2**60, 2**60 + 1)


def test_volumes_that_are_no_labels_are_refused() -> None:
    save("bare.npy", np.where(np.arange(27) == 14, 1.5, 1.0))
    save("a.npy", np.full(27, 1e19, np.float32))
    with pytest.raises(InputError, match=r"a label is too large\n  got: 1e\+19"):
        resolve_scene(scene({"file": "a.npy", "labels": {}}), read_volume)
    save("organs.npy", np.arange(65537, dtype=np.int32))
    with pytest.raises(InputError, match=r"no map of labels\n  got: 1.5 in the voxel \[2, 1, 1\]"):
        resolve_scene(scene({"file": "bare.npy", "labels": {}}), read_volume)
    with pytest.raises(InputError, match="too many labels\n  expected: at most 65536"):
        resolve_scene(scene(labels={}), read_volume)


@pytest.mark.parametrize(
    ("values", "shown", "numbers", "dtype"),
    [
        (np.array([0, 3, 7, 255], np.uint8), (3, 255), [0, 1, 0, 2], "uint8"),
        (np.array([-32768, -1, 0, 5], np.int16), (-32768, 0), [1, 0, 2, 0], "uint8"),
        (np.array([2**53, 2**53 - 1, -(2**53), 2**62]), (-(2**53), 2**53), [2, 0, 1, 0], "uint8"),
        (np.array([2**60, 2**60 + 1, 5], np.uint64), (2**60, 2**60 + 1), [1, 2, 0], "uint8"),
        (np.array([np.nan, 1.0, -2.0, 3.0], np.float32), (-2, 1), [0, 2, 1, 0], "uint8"),
        (np.arange(300, dtype=np.uint16)[::-1], tuple(range(1, 300)), [*range(300)][::-1], "uint16"),
    ],
)
def test_shown_labels_are_numbered(values: Array, shown: tuple[int, ...], numbers: list[int], dtype: str) -> None:
    save("a.npy", values)
    volume = read_volume(VolumeSpec(FileSource(Path("a.npy"))))
    found = number_labels(volume, shown)
    assert found.values.ravel().tolist() == numbers and found.values.dtype == dtype
    assert found.is_labels and not found.num_absent and found.fingerprint == volume.fingerprint
    mask = mask_volume(volume, volume, shown).mask
    assert mask is not None and mask.values.ravel().tolist() == [min(number, 1) for number in numbers]
    with pytest.raises(InputError, match=r"no such labels in this volume\n  got: \[-7, 70000\]"):
        number_labels(volume, sorted((-7, *shown, 70000)))


@pytest.mark.parametrize(
    ("sections", "message"),
    [
        ({"transfer_function": {"import": "ct-bone"}}, "labels: contradicts transfer_function"),
        ({"mode": "maximum"}, "labels: contradicts mode: maximum"),
        (
            {"volumes": [{"file": "organs.npy", "labels": {}, "range": [0, 1]}]},
            r"volumes\.0\.range: contradicts volumes\.0\.labels",
        ),
        ({"splat": {"footprint": "gaussian"}}, "labels: needs footprint: integrated"),
        ({"shading": {"gradient_opacity": [[0, 0], [1, 1]]}}, "shading.gradient_opacity: contradicts labels"),
        ({"volume": {"file": "organs.npy", "component": "color"}}, "labels: contradicts component: color"),
        ({"mask": {"file": "organs.npy", "component": "all"}}, "mask.component: no component of labels"),
        ({"shading": {}, "error": {"finest_level": 1}}, "shading: contradicts error.finest_level"),
        ({"shading": {}, "error": {"splats": 9}}, "shading: contradicts error.splats"),
    ],
)
def test_labels_contradict_what_needs_scalars(sections: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=rf"^{message}"):
        scene(labels={}, **sections)


def test_a_mask_needs_voxels() -> None:
    with pytest.raises(SceneError, match=r"^mask: no voxels\n  expected: one of file, raw, procedural and name$"):
        scene(mask={"show": [1]}, labels={})


def test_a_mask_that_shows_no_voxel_is_refused() -> None:
    save("organs.npy", np.arange(8, dtype=np.uint8))
    volume = read_volume(VolumeSpec(FileSource(Path("organs.npy"))))
    far = move_volume(volume, np.array([[1.0, 0, 0, 99], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]))
    with pytest.raises(InputError, match="the mask shows no voxel of this volume"):
        leave_out_masked(mask_volume(volume, far, (1, 2)))
    left = leave_out_masked(mask_volume(volume, volume, (2, 3)))
    assert left.mask is None and left.num_absent == 6 and left.values[~left.are_absent].tolist() == [2.0, 3.0]


@pytest.mark.parametrize("suffix", [".npy", ".tif"])
def test_a_mask_without_lengths_has_the_grid_of_the_volume_whose_shape_it_has(suffix: str) -> None:
    """As napari, cellpose and Fiji save masks. Where it gives lengths, or has another shape, it keeps its own."""
    values = np.zeros((4, 6, 5), np.uint8)
    values[:, 3:, :] = 1
    write_image(Path(f"mask{suffix}"), values)
    placed = np.array([[0.5, 0, 0, 3], [0, 0.5, 0, 4], [0, 0, 2, 5], [0, 0, 0, 1.0]])
    scan = make_volume(np.ones((4, 6, 5), np.float32), placed, "scan")
    unplaced = read_volume(VolumeSpec(FileSource(Path(f"mask{suffix}"))))
    mask = mask_volume(scan, unplaced, [1]).mask
    assert mask is not None and mask.note is not None
    np.testing.assert_array_equal(mask.world_from_index, placed)
    assert "voxel size" in mask.note and "so its grid is taken" in mask.note
    kept = mask_volume(make_volume(np.ones((4, 6, 6), np.float32), placed, "other"), unplaced, [1]).mask
    assert kept is not None and kept.note is not None and "voxel size" in kept.note
    np.testing.assert_array_equal(kept.world_from_index, np.eye(4))
    sized = read_volume(VolumeSpec(FileSource(Path(f"mask{suffix}"), spacing=(1.0, 1.0, 1.0))))
    own = mask_volume(scan, sized, [1]).mask
    assert own is not None and own.note is None
    np.testing.assert_array_equal(own.world_from_index, np.eye(4))


@pytest.mark.parametrize(
    ("labels", "place"),
    [
        ({"colors": {99: "red"}}, "labels.colors.99"),
        ({"show": [1, 99], "opacity": 1, "colors": {1: "red", 99: "blue"}}, "labels.show.1"),
        ({"hide": ["heart"]}, "labels.hide.0"),
        ({"opacity": {99: 0.5}}, "labels.opacity.99"),
    ],
)
def test_check_looks_for_labels_without_the_cost(labels: dict[str, Any], place: str) -> None:
    """Also where a scene is complete, so that nothing else has to be read for it."""
    camera, output = {"path": {"type": "turntable", "frames": 2}}, {"file": "a.mp4", "size": [16, 16]}
    tree = {"version": 1, "volume": {"file": "bare.npy"}, "labels": labels, "camera": camera, "output": output}
    Path("scene.yaml").write_text(yaml.safe_dump(tree))
    with pytest.raises(SceneError, match=f"{re.escape(place)}: no such label"):
        CliRunner().invoke(check, ["scene.yaml", "--no-cost"], catch_exceptions=False)

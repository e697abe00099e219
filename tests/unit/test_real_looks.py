"""Transfer functions as other programs ship them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from look_scene import look_scene

pytestmark = pytest.mark.real_data

# File, name, keys of the scene, number of looks' points at least, unit, first visible value.
FILES: dict[str, tuple[dict[str, Any], float | None, float]] = {
    "transfer_functions/slicer_presets.xml": ({"name": "CT-Bone"}, 1.0, -16.4458),
    "transfer_functions/slicer_VolumeProperty.vp": ({}, 1.0, 13),
    "transfer_functions/niivue_ct_bones.json": ({}, None, 180 + 420 / 255),
    "transfer_functions/mricrogl_CT_Bones.clut": ({}, None, 180 + 420 / 255),
    "transfer_functions/niivue_ct_head.json": ({}, None, -590),
    "transfer_functions/mricrogl_CT_Head.clut": ({}, None, -590),
    "transfer_functions/niivue_ct_cardiac.json": ({}, None, -80),
    "transfer_functions/niivue_ct_vessels.json": ({}, None, 114),
    "transfer_functions/mricrogl_CT_w_Contrast.clut": ({}, None, 50),
    "transfer_functions/fsleyes_harvard-oxford-subcortical.lut": ({}, None, 0.5),
    "transfer_functions/fsleyes_mgh-cma-freesurfer.lut": ({}, None, 0.5),
    "walnut.tfi": ({}, None, 0.27766091 * 22526),
    "transfer_functions/paraview_ColorMaps.json": (
        {"name": "Cool to Warm", "range": [-3, 5], "opacity": [[-1, 0], [5, 0.3]]}, None, -1),
    "transfer_functions/fsleyes_blue-lightblue.cmap": ({"range": [0, 9], "opacity": [[4, 0], [9, 0.3]]}, None, 4),
}  # fmt: skip


@pytest.mark.parametrize("name", FILES)
def test_the_file_becomes_points(name: str, data_dir: Path) -> None:
    keys, unit, foot = FILES[name]
    spec = look_scene({"import": str(data_dir / name), **keys}).layers[0].transfer_function
    assert isinstance(spec.mapping, tuple) and spec.unit == unit
    first = next(k for k, point in enumerate(spec.mapping) if point.opacity > 0)
    assert spec.mapping[first - 1].value == pytest.approx(foot)


def test_two_programs_tables_of_the_same_look_are_the_same(data_dir: Path) -> None:
    for name in ("Bones", "Head"):
        folder = data_dir / "transfer_functions"
        one = look_scene({"import": str(folder / f"mricrogl_CT_{name}.clut")})
        other = look_scene({"import": str(folder / f"niivue_ct_{name.lower()}.json")})
        assert one.layers[0].transfer_function == other.layers[0].transfer_function


def test_colours_at_one_value_keep_the_order_of_the_file(data_dir: Path) -> None:
    """The file has four points at 0.5, the first and the last of one colour, so that there is no step."""
    keys = {"name": "Muted Blue-Green", "range": [0, 1], "opacity": [[0, 1]]}
    file = data_dir / "transfer_functions/paraview_ColorMaps.json"
    mapping = look_scene({"import": str(file), **keys}).layers[0].transfer_function.mapping
    assert isinstance(mapping, tuple)
    assert [point.color for point in mapping if point.value == 0.5] == [(0.980392, 0.984314, 1)]

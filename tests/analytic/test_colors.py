"""Voxels that are colours: against closed forms, and bricks of them against exact rays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from small_scene import small_tree
from stage_pictures import decibels, decibels_of_means, drawn, drawn_by_single_rays, exact

from renderer.frame import Stage, prepare_stage
from renderer.readers import read_volume
from renderer.resolve import resolve_scene
from renderer.scene import parse_scene
from renderer.volume import UInt8

LIGHT = {"ambient": 0.3, "diffuse": 0.7, "light": [1, -1, 1]}
EVEN: dict[str, Any] = {"opacity": [[0, 0.05], [255, 0.05]]}
ABOVE = {"projection": "orthographic", "path": {"type": "turntable", "frames": 8, "elevation": 90}}


def stage_of(folder: Path, voxels: npt.NDArray[Any], *, tolerance: float = 0.0, **sections: Any) -> Stage:
    """A stage of voxels [z, y, x, 3 or 4]."""
    np.save(folder / "a.npy", voxels)
    tree = small_tree(volume={"file": str(folder / "a.npy"), "component": "color"}, **sections)
    tree["error"] = {"tolerance": tolerance} | tree.get("error", {})
    if "transfer_function" not in sections:
        del tree["transfer_function"]
    scene = resolve_scene(parse_scene(tree, base=folder), read_volume)
    return prepare_stage(scene, clock=lambda: 0.0, num_threads=2)


def ball(side: int) -> UInt8:
    """Smooth colours and a smooth alpha, with a hole."""
    grid = np.indices((side + 2, side, side - 3)) / (side - 1)
    z, y, x = grid
    radius = np.sqrt(((grid - 0.5) ** 2).sum(axis=0))
    alpha = np.clip(1.6 - 4 * radius, 0, 0.5) * (radius > 0.15)
    colors = np.stack([x, y, 0.5 + 0.5 * np.sin(9 * z), alpha], axis=-1)
    return np.rint(255 * np.clip(colors, 0, 1)).astype(np.uint8)


EACH_PICTURE = pytest.mark.parametrize("picture", [drawn, exact], ids=["drawn", "exact"])


@EACH_PICTURE
def test_an_even_slab_has_its_color(tmp_path: Path, picture: Any) -> None:
    """Exactly in colour, and in the opacity of its thickness."""
    color = np.array([200, 100, 50])
    slab = np.broadcast_to(color, (8, 30, 30, 3)).astype(np.uint8)
    with stage_of(tmp_path, slab, transfer_function=EVEN, camera=ABOVE) as stage:
        middle = picture(stage)[16, 16]
    assert middle[3] == pytest.approx(1 - 0.95**8, rel=1e-5)
    np.testing.assert_allclose(middle[:3], middle[3] * color / 255, rtol=1e-5)


@EACH_PICTURE
def test_a_ramp_of_alpha(tmp_path: Path, picture: Any) -> None:
    """Between voxels the extinction is linear: its integral over a column is the sum of voxels."""
    ramp = np.zeros((6, 30, 30, 4), np.uint8)
    ramp[..., 1], ramp[..., 3] = 255, (20 * np.arange(6))[:, None, None]
    with stage_of(tmp_path, ramp, camera=ABOVE) as stage:
        assert stage.scene.layers[0].volume.component == "color_alpha"
        table = stage.layers[0].transfer.classify(ramp[:, 0, 0, 3])[1]
        middle = picture(stage)[16, 16]
    np.testing.assert_allclose(table, -np.log1p(ramp[:, 0, 0, 3] / -255.0), atol=2e-3)
    np.testing.assert_allclose(middle, [0, -np.expm1(-table.sum()), 0, -np.expm1(-table.sum())], rtol=1e-5)


@pytest.mark.parametrize("shading", [None, LIGHT, LIGHT | {"occlusion": 0.7, "shadow": 0.5}])
@pytest.mark.parametrize(("tolerance", "least"), [(0.0, 60), (0.05, 50)])
def test_bricks_show_what_exact_rays_do(tmp_path: Path, shading: Any, tolerance: float, least: float) -> None:
    sections = {} if shading is None else {"shading": shading}
    sections["output"] = {"file": "film.mp4", "size": [96, 96]}
    with stage_of(tmp_path, ball(40), tolerance=tolerance, **sections) as stage:
        picture, truth = drawn_by_single_rays(stage), exact(stage)
        assert decibels_of_means(stage) > 70  # found: 77 and more
    assert truth[..., 3].max() > 0.5
    assert decibels(picture, truth) > least


@pytest.mark.parametrize("blend", ["mix", "add"])
def test_colors_on_the_grid_of_scalars_and_beside_it(tmp_path: Path, blend: str) -> None:
    voxels = ball(20)
    np.save(tmp_path / "a.npy", voxels)
    file = {"file": str(tmp_path / "a.npy")}
    points = [{"value": 0, "color": "black", "opacity": 0}, {"value": 255, "color": "lime", "opacity": 0.1}]
    shift = [[1, 0, 0, 6.5], [0, 1, 0, 3], [0, 0, 1, -4.2], [0, 0, 0, 1]]
    layers = [
        file | {"component": "color", "weight": 0.5},
        file | {"component": 0, "transfer_function": {"points": points}},
        file | {"component": "color", "transform": shift},
    ]
    tree = small_tree(volumes=layers, blend=blend, error={"tolerance": 0}, output={"file": "a.mp4", "size": [64, 64]})
    del tree["volume"], tree["transfer_function"]
    scene = resolve_scene(parse_scene(tree, base=tmp_path), read_volume)
    assert [layer.volume.component for layer in scene.layers] == ["color_alpha", 0, "color_alpha"]
    with prepare_stage(scene, clock=lambda: 0.0, num_threads=2) as stage:
        assert len(stage.groups) == 2
        assert decibels(drawn_by_single_rays(stage), exact(stage)) > 60


def test_coarse_bricks_show_means(tmp_path: Path) -> None:
    with stage_of(tmp_path, ball(64), error={"finest_level": 1}) as stage:
        assert decibels(drawn(stage), exact(stage)) > 30


def test_voxels_without_data_have_no_part(tmp_path: Path) -> None:
    voxels = ball(20).astype(np.float32)
    voxels[..., 3] = 60
    voxels[10:, :, :, 0] = np.nan
    even = {"opacity": [[0, 0.1], [255, 0.1]]}
    with stage_of(tmp_path, voxels, transfer_function=even) as stage:
        assert stage.layers[0].volume.num_absent == voxels[10:, ..., 0].size
        picture, truth = drawn_by_single_rays(stage), exact(stage)
    assert np.isfinite(picture).all()
    assert decibels(picture, truth) > 60

"""VTK with a preset of 3D Slicer, and hsplat with what it imports of it, draw the same picture."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import vtk_peer
from vtk_peer import VtkSetting, comparable, look_of, measure_vtk

from renderer.accuracy import Truth
from renderer.film import over_background
from renderer.frame import prepare_stage
from renderer.readers import read_volume
from renderer.scene import CameraSpec, TurntablePath, parse_scene
from renderer.truth import Convergence, PixelMeans, SceneRays, pixel_centres
from renderer.view import make_view
from renderer.volume import Float64, make_volume

pytestmark = pytest.mark.real_data

SIZE = (96, 96)
SCALED = 1 / 1.5  # the finest spacing becomes 1, which is what VTK's opacities are for here


def points_of_preset(file: Path, name: str, shift: float) -> Float64:
    """Return float64 [n, 5], value, colour and opacity, as VTK interpolates them: linear in opacity."""
    preset = next(each for each in ElementTree.parse(file).iter("VolumeProperty") if each.get("name") == name)
    color, opacity = (
        np.array(preset.get(key, "").split()[1:], np.float64).reshape(-1, group)
        for key, group in (("colorTransfer", 4), ("scalarOpacity", 2))
    )
    at = np.unique(np.concatenate([color[:, 0], opacity[:, 0]]))
    columns = [np.interp(at, color[:, 0], color[:, k]) for k in (1, 2, 3)]
    return np.column_stack([at + shift, *columns, np.interp(at, opacity[:, 0], opacity[:, 1])])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["CT-Bone", "CT-Muscle"])
def test_vtk_draws_the_preset_as_hsplat_draws_its_import(name: str, data_dir: Path, monkeypatch) -> None:
    presets = data_dir / "transfer_functions/slicer_presets.xml"
    tree = {
        "volume": {"file": str(data_dir / "medical/headsq_quarter.nrrd"), "spacing": [3.2 * SCALED, 3.2 * SCALED, 1]},
        "transfer_function": {"import": str(presets), "name": name, "shift": 1024},
        "camera": {"path": {"type": "turntable", "frames": 1}},
        "output": {"file": "still.png"},
    }
    scene = parse_scene(tree, base=Path(), is_single_frame=True)
    scan = read_volume(scene.layers[0].volume)
    scan = make_volume(scan.values.astype(np.float32), scan.world_from_index, "head")  # exact rays are compiled for it
    scene, volume, _ = comparable(scene, scan)
    distance = 1.2 * float(np.linalg.norm(volume.world_from_index[:3, :3] @ np.array(volume.shape_xyz)))
    x, y, z = volume.centre
    view = make_view(CameraSpec(TurntablePath(1, 30.0, 20.0)), 0, (x, y, z), distance, SIZE)
    with prepare_stage(scene, clock=lambda: 0.0, num_threads=2, volumes=[volume]) as stage:
        exact = SceneRays(stage).integrate(view, pixel_centres(SIZE), 0.25).reshape(*SIZE[::-1], 4)
    picture = over_background(exact, (0.0, 0.0, 0.0))
    means = PixelMeans(picture, np.zeros_like(picture))  # VTK has one ray a pixel
    truth = Truth(0, means, exact[..., 3] > 0, Convergence((), (), ()))
    monkeypatch.setattr(vtk_peer, "_points", lambda *_: points_of_preset(presets, name, 1024.0))
    for measured in measure_vtk(
        volume, look_of(scene, volume), [view], [truth], settings=[VtkSetting("gpu", 0.5)], repeats=0
    ):
        psnr = measured.overall.everywhere["psnr"]
        assert psnr > 45  # 50.5 and 54.9; 30 to 33 without the points in between

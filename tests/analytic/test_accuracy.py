"""Tests of frames of splats against the converged ray integral: the accuracy of one splat for each voxel."""

from __future__ import annotations

from pathlib import Path

import pytest

from renderer.draw import GLRasterizer
from renderer.frame import prepare_stage
from renderer.pyramid import cut_pyramid
from renderer.scene import (
    CameraSpec,
    ControlPoint,
    FileSource,
    OutputSpec,
    Scene,
    SplatSpec,
    TransferSpec,
    TurntablePath,
    VolumeSpec,
)
from renderer.splats import make_splats
from renderer.study import compute_metric, over_background
from renderer.transfer import make_transfer_function
from renderer.truth import integrate
from renderer.view import make_view
from renderer.view.splat_projection import visible_order

SOFT_AND_SOLID = TransferSpec(
    (
        ControlPoint(0, (0.0, 0.0, 0.0), 0.0),
        ControlPoint(60, (0.3, 0.4, 0.8), 0.0),
        ControlPoint(90, (0.4, 0.5, 0.9), 0.01),
        ControlPoint(130, (0.5, 0.6, 0.9), 0.01),
        ControlPoint(160, (0.9, 0.7, 0.3), 0.0488),
        ControlPoint(200, (1.0, 0.8, 0.4), 0.3935),
        ControlPoint(255, (1.0, 0.9, 0.7), 0.5507),
    ),
    unit=1.0,
)


@pytest.mark.real_data
def test_a_splat_for_each_voxel_of_the_engine_is_accurate(data_dir: Path, rasterizer: GLRasterizer) -> None:
    """Measured at every third degree: azimuth 93 has the least, 35.05 dB."""
    scene = Scene(
        volume=VolumeSpec(FileSource(data_dir / "engine.nhdr")),
        transfer_function=SOFT_AND_SOLID,
        camera=CameraSpec(TurntablePath(360, elevation=20.0), distance=741.83),
        output=OutputSpec(Path("unused.mp4")),
        splat=SplatSpec("gaussian"),
    )
    stage = prepare_stage(scene, clock=lambda: 0.0, num_threads=2, any_tolerance=True)
    cut = cut_pyramid(stage.pyramid, 0.0)
    splats = make_splats(cut, scene.splat)
    transfer = make_transfer_function(scene.transfer_function, 1.0)
    for azimuth, least in ((30, 36.0), (93, 34.5)):
        view = make_view(scene.camera, azimuth, stage.target, stage.distance, scene.output.size)
        truth = integrate(stage.volume, transfer, view, step_voxels=1.0)
        frame = rasterizer.rasterize(splats, visible_order(splats, cut, view, scene.splat.order), view)
        pictures = [over_background(radiance, scene.output.background) for radiance in (frame, truth)]
        assert compute_metric("psnr", *pictures) > least, azimuth

"""Tests of frames of splats against the converged ray integral: the accuracy of one splat for each voxel."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from renderer.draw import GLRasterizer
from renderer.frame import Stage, prepare_stage
from renderer.pyramid import cut_pyramid
from renderer.scene import (
    CameraSpec,
    ControlPoint,
    ErrorSpec,
    FileSource,
    OutputSpec,
    ProceduralSource,
    Scene,
    SplatSpec,
    TransferSpec,
    TurntablePath,
    VolumeSpec,
)
from renderer.splats import make_splats
from renderer.transfer import make_transfer_function
from renderer.truth import integrate
from renderer.view import View, make_view
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


def _stage(scene: Scene) -> Stage:
    return prepare_stage(scene, clock=lambda: 0.0, num_threads=2, any_tolerance=True)


def _draw(stage: Stage, view: View, tolerance: float, rasterizer: GLRasterizer) -> np.ndarray:
    cut = cut_pyramid(stage.pyramid, tolerance)
    splats = make_splats(cut, stage.scene.splat)
    return rasterizer.rasterize(splats, visible_order(splats, cut, view, stage.scene.splat.order), view)


def _psnr(image: np.ndarray, truth: np.ndarray) -> float:
    """Return the PSNR over all pixels and a black background, clipped to [0, 1], before quantisation, in dB."""
    difference = np.clip(image[..., :3], 0, 1) - np.clip(truth[..., :3], 0, 1)
    return float(-10 * np.log10(np.mean(difference**2)))


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
    stage = _stage(scene)
    transfer = make_transfer_function(scene.transfer_function, 1.0)
    for azimuth, least in ((30, 36.0), (93, 34.5)):
        view = make_view(scene.camera, azimuth, stage.target, stage.distance, scene.output.size)
        truth = integrate(stage.volume, transfer, view, step_voxels=1.0)
        assert _psnr(_draw(stage, view, 0.0, rasterizer), truth) > least, azimuth


def test_a_finer_tolerance_is_closer_to_the_truth(rasterizer: GLRasterizer) -> None:
    scene = Scene(
        volume=VolumeSpec(ProceduralSource("engine_block", (64, 64, 32))),
        transfer_function=SOFT_AND_SOLID,
        camera=CameraSpec(TurntablePath(8, start=20.0, elevation=25.0)),
        error=ErrorSpec(),
        output=OutputSpec(Path("unused.mp4"), size=(160, 128)),
        splat=SplatSpec("gaussian"),
    )
    for averaged in (scene, replace(scene, pyramid=replace(scene.pyramid, average="opacity"))):
        stage = _stage(averaged)
        view = make_view(scene.camera, 0, stage.target, stage.distance, scene.output.size)
        truth = integrate(stage.volume, make_transfer_function(scene.transfer_function, 1.0), view, step_voxels=1.0)
        reached = [_psnr(_draw(stage, view, tolerance, rasterizer), truth) for tolerance in (2.0, 0.5, 0.1, 0.0)]
        assert reached == sorted(reached), reached
        # Measured 27.29 dB; what is left is classification before interpolation and the width of the footprint.
        assert reached[-1] > 27, reached

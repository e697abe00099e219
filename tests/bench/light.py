"""How near to paths of light is scattered light? `python tests/bench/light.py DATA` prints a table.

Six scans with their suggested transfer functions, in the light of a studio with a key light. The error is that of
shown pictures (sRGB), against the mean over each pixel, without the noise of the paths.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np
import numpy.typing as npt
from measuring import THREADS, parser_of

import renderer
from renderer.draw import BrickRasterizer
from renderer.frame import Stage, prepare_stage, render_frames, view_of
from renderer.lighting import sources_of
from renderer.scene import KeySpec, LightSpec, Scene
from renderer.truth import PathTracer, TrueLayer, light_of_pixels
from renderer.volume import Float64

SCANS = (
    "engine.nhdr",
    "bonsai.nhdr",
    "medical/headsq_quarter.nrrd",
    "medical/CIT168_T1w.nii.gz",
    "medical/chris_PD.nii.gz",
    "medical/seg3d_MR.nii.gz",
)
LIGHT = LightSpec(key=KeySpec((1.0, -1.0, 1.0), (1.0, 0.886, 0.741), 1.0, 14.0))
FRAME = 10
# The width and height of the pictures that are compared.
SIDE = 96
# The number of drawn pixels along a side of a compared pixel.
PARTS = 3
PATHS = 128
TOLERANCE = 0.01


def stage_of(path: Path, side: int, light: LightSpec) -> Stage:
    """Return the stage of a scan in a light, for pictures of a width and height."""
    scene = renderer.suggest_scene(str(path), size=(side, side))
    assert isinstance(scene, Scene)
    shared = None if scene.shared is None else replace(scene.shared, shading=None)
    error = replace(scene.error, tolerance=TOLERANCE)
    lit = replace(scene.with_layers(shading=None), shared=shared, light=light, error=error)
    stage = prepare_stage(lit, clock=process_time, num_threads=THREADS)
    assert isinstance(stage, Stage)
    return stage


def drawn(stage: Stage) -> Float64:
    """Return the linear radiance of compared pixels, float64 [n, 3]."""
    with BrickRasterizer(num_threads=THREADS) as rasterizer:
        (frame,) = render_frames(stage, [FRAME], rasterizer, clock=process_time)
    parts = frame.radiance[..., :3].astype(np.float64).reshape(SIDE, PARTS, SIDE, PARTS, 3)
    return np.asarray(parts.mean(axis=(1, 3)).reshape(-1, 3))


def traced(stage: Stage) -> Float64:
    """Return the linear radiance of compared pixels by paths, in two halves, float64 [2, n, 3]."""
    light = stage.scene.light
    solved = stage.groups[0].light
    assert light is not None and solved is not None
    layers = [TrueLayer(e.volume, e.optics, weight=e.spec.weight, clip=e.spec.clip) for e in stage.layers]
    tracer = PathTracer(layers, sources_of(light), num_threads=THREADS)
    pixels = np.arange(SIDE * SIDE)
    view = view_of(stage, FRAME)
    found = light_of_pixels(tracer, view, pixels, seed=(1,), standard_error=0.0, most_paths=PATHS)
    return found.halves[..., :3] * 2.0**solved.stops


def shown(radiance: npt.ArrayLike) -> Float64:
    """Return sRGB colours, not rounded."""
    linear = np.maximum(np.asarray(radiance, np.float64), 0.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def main() -> None:
    data = parser_of(__doc__).parse_args().data
    print(f"{'scan':30} {'grid':>15} {'PSNR':>6} {'brightness':>10} {'solve':>7}")
    for name in SCANS:
        truth = traced(stage_of(data / name, SIDE, LIGHT))
        stage = stage_of(data / name, SIDE * PARTS, LIGHT)
        solved = stage.groups[0].light
        assert solved is not None
        picture = drawn(stage)
        errors = (shown(picture) - shown(truth[0])) * (shown(picture) - shown(truth[1]))
        decibels = -10 * np.log10(max(float(errors.mean()), 1e-12))
        grid = "x".join(str(side) for side in solved.radiance.shape[2::-1])
        print(
            f"{name:30} {grid:>15} {decibels:6.1f} {picture.mean() / truth.mean():10.3f} "
            f"{stage.seconds['light']:5.1f} s"
        )


if __name__ == "__main__":
    main()

"""How near to paths of light is scattered light? `python tests/bench/light.py DATA` writes the page of it.

Six scans with their suggested transfer functions, in the light of a studio with a key light. The error is that of
shown pictures (sRGB), against the mean over each pixel, without the noise of the paths. All grids of a scan
have one exposure. The page is build/benchmarks/light.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np
import numpy.typing as npt
from measuring import PAGES, THREADS, machine_line, parser_of, write_page

import renderer
from renderer.draw import BrickRasterizer
from renderer.frame import Stage, prepare_stage, render_frames, view_of
from renderer.lighting import SceneLight, sources_of
from renderer.scene import KeySpec, LightSpec, Scene
from renderer.truth import PathTracer, TrueLayer, light_of_pixels
from renderer.volume import Float64

PAGE = PAGES / "light.md"
SCANS = (
    "engine.nhdr",
    "bonsai.nhdr",
    "medical/headsq_quarter.nrrd",
    "medical/CIT168_T1w.nii.gz",
    "medical/chris_PD.nii.gz",
    "medical/seg3d_MR.nii.gz",
)
LIGHT = LightSpec(key=KeySpec((1.0, -1.0, 1.0), (1.0, 0.886, 0.741), 1.0, 14.0))
# The largest numbers of cells along an axis of the grid of light.
CELLS = (128, 192)
FRAME = 10
# The width and height of the pictures.
SIDE = 512
# Every fifth pixel of every fifth row is compared: 10,609 pixels.
STEP = 5
# The number of paths of light for each compared pixel, in two halves.
PATHS = 128
TOLERANCE = 0.01


def stage_of(path: Path, light: LightSpec) -> Stage:
    """Return the stage of a scan in a light."""
    scene = renderer.suggest_scene(str(path), size=(SIDE, SIDE))
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
    return frame.radiance[::STEP, ::STEP, :3].astype(np.float64).reshape(-1, 3)


def traced(stage: Stage) -> Float64:
    """Return the linear radiance of compared pixels by paths, in two halves, float64 [2, n, 3]."""
    light = stage.scene.light
    assert light is not None
    layers = [TrueLayer(e.volume, e.optics, weight=e.spec.weight, clip=e.spec.clip) for e in stage.layers]
    tracer = PathTracer(layers, sources_of(light), num_threads=THREADS)
    pixels = np.arange(SIDE * SIDE).reshape(SIDE, SIDE)[::STEP, ::STEP].ravel()
    view = view_of(stage, FRAME)
    found = light_of_pixels(tracer, view, pixels, seed=(1,), standard_error=0.0, most_paths=PATHS)
    return found.halves[..., :3] * 2.0 ** solved(stage).stops


def solved(stage: Stage) -> SceneLight:
    """Return the light of a stage."""
    light = stage.groups[0].light
    assert light is not None
    return light


def shown(radiance: npt.ArrayLike) -> Float64:
    """Return sRGB colours, not rounded."""
    linear = np.maximum(np.asarray(radiance, np.float64), 0.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def main() -> None:
    data = parser_of(__doc__).parse_args().data
    heads = " | ".join(f"`cells: {cells}`: dB, brightness, s" for cells in CELLS)
    lines = [machine_line(), "", f"| scan | {heads} |", "|---" * (len(CELLS) + 1) + "|"]
    for name in SCANS:
        lines.append(f"| {Path(name).name.partition('.')[0]} | {' | '.join(measured(data / name))} |")
        print(lines[-1], flush=True)
        write_page(PAGE, lines)


def measured(path: Path) -> Iterator[str]:
    """Yield a cell for each grid of a scan: decibels, the ratio of brightness, and the seconds to find the light."""
    light, truth = LIGHT, np.zeros(0)
    for cells in CELLS:
        stage = stage_of(path, replace(light, cells=cells))
        if not truth.size:
            truth = traced(stage)
            light = replace(light, exposure=solved(stage).stops)
        picture = drawn(stage)
        errors = (shown(picture) - shown(truth[0])) * (shown(picture) - shown(truth[1]))
        decibels = -10 * np.log10(max(float(errors.mean()), 1e-12))
        yield f"{decibels:.1f}, {picture.mean() / truth.mean():.3f}, {stage.seconds['light']:.1f}"


if __name__ == "__main__":
    main()

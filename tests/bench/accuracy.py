"""How near frames come to the ray integral: `python tests/bench/accuracy.py SCENE [--volume FILE] [--every 10]`.

For frames of the scene's path at tolerance 0, and for its first frame at falling tolerances: PSNR over all pixels and
over those that the volume touches, before quantisation, against the integral (converged to about 1e-7 at a step of one
voxel; see renderer.integrator). Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
import numpy.typing as npt

from hsplat_cli.scene_file import load_scene
from renderer.camera_paths import make_view
from renderer.integrator import integrate
from renderer.octree import cut_pyramid
from renderer.pipeline import prepare
from renderer.projection import visible_order
from renderer.raster_gl import GLRasterizer
from renderer.splats import SplatBatch, make_splats
from renderer.transfer import make_transfer

TOLERANCES = (2.0, 1.0, 0.5, 0.2, 0.1, 0.05, 0.02, 0.01, 0.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--volume", type=Path)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--every", type=int, default=10)
    arguments = parser.parse_args()
    scene = load_scene(arguments.scene, volume=arguments.volume, overrides=arguments.set)
    stage = prepare(scene, clock=time.perf_counter, num_threads=2)
    transfer = make_transfer(scene.transfer_function, float(stage.volume.spacing.min()))

    with GLRasterizer() as rasterizer:

        def compare(splats: SplatBatch, frame: int, truth: npt.NDArray[np.float64]) -> tuple[float, float]:
            view = make_view(scene.camera, frame, stage.target, stage.distance, scene.output.size)
            order = visible_order(splats, cut, view, scene.splat.order)
            image = rasterizer.rasterize(splats, order, view)
            squares = np.mean((np.clip(image[..., :3], 0, 1) - np.clip(truth[..., :3], 0, 1)) ** 2, axis=-1)
            touched = (truth[..., 3] > 0) | (image[..., 3] > 0)
            return float(-10 * np.log10(squares.mean())), float(-10 * np.log10(squares[touched].mean()))

        def truth_of(frame: int) -> npt.NDArray[np.float64]:
            view = make_view(scene.camera, frame, stage.target, stage.distance, scene.output.size)
            return integrate(stage.volume, transfer, view, step_voxels=1.0, shading=scene.shading)

        print(f"{rasterizer.renderer_name}\n\n| tolerance | splats | PSNR | where the volume is |\n|---|---|---|---|")
        first = truth_of(0)
        for tolerance in TOLERANCES:
            cut = cut_pyramid(stage.pyramid, tolerance)
            splats = make_splats(cut, scene.splat)
            everywhere, touched = compare(splats, 0, first)
            print(f"| {tolerance:g} | {len(cut)} | {everywhere:.2f} dB | {touched:.2f} dB |", flush=True)
        print("\n| frame at tolerance 0 | PSNR | where the volume is |\n|---|---|---|")
        for frame in range(0, scene.camera.path.frames, arguments.every):
            everywhere, touched = compare(splats, frame, truth_of(frame))
            print(f"| {frame} | {everywhere:.2f} dB | {touched:.2f} dB |", flush=True)


if __name__ == "__main__":
    main()

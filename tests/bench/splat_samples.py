"""What do several samples of a pixel give splats? `python tests/bench/splat_samples.py DATA` writes the page of it.

Each footprint is drawn at several tolerances with one sample a pixel and with several, and compared with the means of
exact rays over many pixels. The page is build/benchmarks/splat_samples.md.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
from measuring import PAGES, SUBJECTS, THREADS, machine_line, parser_of, section, write_page

import renderer
from renderer.accuracy import ExactPixels, FrameProber, psnr
from renderer.draw import SplatRasterizer
from renderer.film import quantize
from renderer.frame import SplatLOD, Stage, make_primitive, prepare_stage, view_of
from renderer.scene import Scene, SplatSpec
from renderer.volume import Float32

PAGE = PAGES / "splat_samples.md"
SIDES = (256, 64)
FRAME = 7
TOLERANCES = (0.02, 0.1, 0.2, 0.5)
RAYS = 4096
# The samples along a pixel's side that are measured where the rule says one.
LEAST_ACROSS = 2
NAMES = (
    "engine, CT",
    "bonsai, CT",
    "head, CT, oblique",
    "head, CT, splats",
    "neghip, splats, not lit",
    "fuel, simulation, not lit",
)
FOOTPRINTS = {
    "gaussian": SplatSpec("gaussian"),
    "gaussian, sigma 0.7": SplatSpec("gaussian", sigma=0.7),
    "gouraud": SplatSpec("gouraud"),
}


def main() -> None:
    data = parser_of(__doc__).parse_args().data
    lines = [machine_line(), ""]
    columns = "volume | side | voxel, pixels | samples | " + " | ".join(f"{tolerance:g}" for tolerance in TOLERANCES)
    for footprint, spec in FOOTPRINTS.items():
        text = (
            "Decibels with one sample a pixel, with several, and the processor time of drawing by that of one sample."
        )
        lines += section(footprint, text, columns)
        for name, side in product(NAMES, SIDES):
            row = " | ".join([f"| {name} | {side}", *measured(scene_of(data, name, spec, side))]) + " |"
            print(footprint, row, flush=True)
            lines.append(row)
        lines.append("")
    write_page(PAGE, lines)


def scene_of(data: Path, name: str, splat: SplatSpec, side: int) -> Scene:
    """Return the suggested scene of a subject as splats, with the light that splats can have."""
    subject = SUBJECTS[name]
    scene = replace(renderer.suggest_scene(data / subject.file, size=(side, side)), splat=splat, clip=())
    shading = scene.layers[0].shading if subject.is_lit else None
    return scene.with_layers(shading=shading and replace(shading, specular=0.0))


def measured(scene: Scene) -> Iterator[str]:
    """Yield the cells of a scene's row."""
    with (
        prepare_stage(scene, clock=time.process_time, num_threads=THREADS, any_tolerance=True) as stage,
        SplatRasterizer() as rasterizer,
    ):
        yield f"{stage.resolutions[0].voxel_px:.2f}"
        across = max(LEAST_ACROSS, make_lod(stage, TOLERANCES[0]).batches[0].samples_across)
        yield f"{across} x {across}"
        exact: ExactPixels | None = None
        draw(rasterizer, stage, sampled(stage, TOLERANCES[-1], 1))  # compiles the program
        for tolerance in TOLERANCES:
            lods = [sampled(stage, tolerance, number) for number in (1, across)]
            begin = time.process_time()
            pictures = [draw(rasterizer, stage, lods[0])]
            half = time.process_time()
            pictures.append(draw(rasterizer, stage, lods[1]))
            times = (time.process_time() - half) / (half - begin)
            if exact is None:
                image = quantize(pictures[-1], scene.background, 8)
                exact = FrameProber(stage, RAYS, num_threads=THREADS).exact_pixels(FRAME, image)
            one, several = (psnr(exact.compare_radiance(picture).samples.mean) for picture in pictures)
            yield f"{one:.1f}, {several:.1f} dB, {times:.2f}"


def sampled(stage: Stage, tolerance: float, across: int) -> SplatLOD:
    """Return the splats at a tolerance, with some samples along a pixel's side, whatever the rule says."""
    lod = make_lod(stage, tolerance)
    return replace(lod, batches=[replace(batch, samples_across=across) for batch in lod.batches])


def make_lod(stage: Stage, tolerance: float) -> SplatLOD:
    """Return the splats at a tolerance."""
    lod = make_primitive(stage).make_lod(tolerance, lambda _: None)
    assert isinstance(lod, SplatLOD)
    return lod


def draw(rasterizer: SplatRasterizer, stage: Stage, lod: SplatLOD) -> Float32:
    """Draw a frame in all its orders."""
    view = view_of(stage, FRAME)
    pictures = [np.float32(share) * rasterizer.rasterize(lod.batches, order, view) for share, order in lod.orders(view)]
    return np.asarray(np.sum(pictures, axis=0), np.float32)


if __name__ == "__main__":
    main()

"""Many layers on one pixel, and layers behind others that hide almost everything."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from extremes import Extreme, Measure, Random, Section, worst_drawn, worst_of

from renderer.draw import SplatRasterizer
from renderer.scene import SplatSpec
from renderer.splats import GaussianFootprint, SplatBatch, make_footprint
from renderer.view import View
from renderer.volume import Float64

MIN_CHUNK_SPLATS = 4096

# A chunk of splats has about as many layers in the mean over the pixels under it, and at least so many splats.
MEAN_LAYERS = 256

U = 2.0**-24
FOOTPRINT = GaussianFootprint.from_sigma(0.425)
PEAK = FOOTPRINT.coefficients[0] - FOOTPRINT.rim


def pile(depths: Float64, colors: Float64, size: int) -> tuple[SplatBatch, View, Float64]:
    """Splats one behind the other [n], back to front, on the middle of a picture of `size`: the batch, its view, and
    the depths that they have at that pixel after rounding to float32.

    One pixel is a world unit and a standard deviation; the splats' centre is that of a pixel.
    """
    vertices = np.zeros((len(depths), 8), np.float32)
    vertices[:, :2] = 0.5
    vertices[:, 6] = depths / PEAK
    vertices[:, 3:6] = vertices[:, 6:7] * colors
    view = View(np.eye(3), np.zeros(3), 100.0, "orthographic", 1.0, (size, size))
    batch = SplatBatch(vertices, np.eye(3)[None], np.zeros(3), 1.0, FOOTPRINT)
    return batch, view, vertices[:, 6].astype(np.float64) * PEAK


def drawn(depths: Float64, colors: Float64, size: int = 16) -> tuple[Float64, Float64]:
    """RGBA of the pile's pixel as drawn, and as float64 has it."""
    batch, view, exact_depths = pile(depths, colors, size)
    with SplatRasterizer() as rasterizer:
        image = rasterizer.rasterize([batch], [np.arange(len(depths), dtype=np.uint32)], view)
    in_front = np.append(np.cumsum(exact_depths[::-1])[::-1][1:], 0.0)
    seen = -np.expm1(-exact_depths) * np.exp(-in_front)
    exact_colors = batch.vertices[:, 3:6].astype(np.float64) / batch.vertices[:, 6:7].astype(np.float64)
    return image[size // 2 - 1, size // 2].astype(np.float64), np.append(seen @ exact_colors, seen.sum())


def equal_layers(num: int, depth: float, size: int) -> float:
    """Largest error of a channel for `num` layers that add up to `depth`."""
    image, expected = drawn(np.full(num, depth / num), np.array([0.9, 0.5, 0.2]), size)
    assert math.isclose(expected[3], -math.expm1(-depth), rel_tol=1e-6)
    return float(np.abs(image - expected).max())


def bound(num: int) -> float:
    """6 u B, see renderer.draw.splats.compositing."""
    return 6 * U * min(num, MIN_CHUNK_SPLATS)


def depth_as_drawn(footprint: str) -> Measure:
    """The largest relative error of a splat's alpha, depths from 1e-12 to 1e6; also where the formula changes."""
    made = make_footprint(SplatSpec(footprint, profile=((0.0, 1.0), (1.0, 1.0))))  # type: ignore[arg-type]
    weight = PEAK if isinstance(made, GaussianFootprint) else float(made.weights[0])

    def error(gl: SplatRasterizer, rng: Random, case: int) -> float:
        depth = (0.03, 0.5)[case] if case < 2 else 10 ** rng.uniform(-12, 6) if case % 2 else rng.uniform(0.02, 1.0)
        batch, view, _ = pile(np.array([depth]), np.ones(3), 4)
        batch = replace(batch, footprint=made)
        alpha = float(gl.rasterize([batch], [np.zeros(1, np.uint32)], view)[1, 2, 3])
        return abs(alpha / -math.expm1(-float(batch.vertices[0, 6]) * weight) - 1)

    return lambda cases: worst_drawn(error)(2 * cases)


def thin_behind_opaque(rng: Random, _: int) -> float:
    """The error of a channel: a bright layer of depth up to 1 behind one with a transmittance of 1e-6."""
    depths = np.array([10 ** rng.uniform(-6, 0), -math.log(1e-6)])
    image, expected = drawn(depths, np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]]))
    return float(np.abs(image - expected).max())


def random_stack(rng: Random, _: int) -> float:
    """The error of a channel against its bound 6 u B: layers of any depth and colour."""
    num = int(10 ** rng.uniform(0, 4.5))
    depths = 10 ** rng.uniform(-9, 1, num) / num
    image, expected = drawn(depths, rng.uniform(0, 1, (num, 3)))
    return float(np.abs(image - expected).max()) / bound(num)


def layers_row(exponent: int) -> Extreme:
    num = 10**exponent
    pictures = ((1.0, 512),) if exponent == 6 else ((1.0, 512), (0.01, 16), (1.0, 16), (100.0, 16))
    return Extreme(
        f"1e{exponent} equal thin layers",
        "blended in float32 by chunks, chunks in float64",
        "error of a channel; depths in all, and sides of the picture: "
        + ", ".join(f"{depth:g} on {size}" for depth, size in pictures),
        bound(num),
        lambda _: max(equal_layers(num, depth, size) for depth, size in pictures),
    )


SECTION = Section(
    "Compositing",
    (
        Extreme("optical depths from 1e-12 to 1e6, Gaussian", "a polynomial below 1/2, `1 - exp(-x)` above",
            "relative error of alpha as drawn", 1e-6, depth_as_drawn("gaussian")),
        Extreme("optical depths from 1e-12 to 1e6, Gouraud", "the same, at the vertices",
            "relative error of alpha as drawn", 1e-6, depth_as_drawn("gouraud")),
        *(layers_row(exponent) for exponent in range(1, 7)),
        Extreme("a bright layer behind a transmittance of 1e-6",
            "premultiplied float32; the error is that of 1 - alpha", "error of a channel", 2 * U,
            worst_of(thin_behind_opaque)),
        Extreme("random stacks of up to 3e4 layers", "as above", "error of a channel, in units of 6 u B", 1.0,
            worst_of(random_stack)),
    ),
    "A pixel on which at most B splats of a chunk lie, and whose alpha is A, is right within `6 u B A`; a chunk has "
        f"{MEAN_LAYERS} layers in the mean over the pixels under the object, and at least {MIN_CHUNK_SPLATS} splats. "
        "Blended in one go, 1e6 layers of depth 1 in all had an alpha of 0.6342 in place of 0.6321, and a colour wrong "
        "by 7e-3.",
)  # fmt: skip


@pytest.mark.parametrize("extreme", SECTION.extremes, ids=str)
def test_compositing(extreme: Extreme) -> None:
    extreme.check()

"""Figure 3: draw one splat that stands for a cube of 1, 2, 4, ... voxels a side."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from figure import Claim, FigureRenderer, PaperFigure, PictureRows

from hsplat_cli.reports import SERIES, Axis, Chart, Curve, Tick, linear_axis
from renderer.film import Pixels
from renderer.frame import Frame
from renderer.scene import MAX_LEVEL, ProceduralSource, Scene

# Above this alpha, float32 and the footprint's ripple hide the optical depth.
SATURATED_ALPHA = 0.9999

SIDES = (1, 2, 4, 8, 16, 32)
# Share of an optical depth: ten times the error of float16 in the pyramid and float32 in the picture.
AGREEMENT_TOLERANCE = 0.005
# Share of the whole picture's optical depth: footprints are cut off at 0.2 %, and pixels sample them.
TOTAL_TOLERANCE = 0.01


@dataclass(frozen=True)
class SplatSeries:
    """One splat for each of SIDES, in a cube of constant size; alphas are those in the middle of the picture.

    opacity: of a voxel. totals: the corrected splat's optical depth, summed over the picture, relative to that of its
    voxels drawn one by one.
    """

    opacity: float
    corrected: tuple[float, ...]
    uncorrected: tuple[float, ...]
    totals: tuple[float, ...]
    rows: PictureRows

    def depth_ratios(self, alphas: tuple[float, ...]) -> tuple[float, ...]:
        """Return the optical depth of each splat, relative to that of the splat of one voxel."""
        return tuple(math.log1p(-alpha) / math.log1p(-alphas[0]) for alpha in alphas)


def make_figure(scene: Scene, figure_renderer: FigureRenderer) -> PaperFigure:
    """Return figure 3 for a scene of a cube of one material."""
    splats = measure(scene, figure_renderer)
    return PaperFigure(
        "One splat at resolutions that are powers of two",
        "A cube of one material, always of the same size in the picture and always one splat, stands for 1 to "
        f"{SIDES[-1]} voxels a side, each of opacity {splats.opacity:g}.",
        check_claims(splats),
        splats.rows,
        charts=(_chart(splats),),
    )


def measure(scene: Scene, figure_renderer: FigureRenderer) -> SplatSeries:
    """Draw the splat for each number of voxels, with and without correction."""
    source = scene.layers[0].volume.source
    assert isinstance(source, ProceduralSource)
    length = source.shape[0] * source.spacing[0]
    rows: dict[str, list[tuple[Pixels, str]]] = {"With correction": [], "Without": [], "The voxels themselves": []}
    corrected, uncorrected, totals, opacity = [], [], [], 0.0
    for side in SIDES:
        cube = replace(source, shape=(side, side, side), spacing=(length / side, length / side, length / side))
        volume = replace(scene.layers[0].volume, source=cube)
        with figure_renderer.open_stage(scene.with_layers(volume=volume)) as stage:
            opacity = -math.expm1(-stage.extinction * cube.spacing[0])
            splat, without = (
                stage.draw(finest_level=MAX_LEVEL, opacity_correction=is_corrected) for is_corrected in (True, False)
            )
            voxels = stage.draw(finest_level=0, tolerance=0.0, opacity_correction=True)
        assert splat.num_primitives == 1
        assert all(frame.radiance[..., 3].max() < SATURATED_ALPHA for frame in (splat, without, voxels))
        corrected.append(_middle(splat))
        uncorrected.append(_middle(without))
        totals.append(_total_depth(splat) / _total_depth(voxels))
        for row, frame in zip(rows.values(), (splat, without, voxels), strict=True):
            row.append((frame.image, f"{side}^3 voxels: alpha {_middle(frame):.3f}"))
    return SplatSeries(opacity, tuple(corrected), tuple(uncorrected), tuple(totals), rows)


def check_claims(splats: SplatSeries) -> tuple[Claim, ...]:
    """Compare the numbers with the paper's claims."""
    corrected, uncorrected = splats.depth_ratios(splats.corrected), splats.depth_ratios(splats.uncorrected)
    off = max(abs(ratio / side - 1) for ratio, side in zip(corrected, SIDES, strict=True))
    change = max(abs(ratio - 1) for ratio in uncorrected)
    return (
        Claim(
            "Each time the side of a cell doubles, the transparency of its splat is squared: 1 - a_2 = (1 - a_1)^2.",
            f"for n voxels in depth, 1 - alpha is (1 - alpha of one voxel)^n, "
            f"within {AGREEMENT_TOLERANCE:.1%} of the exponent",
            f"exponents {', '.join(f'{ratio:.3f}' for ratio in corrected)}; at most {off:.2%} off",
            off < AGREEMENT_TOLERANCE,
        ),
        Claim(
            "Without the correction a splat is as faint for a large block of voxels as for a single one.",
            f"alpha is the same for all numbers of voxels, within {AGREEMENT_TOLERANCE:.1%} of the optical depth",
            f"alpha from {min(splats.uncorrected):.4f} to {max(splats.uncorrected):.4f}; at most {change:.2%} off",
            change < AGREEMENT_TOLERANCE,
        ),
        Claim(
            "One splat can stand for a whole block of voxels: it contributes as much to the picture as they do.",
            "the optical depth of the whole picture equals that of the voxels drawn one by one, within "
            f"{TOTAL_TOLERANCE:.0%}",
            f"{', '.join(f'{total:.4f}' for total in splats.totals)} times as much",
            all(abs(total - 1) < TOTAL_TOLERANCE for total in splats.totals),
        ),
    )


def _middle(frame: Frame) -> float:
    height, width = frame.image.shape[:2]
    return float(frame.radiance[height // 2, width // 2, 3])


def _total_depth(frame: Frame) -> float:
    """Return the optical depth summed over all pixels."""
    return float(-np.log1p(-frame.radiance[..., 3].astype(np.float64)).sum())


def _chart(splats: SplatSeries) -> Chart:
    across = [math.log2(side) for side in SIDES]
    expected = [-math.expm1(side * math.log1p(-splats.corrected[0])) for side in SIDES]
    rows = (expected, splats.corrected, splats.uncorrected)
    line, corrected, uncorrected = (list(zip(across, alphas, strict=True)) for alphas in rows)
    ticks = [Tick(at, str(side)) for at, side in zip(across, SIDES, strict=True)]
    return Chart(
        Axis("voxels a side", -0.3, across[-1] + 0.3, ticks),
        linear_axis("alpha in the middle", [alpha for row in rows for alpha in row]),
        [
            Curve("1 - (1 - alpha of one voxel)^n", line, SERIES[0]),
            Curve("with correction", corrected, SERIES[0], "circle", dash=""),
            Curve("without", uncorrected, SERIES[1], "cross", dash=""),
        ],
        "Alpha over the number of voxels.",
        "Alpha over the number of voxels, with and without correction",
    )

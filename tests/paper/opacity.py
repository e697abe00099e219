"""Figure 2: measure the opacity of a cell over the opacity of its voxels and its level."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from figure import Claim, FigureRenderer, FigureStage, PaperFigure, PictureRows
from one_splat import SATURATED_ALPHA

from hsplat_cli.reports import SERIES, Chart, Curve, linear_axis
from renderer.film import Pixels
from renderer.frame import view_of
from renderer.scene import ProceduralSource, Scene
from renderer.volume import Float64

OPACITIES = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8)
# Shown as a picture.
SHOWN_OPACITY = 0.05
# In alpha. A grid of splats ripples by up to 1.1 % of the optical depth, at most 0.004 in alpha.
AGREEMENT_TOLERANCE = 0.005
# In alpha, between level 0 and the coarsest: visible at a glance.
MIN_VISIBLE_LOSS = 0.1


@dataclass(frozen=True)
class Slab:
    """A slab of one material: its alpha, drawn with cells of each level; float64 [num_opacities, num_levels].

    depth: of the slab in voxels, a power of two: one cell of the last level is as thick as the slab.
    rows: pictures of the slab at SHOWN_OPACITY.
    """

    depth: int
    corrected: Float64
    uncorrected: Float64
    rows: PictureRows

    @property
    def cells_in_depth(self) -> Float64:
        """Return the number of cells in depth, from the voxels to the level as thick as the slab."""
        return np.asarray(self.depth / 2.0 ** np.arange(self.depth.bit_length()))

    def expected(self, *, corrected: bool) -> Float64:
        """Return the closed form: `1 - (1 - a)^depth`, or `1 - (1 - a)^(cells in depth)` without correction."""
        exponents = np.full_like(self.cells_in_depth, self.depth) if corrected else self.cells_in_depth
        return np.asarray(-np.expm1(np.log1p(-np.array(OPACITIES))[:, None] * exponents))

    def cell_opacity(self, alphas: Float64) -> Float64:
        """Return the opacity of one cell of each level from the slab's alphas; NaN where alpha is saturated."""
        depths = -np.log1p(-np.where(alphas < SATURATED_ALPHA, alphas, np.nan))
        return np.asarray(-np.expm1(-depths / self.cells_in_depth))


def make_figure(scene: Scene, figure_renderer: FigureRenderer) -> PaperFigure:
    """Return figure 2 for a scene of a slab seen along its depth, y."""
    slab = measure(scene, figure_renderer)
    return PaperFigure(
        "Opacity correction by opacity and resolution",
        f"A slab of one material, {slab.depth} voxels deep, drawn with cells of 1 to {slab.depth} voxels a side. All "
        "numbers are alphas of drawn pixels, the mean over the middle of the picture.",
        check_claims(slab),
        slab.rows,
        charts=(_chart(slab),),
        tables={
            "With correction: alpha of the slab": _table_lines(slab, slab.corrected, corrected=True),
            "Without correction: alpha of the slab": _table_lines(slab, slab.uncorrected, corrected=False),
        },
    )


def measure(scene: Scene, figure_renderer: FigureRenderer) -> Slab:
    """Draw the slab with each opacity of its voxels and each level of its cells."""
    source, points = scene.layers[0].volume.source, scene.layers[0].transfer_function.mapping
    assert isinstance(source, ProceduralSource) and isinstance(points, tuple)
    depth = source.shape[1]
    alphas = np.empty((2, len(OPACITIES), depth.bit_length()))
    rows: dict[str, list[tuple[Pixels, str]]] = {}
    for i, opacity in enumerate(OPACITIES):
        mapping = tuple(replace(point, opacity=opacity) for point in points)
        one = scene.with_layers(transfer_function=replace(scene.layers[0].transfer_function, mapping=mapping))
        with figure_renderer.open_stage(one) as stage:
            middle = _middle(stage, depth)
            for k, word in enumerate(("with", "without")):
                frames = stage.draw_levels(depth.bit_length(), opacity_correction=word == "with")
                alphas[k, i] = [frame.radiance[..., 3][middle].mean(dtype=np.float64) for frame in frames]
                if opacity == SHOWN_OPACITY:
                    rows[f"Voxels of opacity {SHOWN_OPACITY:g}, {word} correction"] = [
                        (frame.image, f"level {level}: alpha {alphas[k, i, level]:.3f}")
                        for level, frame in enumerate(frames)
                    ]
    return Slab(depth, alphas[0], alphas[1], rows)


def check_claims(slab: Slab) -> tuple[Claim, ...]:
    """Compare the numbers with the paper's claims."""
    off = np.abs(slab.corrected - slab.expected(corrected=True)).max()
    off_without = np.abs(slab.uncorrected - slab.expected(corrected=False)).max()
    loss = slab.uncorrected[:, 0] - slab.uncorrected[:, -1]
    half = int(np.argmax(loss))
    return (
        Claim(
            "A cell that stands for 2^k voxels in depth needs the opacity 1 - (1 - a)^(2^k); then a column is equally "
            "opaque at every resolution.",
            f"at every opacity and level alpha agrees with the closed form within {AGREEMENT_TOLERANCE:g}",
            f"at most {off:.4f} off",
            bool(off < AGREEMENT_TOLERANCE),
        ),
        Claim(
            "Cells that keep the opacity of a voxel make coarse pictures too transparent.",
            f"alpha agrees with the closed form for too few voxels within {AGREEMENT_TOLERANCE:g}, and falls by more "
            f"than {MIN_VISIBLE_LOSS:g} from level 0 to level {len(slab.cells_in_depth) - 1} at some opacity",
            f"at most {off_without:.4f} off; at a = {OPACITIES[half]:g} alpha falls from "
            f"{slab.uncorrected[half, 0]:.3f} to {slab.uncorrected[half, -1]:.3f}",
            bool(off_without < AGREEMENT_TOLERANCE and loss[half] > MIN_VISIBLE_LOSS),
        ),
    )


def _middle(stage: FigureStage, depth: int) -> tuple[slice, slice]:
    """Return rows and columns of the picture's middle, as wide as a cell of the last level.

    It holds whole periods of the ripple at every level, and no footprint of the border reaches it: a footprint ends 1.4
    cells from its centre. Voxels are larger than pixels, which would else all sample the ripple at one point of its
    period.
    """
    view = view_of(stage.base, 0)
    width, height = view.size
    half = round(depth * view.scale_px * stage.base.layers[0].volume.finest_spacing / 2)
    row, column = height // 2, width // 2
    return slice(row - half, row + half), slice(column - half, column + half)


def _table_lines(slab: Slab, alphas: Float64, *, corrected: bool) -> list[dict[str, str]]:
    off = np.abs(alphas - slab.expected(corrected=corrected)).max(axis=1)
    return [
        {
            "opacity of a voxel": f"{opacity:g}",
            **{f"level {level}": f"{alpha:.4f}" for level, alpha in enumerate(row)},
            "largest error against the closed form": f"{worst:.4f}",
        }
        for opacity, row, worst in zip(OPACITIES, alphas, off, strict=True)
    ]


def _chart(slab: Slab) -> Chart:
    fine = np.linspace(0, 0.999, 200)
    with_correction, without = slab.cell_opacity(slab.corrected), slab.cell_opacity(slab.uncorrected)
    curves = []
    for level in range(len(slab.cells_in_depth)):
        color = SERIES[level % len(SERIES)]
        line = zip(fine.tolist(), (-np.expm1(2**level * np.log1p(-fine))).tolist(), strict=True)
        curves.append(Curve(f"level {level}", list(line), color, width=1))
        for alphas, marker in ((with_correction, "circle"), (without, "cross")):
            points = zip(OPACITIES, alphas[:, level].tolist(), strict=True)
            curves.append(Curve("", [point for point in points if np.isfinite(point[1])], color, marker, dash=""))
    return Chart(
        linear_axis("opacity of a voxel", [0, 1]),
        linear_axis("opacity of a cell", [0, 1]),
        curves,
        "Opacity of one cell over that of its voxels: drawn with correction (dots), without (crosses), and "
        "1 - (1 - a)^(2^k) (lines).",
        "Opacity of one cell over that of its voxels, by level, with and without correction",
    )

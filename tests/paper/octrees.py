"""Figure 5: draw octrees at falling error, with their cells as lines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from figure import Claim, FigureRenderer, FigureStage, PaperFigure, PictureRows

from renderer.accuracy import compute_metric
from renderer.film import quantize
from renderer.frame import finest_level_at
from renderer.pyramid import Cut, cut_pyramid
from renderer.scene import AnnotationSpec, Scene, counted
from renderer.volume import Float64

# Multiples of the scene's tolerance.
TOLERANCE_FACTORS = (8.0, 4.0, 1.0, 0.25)
# Cells are counted in blocks of 2^BLOCK_LEVEL voxels a side.
BLOCK_LEVEL = 4
# A cut with fewer cells is hardly refined anywhere.
MIN_CELLS = 100
# The quarter of the blocks with the largest variation has at least this many times the cells of that with the smallest.
MIN_CELL_RATIO = 4.0


@dataclass(frozen=True)
class Octree:
    """One cut. cells_by_level: from level 0 to the root.

    cells_low_variation, cells_high_variation: mean number of cells in a block, over the quarter of the visible blocks
    whose opacity varies least and most. A cell that covers n blocks counts as 1/n in each.
    """

    tolerance: float
    cells_by_level: tuple[int, ...]
    psnr_db: float
    cells_low_variation: float
    cells_high_variation: float

    @property
    def num_cells(self) -> int:
        """Return the number of cells of all levels."""
        return sum(self.cells_by_level)

    @property
    def cell_ratio(self) -> float:
        """Return the ratio of the cells at high variation to those at low variation; 0 if both are 0."""
        return self.cells_high_variation / max(self.cells_low_variation, 1e-9)


def make_figure(scene: Scene, figure_renderer: FigureRenderer) -> PaperFigure:
    """Return figure 5."""
    octrees, rows = measure(scene, figure_renderer)
    side = 1 << BLOCK_LEVEL
    return PaperFigure(
        "Octrees at falling error",
        "Octrees fitted to the pyramid as the tolerated error falls, with and without their cells as lines. Orange "
        "cells are single voxels; redder, then bluer cells are larger. Small cells have fainter lines.",
        check_claims(octrees),
        rows,
        tables={
            "Cells by level": [
                {
                    "tolerance": f"{octree.tolerance:g}",
                    **{f"level {level}": f"{num}" for level, num in enumerate(octree.cells_by_level)},
                    "all": f"{octree.num_cells}",
                    "PSNR, dB": f"{octree.psnr_db:.2f}",
                    "low variation": f"{octree.cells_low_variation:.2f}",
                    "high variation": f"{octree.cells_high_variation:.1f}",
                    "ratio": f"{octree.cell_ratio:.1f}",
                }
                for octree in octrees
            ]
        },
        notes=(
            f"Low and high variation: the first and last quarter of the visible blocks of {side} x {side} x {side} "
            "voxels, ordered by the standard deviation of their voxels' opacity.",
        ),
    )


def measure(scene: Scene, figure_renderer: FigureRenderer) -> tuple[list[Octree], PictureRows]:
    """Cut at each tolerance, from coarse to fine, draw with and without lines, and compare with the ray integral."""
    base = float(scene.error.tolerance)
    octrees, plain, overlaid = [], [], []
    with figure_renderer.open_stage(scene) as stage:
        truth = stage.truth()
        variation = _variation_of_blocks(stage)
        visible = np.flatnonzero(variation >= 0)
        blocks_by_variation = visible[np.argsort(variation.reshape(-1)[visible], kind="stable")]
        quarter = max(1, len(blocks_by_variation) // 4)
        for tolerance in (factor * base for factor in TOLERANCE_FACTORS):
            plain_frame, overlaid_frame = (
                stage.draw(tolerance=tolerance, annotation=AnnotationSpec(octree=octree)) for octree in (False, True)
            )
            finest_level = finest_level_at(stage.base, tolerance)
            cut = cut_pyramid(stage.base.layers[0].pyramid, tolerance, finest_level=finest_level)
            cells_per_block = _cells_in_blocks(cut, variation.shape).reshape(-1)
            octree = Octree(
                tolerance,
                tuple(np.bincount(cut.levels, minlength=stage.base.layers[0].pyramid.num_levels + 1).tolist()),
                compute_metric("psnr", stage.rgb(plain_frame), truth),
                float(cells_per_block[blocks_by_variation[:quarter]].mean()),
                float(cells_per_block[blocks_by_variation[-quarter:]].mean()),
            )
            octrees.append(octree)
            with_lines = quantize(overlaid_frame.radiance_with_lines(), scene.background)
            overlaid.append((with_lines, f"tolerance {tolerance:g}: {counted(len(cut), 'cell')}"))
            plain.append((plain_frame.image, f"{octree.psnr_db:.1f} dB"))
    return octrees, {"The cells": overlaid, "The pictures, against the ray integral": plain}


def check_claims(octrees: Sequence[Octree]) -> tuple[Claim, ...]:
    """Compare octrees of falling tolerance with the paper's claims."""
    is_finer = all(after.num_cells > before.num_cells for before, after in pairwise(octrees))
    is_better = all(after.psnr_db > before.psnr_db for before, after in pairwise(octrees))
    refined = [octree for octree in octrees if octree.num_cells >= MIN_CELLS]
    return (
        Claim(
            "As the tolerated error falls, the octree gets more cells and the picture approaches the exact one.",
            "cells and PSNR against the ray integral rise with every step",
            ", ".join(f"{counted(octree.num_cells, 'cell')} {octree.psnr_db:.1f} dB" for octree in octrees),
            is_finer and is_better,
        ),
        Claim(
            "The octree is refined where the data vary, and stays coarse where they do not.",
            f"in every octree of {MIN_CELLS} cells or more, the quarter of the blocks with the highest variation has "
            f"at least {MIN_CELL_RATIO:g} times as many cells as that with the lowest",
            ", ".join(f"{counted(octree.num_cells, 'cell')} {octree.cell_ratio:.1f} times" for octree in octrees),
            bool(refined) and all(octree.cell_ratio >= MIN_CELL_RATIO for octree in refined),
        ),
    )


def _variation_of_blocks(stage: FigureStage) -> Float64:
    """Return float64 [z, y, x]: the standard deviation of each block's opacities, -1 where nothing is visible."""
    volume, transfer, side = stage.base.layers[0].volume, stage.transfer, 1 << BLOCK_LEVEL
    spacing = volume.finest_spacing
    shape = tuple(-(-num // side) for num in volume.values.shape)
    variation = np.full(shape, -1.0)
    for z in range(shape[0]):  # a slab of blocks at a time bounds the float64 temporaries
        extinctions = transfer.classify(volume.values[z * side : (z + 1) * side])[1]
        opacity = -np.expm1(-spacing * np.nan_to_num(extinctions))  # 0 without data
        for y, x in np.ndindex(shape[1:]):
            block = opacity[:, y * side : (y + 1) * side, x * side : (x + 1) * side]
            if block.any():
                variation[z, y, x] = block.std()
    return variation


def _cells_in_blocks(cut: Cut, shape: tuple[int, ...]) -> Float64:
    """Return float64 [z, y, x]: the number of cells in each block; a cell that covers n blocks counts as 1/n."""
    counts = np.zeros(shape)
    for level in np.unique(cut.levels).tolist():
        cells = cut.cells[cut.levels == level][:, ::-1]
        if level <= BLOCK_LEVEL:
            np.add.at(counts, tuple((cells >> (BLOCK_LEVEL - level)).T), 1)
            continue
        side = 1 << (level - BLOCK_LEVEL)
        for cell in cells:
            covered = counts[tuple(slice(side * place, side * (place + 1)) for place in cell.tolist())]
            covered += 1 / covered.size
    return counts

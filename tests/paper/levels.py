"""Figure 4: draw a volume of one material with the cells of each level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from figure import Claim, FigureRenderer, FigureStage, PaperFigure, PictureRows

from renderer.frame import view_of
from renderer.scene import Scene, counted
from renderer.truth import RayIntegrator, TrueLayer, pixel_centres
from renderer.volume import Bools

# Pixels with at least this share of the largest optical depth are the inside of the volume.
INSIDE_SHARE = 0.5
# Claims are checked on levels with at least this many cells along the shortest side. Coarser levels are mostly border,
# which footprints blur over the width of a cell whatever the opacity.
MIN_CELLS = 4
# In alpha, for the mean over the inside.
AGREEMENT_TOLERANCE = 0.03
# Without correction, the error of the coarsest checked level is at least this many times that with correction.
MIN_ERROR_RATIO = 5.0


@dataclass(frozen=True)
class LevelError:
    """An error of a level's picture against that of level 0, in RGB over the background.

    mean_alpha, rmse, largest: over the inside.
    """

    level: int
    num_cells: int
    mean_alpha: float
    rmse: float
    largest: float


def make_figure(scene: Scene, figure_renderer: FigureRenderer) -> PaperFigure:
    """Return figure 4 for a scene of a volume of one material."""
    corrected, uncorrected, num_judged, rows = measure(scene, figure_renderer)
    return PaperFigure(
        "A constant volume drawn at each level",
        "The same block of one material, with cells from one voxel (level 0) to a single cell (the root). Numbers are "
        f"for the inside: rays with at least {INSIDE_SHARE:.0%} of the largest optical depth.",
        check_claims(corrected[:num_judged], uncorrected[:num_judged]),
        rows,
        tables={
            "With correction, against level 0": _table_lines(corrected),
            "Without correction, against level 0": _table_lines(uncorrected),
        },
        notes=(
            f"Claims are checked on levels 0 to {num_judged - 1}, with {MIN_CELLS} cells or more along "
            "the shortest side. Coarser levels are mostly border, blurred over the width of a cell.",
        ),
    )


def measure(
    scene: Scene, figure_renderer: FigureRenderer
) -> tuple[list[LevelError], list[LevelError], int, PictureRows]:
    """Draw each level with and without correction.

    Return the errors with and without, from level 0 to the root; the number of levels with MIN_CELLS cells or more
    along the shortest side, on which claims are checked; and the pictures.
    """
    errors, rows = [], {}
    with figure_renderer.open_stage(scene) as stage:
        inside, (layer,) = _inside(stage), stage.base.layers
        volume, num_levels = layer.volume, layer.pyramid.num_levels + 1
        for title, is_corrected in (("With correction", True), ("Without correction", False)):
            frames = stage.draw_levels(num_levels, opacity_correction=is_corrected)
            pictures = [stage.rgb(frame)[inside] for frame in frames]
            differences = [picture - pictures[0] for picture in pictures]
            nums, alphas = [frame.num_cells for frame in frames], [frame.radiance[..., 3][inside] for frame in frames]
            means = [float(alpha.mean(dtype=np.float64)) for alpha in alphas]
            rms = [float(np.sqrt(np.mean(difference**2))) for difference in differences]
            largest = [float(np.abs(difference).max()) for difference in differences]
            errors.append([*map(LevelError, range(num_levels), nums, means, rms, largest)])
            captions = [f"level {error.level}: {counted(error.num_cells, 'cell')}" for error in errors[-1]]
            rows[title] = [(frame.image, caption) for frame, caption in zip(frames, captions, strict=True)]
    num_judged = (min(volume.shape_xyz) // MIN_CELLS).bit_length()
    return errors[0], errors[1], num_judged, rows


def _inside(stage: FigureStage) -> Bools:
    """Return the pixels of the inside."""
    view, integrator = view_of(stage.base, 0), RayIntegrator([TrueLayer(stage.base.layers[0].volume, stage.transfer)])
    alpha = integrator.integrate(view, pixel_centres(view.size), [1.0])[0, :, 3].reshape(view.size[::-1])
    optical_depth = -np.log1p(-np.minimum(alpha, 1 - 1e-12))
    return np.asarray(optical_depth >= INSIDE_SHARE * optical_depth.max())


def check_claims(corrected: Sequence[LevelError], uncorrected: Sequence[LevelError]) -> tuple[Claim, ...]:
    """Compare the errors with the paper's claims."""
    off = max(abs(error.mean_alpha - corrected[0].mean_alpha) for error in corrected)
    faded = [error.mean_alpha for error in uncorrected]
    coarsest, coarsest_without = corrected[-1], uncorrected[-1]
    times = coarsest_without.rmse / max(coarsest.rmse, 1e-12)
    return (
        Claim(
            "With opacity correction a constant volume looks the same at every level of the pyramid.",
            f"the mean alpha of the inside agrees with that of level 0 within {AGREEMENT_TOLERANCE:g}, "
            f"at levels 0 to {coarsest.level}",
            f"at most {off:.4f} off (level 0: {corrected[0].mean_alpha:.4f}); RGB differs by {coarsest.rmse:.4f} "
            f"(RMS) at level {coarsest.level}",
            off < AGREEMENT_TOLERANCE,
        ),
        Claim(
            "Without it, the volume fades as the level rises.",
            f"the mean alpha of the inside falls from level to level, and level {coarsest.level} is at least "
            f"{MIN_ERROR_RATIO:g} times as far from level 0 as with correction",
            f"mean alphas {', '.join(f'{alpha:.3f}' for alpha in faded)}; at level "
            f"{coarsest.level} RGB differs by {coarsest_without.rmse:.4f} (RMS), {times:.1f} times as much as with "
            "correction",
            bool(np.all(np.diff(faded) < 0) and times >= MIN_ERROR_RATIO),
        ),
    )


def _table_lines(errors: Sequence[LevelError]) -> list[dict[str, str]]:
    return [
        {
            "level": f"{error.level}",
            "cells": f"{error.num_cells}",
            "mean alpha inside": f"{error.mean_alpha:.4f}",
            "error against level 0": f"{error.mean_alpha - errors[0].mean_alpha:+.4f}",
            "RMSE inside": f"{error.rmse:.4f}",
            "largest inside": f"{error.largest:.4f}",
        }
        for error in errors
    ]

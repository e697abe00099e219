"""`overlay: octree` and `error.finest_level` on their way through the pipeline."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from renderer.draw import CellEdges
from renderer.frame import Frame, Stage, finest_level_at, prepare_stage, render_frames
from renderer.scene import (
    CameraSpec,
    ControlPoint,
    ErrorSpec,
    OutputSpec,
    ProceduralSource,
    Scene,
    SplatSpec,
    TransferSpec,
    TurntablePath,
    VolumeSpec,
)
from renderer.splats import SplatBatch
from renderer.view import View
from tests.support.machines import NothingLasting

SCENE = Scene(
    volume=VolumeSpec(ProceduralSource("constant", (20, 16, 9))),
    transfer_function=TransferSpec((ControlPoint(0, (1.0, 0.5, 0.0), 0.1),)),
    camera=CameraSpec(TurntablePath(2)),
    output=OutputSpec(Path("{frame}.png"), (8, 8)),
    splat=SplatSpec("gaussian"),
)


class Splats(NothingLasting):
    """Draws every pixel half opaque, and no lines."""

    def rasterize(self, batch: SplatBatch, order: npt.NDArray[np.uint32], view: View) -> npt.NDArray[np.float32]:
        return np.full((8, 8, 4), 0.5, np.float32)

    def rasterize_edges(self, edges: CellEdges, view: View) -> npt.NDArray[np.float32]:
        raise AssertionError("not asked for")


class Lines(Splats):
    """Lines of one colour on the left half, a quarter opaque."""

    def rasterize_edges(self, edges: CellEdges, view: View) -> npt.NDArray[np.float32]:
        image = np.zeros((8, 8, 4), np.float32)
        image[:, :4] = (0.25, 0, 0, 0.25)
        return image


def stage_of(scene: Scene) -> Stage:
    return prepare_stage(scene, clock=itertools.count().__next__, num_threads=1)


def first_frame(scene: Scene, rasterizer: Splats) -> Frame:
    return next(render_frames(stage_of(scene), [0], rasterizer, clock=itertools.count().__next__))


def test_lines_lie_over_the_picture_and_are_a_stage_of_their_own() -> None:
    plain, overlaid = first_frame(SCENE, Splats()), first_frame(replace(SCENE, overlay="octree"), Lines())
    assert "overlay" not in plain.seconds
    assert "overlay" in overlaid.seconds
    assert overlaid.radiance[0, 0].tolist() == [0.25 + 0.75 * 0.5, 0.375, 0.375, 0.25 + 0.75 * 0.5]
    assert overlaid.radiance[:, 4:].tolist() == plain.radiance[:, 4:].tolist()


@pytest.mark.parametrize(("level", "num_cells"), [(0, 20 * 16 * 9), (1, 10 * 8 * 5), (3, 3 * 2 * 2), (5, 1), (30, 1)])
def test_no_cell_is_finer_than_asked_for(level: int, num_cells: int) -> None:
    """At tolerance 0 all cells are as small as they may be; beyond the root, level 5 here, there is the root."""
    scene = replace(SCENE, error=ErrorSpec(((0, 0.0),), finest_level=level))
    assert first_frame(scene, Splats()).num_cells == num_cells
    assert finest_level_at(stage_of(scene), 0.0) == level

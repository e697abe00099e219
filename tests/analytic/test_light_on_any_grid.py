"""Pictures of matter that scatters light against Monte Carlo: grids, layers, labels, masks and cuts of any kind."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from stage_pictures import NUMBER, drawn
from test_scattered_light import CLEAR, blobs, points, scene_of, stage_of, volume

from renderer.frame import Stage, view_of
from renderer.layers import mask_volume
from renderer.lighting import sources_of
from renderer.truth import PathTracer, TrueLayer, light_of_pixels
from renderer.volume import Float64, Volume, make_volume

OUTDOOR = {"environment": "outdoor", "key": {"direction": [1, -1, 1], "strength": 2}, "exposure": -1}
UNEVEN = np.diag([1.0, 1.0, 10.0, 1.0])
SHEARED = np.array([[1, 0.5, 0.2, 0], [0, 1.2, -0.3, 0], [0.1, 0, 0.8, 0], [0, 0, 0, 1.0]])
FAR = np.eye(4) + np.outer([0, 0, 1.0, 0], [0, 0, 0, 200.0])
FINE = np.diag([0.25, 0.25, 0.25, 1.0])
OPAQUE, GLASS = {"transfer_function": points("#c08040")}, {"transfer_function": points("white", CLEAR)}


def against_paths(stage: Stage, most_paths: int = 64) -> tuple[float, float]:
    """Return the relative error of a picture against Monte Carlo without its noise, and the ratio of brightness."""
    radiance, light = drawn(stage).reshape(-1, 4)[:, :3], stage.groups[0].light
    assert stage.scene.light is not None and light is not None
    layers = [TrueLayer(each.volume, each.optics, weight=each.spec.weight) for each in stage.layers]
    tracer, pixels = PathTracer(layers, sources_of(stage.scene.light)), np.arange(len(radiance))
    view = view_of(stage, NUMBER).clipped(stage.scene.clip)
    found = light_of_pixels(tracer, view, pixels, seed=(1,), standard_error=0.0, most_paths=most_paths)
    truth = found.halves[..., :3] * 2.0**light.stops
    error = ((radiance - truth[0]) * (radiance - truth[1])).mean() / (truth[0] * truth[1]).mean()
    return float(np.sqrt(max(error, 0.0))), float(radiance.mean() / truth.mean())


def labels_and_scan() -> list[Volume]:
    labels = np.zeros((24, 24, 24), np.uint8)
    labels[8:16, 8:16, 8:12], labels[8:16, 8:16, 12:16] = 1, 2
    return [make_volume(labels, np.eye(4), "labels"), volume(blobs(), name="scan")]


def ball_of_labels() -> list[Volume]:
    """Return a ball that two planes divide into three labels."""
    z, y, x = np.indices((28, 28, 28)) - 13.5
    labels = (x * x + y * y + z * z < 11**2).astype(np.uint8)
    labels[(labels > 0) & (x + 0.6 * y + 0.3 * z > 0)] = 2
    labels[(labels > 0) & (x - 0.5 * y + 0.7 * z > 4)] = 3
    return [make_volume(labels, np.eye(4), "ball")]


def block_and_plate() -> list[Volume]:
    """Return a block, and a plate above it that keeps light from it."""
    block, plate = np.zeros((2, 24, 24, 24), np.float32)
    block[4:10, 4:20, 4:20], plate[15:18, 6:18, 6:18] = 1, 1
    return [volume(block), volume(plate)]


def masked(own: Volume, affine: Float64) -> Volume:
    mask = np.zeros((12, 12, 12), np.uint8)
    mask[2:10, 2:10, 2:8] = 1
    return mask_volume(own, make_volume(mask, affine, "mask"), [1])


@pytest.mark.parametrize(
    ("looks", "volumes", "most", "sections"),
    [
        pytest.param([OPAQUE], [volume(blobs(1, 40)[::10], UNEVEN)], 0.2, {}, id="1:1:10, opaque"),
        pytest.param([GLASS], [volume(blobs(1, 40)[::10], UNEVEN)], 0.03, {}, id="1:1:10, clear"),
        pytest.param([OPAQUE], [volume(blobs(1, 32), SHEARED)], 0.2, {}, id="sheared, opaque"),
        pytest.param([GLASS], [volume(blobs(1, 32), SHEARED)], 0.03, {}, id="sheared, clear"),
        pytest.param([OPAQUE], [volume(np.ones((20, 20, 20)))], 0.3, {}, id="all opaque"),
        pytest.param(
            [OPAQUE], [volume(np.ones((28, 28, 28)))], 0.35,
            {"clip": [{"box": [[4.3] * 3, [23.6] * 3], "invert": True}]}, id="opaque and cut",
        ),
        pytest.param(
            [GLASS], [volume(blobs())], 0.03,
            {"clip": [{"plane": {"point": [10.3, 12, 12], "normal": [1, 0.3, 0.2]}}]}, id="clear and cut",
        ),
        pytest.param([GLASS], [masked(volume(blobs()), np.diag([2.0, 2, 2, 1]))], 0.03, {}, id="masked"),
        pytest.param([GLASS, GLASS], [volume(blobs()), volume(blobs(2), FAR)], 0.1, {}, id="far apart"),
        pytest.param(
            [OPAQUE, GLASS], [volume(blobs()), volume(blobs(2), FINE)], 0.2, {}, id="four times finer",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            [{"labels": {"colors": {1: "white", 2: "#d06030", 3: "#3060d0"}, "opacity": 1, "show": [1, 2, 3]}}],
            ball_of_labels(), 0.25, {}, id="opaque labels",
        ),
        pytest.param(
            [{"labels": {"colors": {1: "orange", 2: "#4080c0"}, "opacity": 0.6, "show": [1, 2]}}, GLASS],
            labels_and_scan(), 0.1, {}, id="labels over a scan",
        ),
        pytest.param(
            [{"transfer_function": points("red", CLEAR)}, {"transfer_function": points("lime", CLEAR), "weight": 0.5}],
            [volume(blobs(), name="red"), volume(blobs(2), name="green")], 0.06, {}, id="channels",
        ),
        pytest.param(
            [{"transfer_function": points("#808080")}, {"transfer_function": points("red")}], block_and_plate(), 0.25,
            {"camera": {"path": {"type": "turntable", "frames": 8, "elevation": 30}}}, id="a plate over a block",
            marks=pytest.mark.slow,
        ),
    ],
)  # fmt: skip
def test_grids_and_layers_of_any_kind_agree_with_paths(
    looks: list[dict[str, Any]], volumes: list[Volume], most: float, sections: dict[str, Any]
) -> None:
    output = {"file": "film.mp4", "size": [28, 28]}
    stage = stage_of(scene_of(*looks, light=OUTDOOR, output=output, **sections), *volumes)
    error, brightness = against_paths(stage)
    assert error < most
    assert brightness == pytest.approx(
        1, abs=0.3
    )  # opaque faces without a ramp show half of the empty cell before them

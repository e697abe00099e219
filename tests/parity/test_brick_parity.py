"""The rasteriser of bricks against the reference, by pixels.

PRECISION: samples are float32, and these tests have volumes in which a tenth of the range lies between two voxels.

A ray's way through a brick is cut into a whole number of parts, of which there may be one more where the quotient of
way and step is within float32 of a whole number. What that changes is the difference between two references whose steps
are longer and shorter by STEP.
In the same way a block of pixels may differ by as much as `spread`, or not, within float32: SPREAD.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from brick_reference import nudged, rasterize_bricks_reference
from brickwork import (
    AFFINES,
    CAMERAS,
    EXACTLY,
    SHADED_AFFINES,
    batch_of,
    bricks_of,
    hills,
    level_cut,
    ordered,
    placed,
    random_cut,
    transfer_of,
    view_of,
)

from renderer.bricks import BrickBatch, Bricks, ScreenSampling
from renderer.draw import BrickRasterizer
from renderer.scene import CameraSpec, ShadingSpec, TurntablePath
from renderer.view import View, make_view
from renderer.volume import Float32, make_volume

PRECISION = 6e-5
STEP = 1e-5
SPREAD = 1e-3


def assert_parity(
    brick_rasterizer: BrickRasterizer, batch: BrickBatch, view: View, what: object = "", precision: float = PRECISION
) -> Float32:
    """The rasteriser draws the picture of the reference; it is returned."""
    order = ordered(batch.cut, view)
    image, expected = brick_rasterizer.rasterize([batch], [order], view), rasterize_bricks_reference(batch, order, view)
    assert image.dtype == np.float32
    assert np.isfinite(image).all(), what
    assert expected[..., 3].max() > 0.2, what
    excess = np.abs(image - expected) - precision - batch.screen_sampling.termination_transmittance
    if excess.max() > 0:
        band = [rasterize_bricks_reference(nudged(batch, s * STEP, s * SPREAD), order, view) for s in (-1, 1)]
        excess -= np.max(band, axis=0) - np.min(band, axis=0)
    worst = np.unravel_index(excess.argmax(), excess.shape)
    assert excess[worst] <= 0, f"{what}: {image[worst]} instead of {expected[worst]} at {worst}, {excess[worst]} more"
    return image


def hilly(affine: str, shading: ShadingSpec | None, dtype: str = "uint8") -> Bricks:
    """Bricks of levels 0 to 2 of a volume that they do not fill."""
    values = 200 * hills((37, 50, 70), 17.0)
    volume = placed(values.astype(dtype), AFFINES[affine])
    tau = 0.15 / volume.finest_spacing
    red, blue, yellow, white = (0.9, 0.2, 0.1), (0.1, 0.5, 1.0), (0.8, 0.9, 0.1), (1.0, 1.0, 1.0)
    transfer = transfer_of((20, red, 0.0), (90, blue, tau / 3), (130, yellow, 0.0), (200, white, tau))
    return bricks_of(volume, transfer, shading)


@SHADED_AFFINES
def test_cuts_of_one_level_and_of_many(brick_rasterizer, affine: str, shading: ShadingSpec | None) -> None:
    """From outside and inside, through the near plane, and from where bricks meet."""
    bricks = hilly(affine, shading)
    cuts = [level_cut(bricks, 0), level_cut(bricks, 1), *(random_cut(bricks, seed) for seed in (5, 6, 7))]
    for cut, camera in zip(cuts[len(affine) % 5 :] + cuts[: len(affine) % 5], CAMERAS, strict=True):
        batch = batch_of(cut, bricks, step=(0.7, 0.5, 0.4, 1.0), shading=shading)
        assert_parity(brick_rasterizer, batch, view_of(bricks.volume, camera), (affine, camera, len(cut)))


@SHADED_AFFINES
def test_rays_between_scattered_voxels(brick_rasterizer, affine: str, shading: ShadingSpec | None) -> None:
    """Most samples show nothing, and there are sixteen of a cell; the reference takes all of them."""
    values = np.random.default_rng(3).choice([0.0, 60.0, 250.0], (18, 20, 33), p=[0.08, 0.84, 0.08])
    volume = placed(values.astype(np.uint8), AFFINES[affine])
    transfer = transfer_of((70, (0.9, 0.2, 0.1), 0.0), (120, (1.0, 1.0, 1.0), 2 / volume.finest_spacing))
    bricks = bricks_of(volume, transfer, shading)
    batch = batch_of(level_cut(bricks, 0), bricks, step=1 / 16, shading=shading)
    for camera in ("orthographic", "inside"):
        view = view_of(volume, camera)
        assert_parity(brick_rasterizer, batch, view, (affine, camera), precision=20 * PRECISION)


@pytest.mark.parametrize("azimuth", [0.0, 270.0])
def test_rays_along_an_axis(brick_rasterizer: BrickRasterizer, azimuth: float) -> None:
    """Parallel to the faces of all boxes; every way through a brick is a whole number of steps long."""
    bricks = hilly("straight", None)
    view = view_of(bricks.volume, "orthographic", azimuth=azimuth, elevation=0.0)
    for cut in (level_cut(bricks, 0), random_cut(bricks, 5)):
        assert_parity(brick_rasterizer, batch_of(cut, bricks, step=0.5), view, len(cut))


@pytest.mark.parametrize(("size", "degrees"), [((300, 3), 170.0), ((40, 30), 179.9), ((3000, 1), 179.9)])
def test_very_wide_views(brick_rasterizer: BrickRasterizer, size: tuple[int, int], degrees: float) -> None:
    """Outer rays meet the plane through the volume's centre far away: 0.005 off where they began there."""
    bricks = hilly("oblique", None)
    scale_px = 0.5 * size[1] / math.tan(math.radians(degrees / 2))
    view = replace(view_of(bricks.volume, "inside", size), scale_px=scale_px)
    assert_parity(brick_rasterizer, batch_of(level_cut(bricks, 0), bricks), view)


@pytest.mark.parametrize("azimuth", [90.0, 270.0])
@pytest.mark.parametrize("elevation", [-90.0, 90.0])
def test_the_eye_in_a_plane_between_bricks(brick_rasterizer: BrickRasterizer, azimuth: float, elevation: float) -> None:
    """Rays in that plane pass bricks on one side of it, in the order that bricks have for the eye."""
    z = np.indices((64, 64, 64))[0]
    volume = make_volume((4 * z).astype(np.uint8), np.eye(4), "ramp")
    red, lime, blue = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    transfer = transfer_of((0, red, 0.0), (40, red, 0.3), (128, lime, 0.05), (250, blue, 0.3))
    bricks = bricks_of(volume, transfer)
    camera = CameraSpec(TurntablePath(1, start=azimuth, elevation=elevation))
    for distance in (8.0, 16.0):
        view = make_view(camera, 0, (31.5, 31.5, 31.5), distance, (33, 33))
        assert_parity(brick_rasterizer, batch_of(level_cut(bricks, 0), bricks, step=0.5), view, distance)


@pytest.mark.parametrize(
    ("strides", "size"),
    [((2,), (20, 15)), ((4, 1), (33, 25)), ((8, 2), (40, 12)), ((8, 4, 1), (33, 25)), ((4, 1), (1, 1))],
)
def test_subsampled_pixel_grids(brick_rasterizer, strides: tuple[int, ...], size: tuple[int, int]) -> None:
    """The same pixels are interpolated, except a few whose blocks are at the threshold."""
    bricks = hilly("oblique", None)
    cut = random_cut(bricks, 5)
    for camera in ("perspective", "inside"):
        view = view_of(bricks.volume, camera, size)
        for spread in (0.0, 0.05):
            batch = batch_of(cut, bricks, screen_sampling=ScreenSampling(strides, spread, 0.0))
            assert_parity(brick_rasterizer, batch, view, (camera, spread))


@pytest.mark.parametrize("strides", [(1,), (4, 1)])
@pytest.mark.parametrize("size", [(33, 25), (1, 1), (2, 40)])
def test_several_rays_in_pixels(brick_rasterizer, strides: tuple[int, ...], size: tuple[int, int]) -> None:
    """The same pixels have 1, 4 and 16 rays, except a few at the thresholds."""
    bricks = hilly("oblique", None)
    cut = random_cut(bricks, 5)
    for camera in ("perspective", "orthographic", "inside"):
        view = view_of(bricks.volume, camera, size)
        for contrast, spread in ((0.02, 0.05), (0.1, math.inf), (-1.0, -1.0)):
            sampling = ScreenSampling(strides, 0.05 * (len(strides) > 1), 0.0, contrast, spread)
            assert_parity(brick_rasterizer, batch_of(cut, bricks, screen_sampling=sampling), view, (camera, contrast))


@pytest.mark.parametrize("least", [0.3, 1e-3])
def test_early_ray_termination(brick_rasterizer: BrickRasterizer, least: float) -> None:
    """Images agree within the transmittance at which rays end; the reference stops at every brick."""
    bricks = hilly("sheared", None)
    dense = replace(bricks, transfer=replace(bricks.transfer, extinctions=20 * bricks.transfer.extinctions))
    cut = level_cut(bricks, 0)
    for camera in ("perspective", "inside"):
        view = view_of(bricks.volume, camera)
        batch = batch_of(cut, dense, step=0.25, screen_sampling=ScreenSampling((1,), 0.0, least))
        image = assert_parity(brick_rasterizer, batch, view, camera)
        whole = rasterize_bricks_reference(replace(batch, screen_sampling=EXACTLY), ordered(cut, view), view)
        assert np.abs(image - whole).max() <= least + PRECISION


def test_subsampled_grids_of_a_smooth_image(brick_rasterizer: BrickRasterizer) -> None:
    """A bank of fog: of its blocks some are flat, some on a slope, and some, where it ends, are drawn."""
    values = np.linspace(0, 200, 40 * 40 * 40).reshape(40, 40, 40)
    volume = placed(values.astype(np.uint8), AFFINES["anisotropic"])
    transfer = transfer_of((0, (0.9, 0.2, 0.1), 0.02), (200, (0.1, 0.5, 1.0), 0.06))
    bricks = bricks_of(volume, transfer)
    cut, view = level_cut(bricks, 0), view_of(volume, "perspective", (129, 97))
    for strides in ((4, 1), (4, 2, 1)):
        pictures = []
        for spread in (0.0, 0.05):
            batch = batch_of(cut, bricks, screen_sampling=ScreenSampling(strides, spread, 0.0))
            pictures.append(assert_parity(brick_rasterizer, batch, view, (strides, spread)))
        assert np.abs(pictures[0] - pictures[1]).max() > 0.01


def test_a_long_axis(brick_rasterizer: BrickRasterizer) -> None:
    """Places are of bricks, wherever in the volume these are."""
    values = np.tile(hills((20, 24, 100), 17), (1, 1, 31))
    volume = placed((values * 255).astype(np.uint8))
    assert volume.shape_xyz[0] == 3100
    bricks = bricks_of(volume, transfer_of((90, (0.2, 0.4, 0.9), 0.0), (200, (1, 0.8, 0.5), 0.3)))
    view = view_of(volume, "perspective", (90, 20))
    cut = random_cut(bricks, 1)
    assert set(cut.levels.tolist()) >= {0, 1}
    assert_parity(brick_rasterizer, batch_of(cut, bricks), view)

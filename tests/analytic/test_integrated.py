"""Sums of bricks, against closed forms and the integral itself, for any cut of a volume.

The reference draws; that the device draws the same is the matter of the parity tests.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from brick_reference import picture_at, rasterize_bricks_reference
from brickwork import (
    AFFINES,
    CAMERAS,
    EACH_SHADING,
    batch_of,
    bricks_of,
    hills,
    ordered,
    placed,
    random_cut,
    transfer_of,
    view_of,
)
from ray_integrals import integrate, ray_spans

from renderer.scene import ErrorSpec, ShadingSpec
from renderer.volume import Float64, Volume

LEVEL = 1 / 255  # of an image of 8 bits
COLOR = (0.2, 0.7, 1.0)
SHAPES = ((20, 37, 50), (33, 16, 35), (47, 65, 7), (1, 34, 17))  # z, y, x

# Half precision rounds means by up to 2^-11 of themselves, and a colour is the quotient of two of them.
HALF = 2.0**-10


def diagonal(volume: Volume) -> float:
    """World length."""
    return float(np.linalg.norm(volume.world_from_index[:3, :3] @ volume.shape_xyz))


def largest_error(image: Float64, truth: Float64) -> float:
    assert truth[..., 3].max() > 0.2, truth[..., 3].max()
    return float(np.abs(image - truth).max())


@pytest.mark.parametrize(("affine", "shape"), list(zip(AFFINES, (*SHAPES, SHAPES[0]), strict=True)), ids=str)
def test_constant_volumes_obey_beer_and_lambert(affine: str, shape: tuple[int, int, int]) -> None:
    """Every point of the volume is in one brick, and no more: neither gaps nor overlaps."""
    for seed, camera in enumerate(CAMERAS):
        volume, precision = placed(np.full(shape, 77, np.int16), AFFINES[affine]), ("half", "single")[seed % 2]
        tau = 5 / diagonal(volume)
        bricks = bricks_of(volume, transfer_of((0, COLOR, 0.0), (77, COLOR, tau), (200, COLOR, tau)), None, precision)
        cut, view = random_cut(bricks, seed), view_of(volume, camera)
        alpha = -np.expm1(-tau * ray_spans(volume, view).length.reshape(view.size[::-1]))
        image = rasterize_bricks_reference(batch_of(cut, bricks), ordered(cut, view), view)
        # float32: of the means, and of the table.
        limit = 1e-7 + (HALF if precision == "half" else 0)
        assert largest_error(image, alpha[..., None] * (*COLOR, 1.0)) < limit, (camera, shape)


def ramp(shape: tuple[int, int, int], rng: np.random.Generator, affine: str) -> Volume:
    """Rises from 0 to 1 along a random direction."""
    z, y, x = np.ogrid[tuple(map(slice, shape))]
    a, b, c = rng.standard_normal(3)
    values = a * x + b * y + c * z
    return placed(((values - values.min()) / np.ptp(values)).astype(np.float32), AFFINES[affine])


@EACH_SHADING
@pytest.mark.parametrize(("affine", "camera"), list(zip(AFFINES, CAMERAS, strict=True)))
def test_ramps_meet_without_seams(affine: str, camera: str, shading: ShadingSpec | None) -> None:
    """Means of a ramp are the ramp itself, so that bricks of all levels draw the same field, one colour at a time."""
    volume = ramp((37, 50, 70), np.random.default_rng(len(affine)), affine)
    transfer = transfer_of((0, COLOR, 0.0), (1, COLOR, 0.04 / volume.finest_spacing))
    bricks = bricks_of(volume, transfer, shading)
    cut, view = random_cut(bricks, len(camera)), view_of(volume, camera)
    truth = integrate(volume, transfer, view, step_voxels=1.0, shading=shading)
    batch = batch_of(cut, bricks, shading=shading)
    assert largest_error(rasterize_bricks_reference(batch, ordered(cut, view), view), truth) < LEVEL


@EACH_SHADING
def test_pictures_converge_to_the_truth_with_the_tolerance(shading: ShadingSpec | None) -> None:
    """From one brick for all to voxels at the least step; seen at 0: 2e-7, and 6e-7 with light."""
    volume = placed(hills((40, 50, 70), 24.0), AFFINES["oblique"])
    transfer = transfer_of((0, (0.9, 0.2, 0.1), 0.0), (1, (0.1, 0.5, 1.0), 0.1 / volume.finest_spacing))
    bricks, view = bricks_of(volume, transfer, shading), view_of(volume, "perspective")
    truth = integrate(volume, transfer, view, step_voxels=0.25, shading=shading)
    errors = []
    for tolerance in (1.0, 0.1, 0.01, 1e-3, 0.0):
        image = picture_at(bricks, view, tolerance, shading, every_pixel=False)
        errors.append(np.sqrt(np.mean((image - truth) ** 2)))
    assert np.all(np.diff(errors) < 0), errors
    assert errors[0] < 0.2
    assert errors[-2] < 1e-4
    assert errors[-1] < 1e-6


@pytest.mark.parametrize(("period", "azimuth"), [(2, 90.0), (3, 75.0)])
def test_no_step_keeps_pace_with_what_is_regular(period: int, azimuth: float) -> None:
    """Sheets much thinner than a voxel, so many voxels apart: with the same number of parts for all pixels some steps
    meet all of them, and some none, by up to twice the tolerance. Seen: 0.7 of it."""
    sheets = (np.arange(64) % period == 0).astype(np.float32)
    volume = placed(np.tile(sheets, (16, 64, 1)))
    transfer = transfer_of((0.9, COLOR, 0.0), (1, COLOR, 0.3))
    bricks, view = bricks_of(volume, transfer), view_of(volume, "orthographic", (24, 24), azimuth=azimuth, elevation=0)
    truth = integrate(volume, transfer, view, step_voxels=0.02)
    for tolerance in 0.01 * 10.0 ** (np.arange(7) / 4):
        error = picture_at(bricks, view, tolerance) - truth
        assert np.sqrt(np.mean(error**2)) < tolerance, tolerance


@pytest.mark.parametrize("inside", [0.0, 0.3], ids=["visible above", "visible below"])
@pytest.mark.parametrize("at", ["start", "end"])
def test_steps_at_the_ends_of_a_transfer_function(at: str, inside: float) -> None:
    """What lies beyond the last control value at either end is as its outer point says, and not as the step's other
    side; thresholds are written so."""
    volume = placed(hills((20, 36, 34), 14.0), AFFINES["oblique"])
    low, high = ((0.5, COLOR, inside), (0.5, COLOR, 0.3 - inside))
    transfer = (
        transfer_of(low, high, (0.9, COLOR, 0.3 - inside))
        if at == "start"
        else transfer_of((0.1, COLOR, inside), low, high)
    )
    bricks, view = bricks_of(volume, transfer), view_of(volume, "perspective")
    truth = integrate(volume, transfer, view, step_voxels=0.05)
    error = picture_at(bricks, view, 0.0) - truth
    assert np.sqrt(np.mean(error**2)) < 4e-3  # seen: 2.6e-3, steps of 1/16 across a jump


@pytest.mark.parametrize("error", [{}, {"measure": "rms"}, {"measure": "rms", "of": "scalar"}], ids=str)
def test_opaque_walls_are_exact_at_the_tolerance_0(error: dict[str, Any]) -> None:
    """Whatever errors are measured in, steps are short where a voxel is opaque. Seen: 1.2e-5; with those of clear ones,
    1.4e-4."""
    volume = placed(hills((20, 36, 34), 14.0), AFFINES["oblique"])
    transfer = transfer_of((0.4, (0.9, 0.2, 0.1), 0.0), (1, (0.1, 0.5, 1.0), 40 / volume.finest_spacing))
    bricks, view = bricks_of(volume, transfer, error=ErrorSpec(**error)), view_of(volume, "perspective", (24, 18))
    truth = integrate(volume, transfer, view, step_voxels=0.01)
    assert np.sqrt(np.mean((picture_at(bricks, view, 0.0) - truth) ** 2)) < 5e-5


def test_empty_bricks_beside_a_surface_show_no_coarse_fringe() -> None:
    """A ball that ends with the last voxel before a border, beyond which there are large empty bricks: they show half a
    voxel of it, as finely as it is drawn inside."""
    z, y, x = np.ogrid[:64, :64, :64]
    ball = (x - 20) ** 2 + (y - 21) ** 2 + (z - 19) ** 2 < 11.2**2
    volume = placed(np.where(ball, 200, 0).astype(np.uint8), AFFINES["anisotropic"])
    transfer = transfer_of((0, COLOR, 0.0), (200, (0.9, 0.4, 0.1), 1.0))
    bricks, view = bricks_of(volume, transfer), view_of(volume, "perspective", (40, 30))
    truth = integrate(volume, transfer, view, step_voxels=0.25)
    assert largest_error(picture_at(bricks, view, 1e-3), truth) < LEVEL

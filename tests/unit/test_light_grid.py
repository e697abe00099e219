"""The light grid against a reference in plain float64, against closed forms, and for any number of threads."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from dense_bricks import OBLIQUE
from light_reference import exact_occlusion, exact_shadow, sampled

from renderer.kernels import LightGrid
from renderer.lighting import compute_light_grid
from renderer.pyramid import build_pyramid, cut_pyramid
from renderer.scene import ErrorSpec, PyramidSpec, ShadingSpec, Vector
from renderer.transfer import TransferFunction, make_light_grid
from renderer.volume import Bools, Float64, Volume, make_volume

LIGHT, RADIUS = (0.4, -0.3, 0.9), 15.0
AFFINES = {"plain": np.eye(4), "long voxels": np.diag([1.0, 1.5, 2.5, 1.0]), "oblique": OBLIQUE}
# Opaque things with soft edges, which are many cells large.
TRANSFER = TransferFunction(np.array([100.0, 200.0]), np.ones((2, 3)), np.array([0.0, 0.4]), 1.0)


def volume_of(shape: tuple[int, int, int], affine: Float64 = AFFINES["plain"], dtype: Any = np.uint8) -> Volume:
    """Return two balls before a wall, of which the border cuts the wall."""
    z, y, x = np.indices(shape) / (np.array(shape)[:, None, None, None] - 1)
    balls = [
        np.hypot(np.hypot(x - a, y - b), z - c) - r for a, b, c, r in ((0.3, 0.4, 0.6, 0.15), (0.6, 0.7, 0.7, 0.2))
    ]
    distance = np.minimum(np.minimum(*balls), z - 0.2)
    return make_volume(np.clip(150 - 900 * distance, 0, 255).astype(dtype), affine, "balls")


def grid_of(
    volume: Volume,
    transfer: TransferFunction,
    *,
    occlusion: bool = False,
    light: Vector | None = None,
    radius: float | None = None,
    **options: int,
) -> LightGrid:
    shading = ShadingSpec(light=light or LIGHT, occlusion=float(occlusion), shadow=float(light is not None))
    return compute_light_grid(volume, transfer, replace(shading, occlusion_radius=radius), **options)


def visible_points(volume: Volume, num: int) -> Float64:
    """Return places (x, y, z) in voxels where something is visible, from the centres of voxels, float64 [num, 3]."""
    found = np.argwhere(TRANSFER.classify(volume.values)[1] > 0.01)[:, ::-1]
    return np.random.default_rng(1).choice(found, num, replace=False).astype(np.float64)


@pytest.mark.parametrize(
    ("affine", "max_cells", "radius"),
    [
        *((affine, cells, RADIUS) for affine in AFFINES for cells in (128, 24)),
        ("plain", 128, 4.0),
        ("plain", 128, 40.0),
    ],
)
def test_agrees_with_many_rays_in_fine_steps(affine: str, max_cells: int, radius: float) -> None:
    """Cells that are a few percent of the volume blur what rays see, and few rays are off by some percent."""
    volume = volume_of((37, 40, 45), AFFINES[affine])
    found = grid_of(volume, TRANSFER, occlusion=True, light=LIGHT, radius=radius, max_cells=max_cells, num_threads=2)
    assert found.cell_size == (1 if max_cells == 128 else 2)
    points = visible_points(volume, 60)
    pairs = {
        "occlusion": (found.occlusion, exact_occlusion(volume, TRANSFER, points, found.cell_size, radius)),
        "shadow": (found.shadow, exact_shadow(volume, TRANSFER, points, found.cell_size, LIGHT)),
    }
    for name, (stored, exact) in pairs.items():
        assert exact.std() > 0.1 or radius < RADIUS, name
        errors = sampled(stored, found.cell_size, points) - exact
        assert np.sqrt(np.mean(errors**2)) < (0.03 if found.cell_size == 1 else 0.09), name


def test_a_cut_face_is_as_bright_as_a_surface() -> None:
    """Of an opaque block, whose upper half lets light through: its middle has no light else."""
    volume = make_volume(np.full((32, 32, 32), 255, np.uint8), np.eye(4), "block")

    def are_above(bounds: Float64) -> Bools:
        return np.asarray(bounds[:, 0, 2] > 0)

    closed, opened = (
        compute_light_grid(volume, TRANSFER, ShadingSpec(occlusion=1.0, occlusion_radius=30.0), are_removed=each)
        for each in (None, are_above)
    )
    assert closed.occlusion is not None and opened.occlusion is not None
    assert closed.occlusion[16, 16, 16] < 0.05
    assert opened.occlusion[16, 16, 16] > 0.8
    assert opened.occlusion[6, 16, 16] < 0.2


def test_a_plane_is_open_and_lit_and_what_it_hides_is_not() -> None:
    """Far from the border, one half of all directions is free. Cells at the face are
    within a block by half their width, so their factors are less than 1."""
    values = np.zeros((48, 48, 48), np.uint8)
    values[:24] = 255
    volume = make_volume(values, np.eye(4), "block")
    step = TransferFunction(np.array([100.0, 100.0]), np.ones((2, 3)), np.array([0.0, 5.0]), 1.0)
    lit = grid_of(volume, step, occlusion=True, light=(0.0, 0.0, 1.0))
    dark = grid_of(volume, step, light=(0.0, 0.0, -1.0))
    face, inside = (24, 25, 25), (18, 25, 25)  # with the cell before the first one
    assert lit.occlusion[face] > 0.65 and lit.shadow[face] > 0.99
    assert lit.occlusion[inside] < 0.01 and lit.shadow[inside] < 0.01
    assert dark.shadow[face] < 0.01
    assert np.all(lit.occlusion[30:] == 1) and np.all(lit.shadow[30:] == 1)


def test_a_uniform_medium_dims_light_by_its_way_to_the_border() -> None:
    volume = make_volume(np.full((20, 30, 50), 7, np.uint8), np.diag([1.0, 2.0, 3.0, 1.0]), "fog")
    fog = TransferFunction(np.array([0.0]), np.ones((1, 3)), np.array([0.01]), 1.0)
    found = grid_of(volume, fog, light=(1.0, 0.0, 0.0))
    columns = np.arange(10, 46)
    ways = 49.5 - columns - 2  # two cells are left out; rays to the rim of the light go a few percent further
    np.testing.assert_allclose(found.shadow[10, 15, 1 + columns], np.exp(-0.01 * ways), rtol=0.012)


def test_wide_and_narrow_voxels_and_threads_agree() -> None:
    grids = [
        grid_of(volume_of((23, 20, 41), dtype=dtype), TRANSFER, occlusion=True, light=LIGHT, num_threads=threads)
        for dtype, threads in ((np.uint8, 1), (np.uint8, 3), (np.uint16, 2), (np.int32, 1))
    ]
    for found in grids[1:3]:
        assert_same(found, grids[0])
    whole = grid_of(volume_of((23, 20, 41)), TRANSFER)
    assert whole.occlusion.size == whole.shadow.size == 0
    np.testing.assert_allclose(grids[3].shadow, grids[0].shadow, atol=1.01 / 255)


def test_corners_are_the_factors_at_a_cell_and_its_neighbours() -> None:
    steps = np.random.default_rng(3).integers(0, 256, (2, 4, 5, 6)).astype(np.uint8)
    occlusion, shadow = steps / np.float32(255)
    for factors in ((occlusion, None), (None, shadow), (occlusion, shadow)):
        found = make_light_grid(*factors, 1.0, (1.0, 1.0))
        given = [grid for grid, is_there in zip(steps, factors, strict=True) if is_there is not None]
        corners = found.corners[:-2].view(np.uint8).reshape(4, 5, 6, len(given), 2, 2, 2)
        for number, grid in enumerate(given):
            np.testing.assert_array_equal(corners[2, 1, 3, number], grid[2:4, 1:3, 3:5])
        assert (found.occlusion_strength, found.shadow_strength) == tuple(float(grid is not None) for grid in factors)


def assert_same(first: LightGrid, second: LightGrid) -> None:
    np.testing.assert_array_equal(first.occlusion, second.occlusion)
    np.testing.assert_array_equal(first.shadow, second.shadow)


def shares_of_voxels(found: LightGrid, ambient: float, diffuse: float) -> Float64:
    """Return the factors on the colours of voxels [z, y, x] whose gradient points away from the light."""
    values = np.zeros([int((num - 2) * found.cell_size) for num in found.occlusion.shape], np.uint8)
    values[:] = np.arange(values.shape[2])
    of = make_volume(values, np.eye(4), "ramp")
    gray = TransferFunction(np.zeros(1), np.ones((1, 3)), np.ones(1), 1.0)
    shading = ShadingSpec(ambient, diffuse, (-1.0, 0.0, 0.0))
    pyramid = build_pyramid(of, gray, spec=PyramidSpec(), error=ErrorSpec(), shading=shading, light_grid=found)
    cut, shares = cut_pyramid(pyramid, 0.0), np.full(values.shape, np.nan)
    shares[tuple(cut.cells.T[::-1])] = cut.depths[:, 0]
    return shares


@pytest.mark.parametrize("cell_size", [1, 2, 8])
def test_voxels_are_interpolated_between_centres_of_cells(cell_size: int) -> None:
    """A linear function of the place is found again, and is constant beyond the outermost centres."""
    cells = np.indices((4, 5, 6)).astype(np.float32) / 1000
    grid = np.pad(cells[0] + 10 * cells[1] + 100 * cells[2], 1, mode="edge")
    found = LightGrid(grid, np.empty((0, 0, 0), np.float32), np.empty(0, np.int32), cell_size, 1.0, 0.5)
    half = found._replace(occlusion_strength=0.5, shadow=grid)
    ends = [np.clip((np.arange(num * cell_size) + 0.5) / cell_size - 0.5, 0, num - 1) for num in (4, 5, 6)]
    z, y, x = np.meshgrid(*ends, indexing="ij")
    wanted = (z + 10 * y + 100 * x) / 1000
    np.testing.assert_allclose(shares_of_voxels(found, 1.0, 0.0), wanted, atol=1e-6)
    np.testing.assert_allclose(shares_of_voxels(found, 0.0, 1.0), 1.0, atol=1e-6)
    np.testing.assert_allclose(shares_of_voxels(half, 1.0, 0.0), 0.5 + wanted / 2, atol=1e-6)
    np.testing.assert_allclose(shares_of_voxels(half, 0.0, 1.0), 0.5 + wanted / 2, atol=1e-6)


def test_flat_volumes_and_single_voxels() -> None:
    for shape in ((1, 1, 1), (1, 40, 3)):
        volume = make_volume(np.full(shape, 255, np.uint8), np.eye(4), "")
        found = grid_of(volume, TRANSFER, occlusion=True, light=LIGHT)
        assert found.occlusion.shape == tuple(num + 2 for num in shape)
        assert np.all(found.occlusion > 0.5) and np.all(found.shadow == 1)

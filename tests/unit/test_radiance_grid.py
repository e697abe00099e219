"""The light in matter that scatters, against closed forms, and for any number of threads."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from dense_bricks import OBLIQUE
from scipy.special import expn

from renderer.errors import InputError
from renderer.lighting import (
    LightSources,
    Matter,
    RadianceGrid,
    compute_radiance_grid,
    place_grid,
    solve_bytes,
)
from renderer.transfer import TransferFunction
from renderer.volume import Bools, Float64, make_volume

EVEN = np.array([[1.0] * 3, [0.0] * 3, [0.0] * 3])
DARK = np.zeros((3, 3))
UPWARDS = (0.0, 0.0, 1.0)


def lights(
    environment: Float64 = EVEN,
    *,
    key: tuple[float, float, float] = UPWARDS,
    radius: float = 0.01,
    irradiance: float = 0.0,
) -> LightSources:
    return LightSources(UPWARDS, environment, key, radius, np.full(3, irradiance))


def matter_of(
    extinctions: npt.NDArray[np.float32],
    albedo: npt.ArrayLike = 1.0,
    affine: Float64 | None = None,
    weight: float = 1.0,
) -> Matter:
    """Return a layer whose scalar is its extinction, 0 to 1000."""
    volume = make_volume(
        np.ascontiguousarray(extinctions, np.float32), np.eye(4) if affine is None else affine, "matter"
    )
    colors = np.broadcast_to(np.asarray(albedo, np.float64), (2, 3)).copy()
    return Matter(volume, TransferFunction(np.array([0.0, 1000.0]), colors, np.array([0.0, 1000.0]), 1.0), weight)


def even(shape_xyz: tuple[int, int, int], extinction: float) -> npt.NDArray[np.float32]:
    return np.full(shape_xyz[::-1], extinction, np.float32)


def noise(shape_xyz: tuple[int, int, int], largest: float, seed: int = 1) -> npt.NDArray[np.float32]:
    random = np.random.default_rng(seed).random(shape_xyz[::-1])
    return (np.maximum(random - 0.5, 0) * 2 * largest).astype(np.float32)


def column(grid: RadianceGrid) -> Float64:
    """Return the light of the middle column of cells, from the lowest to the highest, float64 [z]."""
    _, y, x, _ = grid.mean_radiance.shape
    return grid.mean_radiance[:, y // 2, x // 2, 0].astype(np.float64)


def seen_from_above(grid: RadianceGrid, extinction: float, albedo: float, depth: float) -> float:
    """Return the radiance of the middle column of even matter, from its upper face at z = depth - 1/2 on."""
    cells, middle = column(grid), (np.arange(20000) + 0.5) / 20000 * min(depth, 30 / extinction)
    light = np.interp(depth - 0.5 - middle, grid.origin[2] + (np.arange(len(cells)) + 0.5) * grid.cell, cells)
    shown = albedo * extinction * light * np.exp(-extinction * middle)
    return float(shown.sum() * (middle[1] - middle[0]))


@pytest.mark.parametrize(
    "affine", [np.eye(4), np.diag([1.0, 1.0, 10.0, 1.0]), OBLIQUE], ids=["even", "uneven", "oblique"]
)
@pytest.mark.parametrize("largest", [0.01, 3.0, 40.0])
def test_white_furnace(affine: Float64, largest: float) -> None:
    """Matter that absorbs nothing is as bright as an even sky, everywhere."""
    grid = compute_radiance_grid([matter_of(noise((11, 9, 7), largest), 1.0, affine)], lights(), cell_voxels=1)
    np.testing.assert_allclose(grid.mean_radiance, 1.0, atol=3e-7)


@pytest.mark.parametrize("start", [0.0, 1.5])
def test_white_furnace_from_any_start(start: float, monkeypatch: pytest.MonkeyPatch) -> None:
    def other_start(matter: object, *_: object) -> npt.NDArray[np.float32]:
        return np.full((3, *matter.cells.shape[1:]), start, np.float32)  # type: ignore[attr-defined]

    monkeypatch.setattr("renderer.lighting.radiance_grid._start", other_start)
    monkeypatch.setattr("renderer.lighting.radiance_grid.TOLERANCE", 1e-5)
    grid = compute_radiance_grid([matter_of(noise((11, 9, 7), 1.0))], lights(), cell_voxels=1)
    assert 4 < grid.num_rounds < 64
    assert grid.residual <= 1e-5
    np.testing.assert_allclose(grid.mean_radiance, 1.0, atol=2e-4)


def test_albedo_of_exactly_1_in_clear_matter() -> None:
    """The sky is darker below: nothing is absorbed, and no place is brighter than the sky."""
    grid = compute_radiance_grid([matter_of(even((20, 20, 20), 1e-3))], lights(EVEN + np.diag([0, 1, 0])[:, [1] * 3]))
    np.testing.assert_allclose(grid.mean_radiance, 1.0, atol=0.01)
    assert grid.residual <= 0.002


def test_few_rounds_suffice_in_thick_matter_that_absorbs_nothing() -> None:
    """Without the mix of rounds, there are about 40; with a start by coarse cells of wrong depths, 10."""
    grid = compute_radiance_grid([matter_of(even((40, 40, 40), 0.3))], lights(DARK, irradiance=1.0), cell_voxels=1)
    assert grid.num_rounds <= 9


def test_key_light_through_a_slab_that_absorbs() -> None:
    depth = 0.05
    grid = compute_radiance_grid([matter_of(even((8, 8, 12), depth), 0.0)], lights(DARK, irradiance=1.0), cell_voxels=1)
    expected = np.exp(-depth * np.minimum(12.0, 12.5 - np.arange(13)))
    # On its way to the middle of a cell, light meets a depth that is 1.6 percent less.
    np.testing.assert_allclose(grid.key[:13, 5, 5], expected, rtol=5e-4)
    np.testing.assert_allclose(column(grid) * 4 * np.pi, grid.key[:, 5, 5], rtol=1e-6)


def test_sky_through_a_slab_that_absorbs() -> None:
    """Beside its middle, a wide slab in even light has the mean radiance E2(t) / 2 from each side."""
    depth, num = 0.1, 8
    grid = compute_radiance_grid([matter_of(even((90, 90, num), depth), 0.0)], lights(), cell_voxels=1)
    below = depth * (np.arange(num) + 0.5)
    expected = (expn(2, below) + expn(2, depth * num - below)) / 2
    np.testing.assert_allclose(column(grid)[1:-1], expected, rtol=0.02)


def test_thin_slab_scatters_once() -> None:
    """An albedo of 0.01 leaves what scatters twice below a hundredth."""
    total, num = 1.2, 12
    grid = compute_radiance_grid([matter_of(even((140, 140, num), total / num), 0.01)], lights(), cell_voxels=2)
    nodes, weights = np.polynomial.legendre.leggauss(64)
    t = (nodes + 1) / 2 * total
    expected = 0.01 * np.sum(weights / 2 * total * (expn(2, t) + expn(2, total - t)) / 2 * np.exp(-t))
    assert seen_from_above(grid, total / num, 0.01, num) == pytest.approx(expected, rel=0.04)


def h_function(albedo: float) -> float:
    """Return Chandrasekhar's H at the cosine 1."""
    nodes, weights = np.polynomial.legendre.leggauss(80)
    mu, weights = (nodes + 1) / 2, weights / 2
    h = np.ones_like(mu)
    for _ in range(500):
        h = 1 / (np.sqrt(1 - albedo) + albedo / 2 * (weights * mu * h / (mu[:, None] + mu)).sum(axis=1))
    return float(1 / (np.sqrt(1 - albedo) + albedo / 2 * (weights * mu * h / (mu + 1)).sum()))


@pytest.mark.parametrize("cell_voxels", [1, 2, 4])
@pytest.mark.parametrize(("albedo", "extinction", "error"), [(0.9, 1.0, 0.02), (0.9, 5.0, 0.015), (0.5, 1.0, 0.14)])
def test_half_space_shows_the_radiance_of_chandrasekhar(
    albedo: float, extinction: float, error: float, cell_voxels: int
) -> None:
    """Lit and seen straight. Cells of one to twenty mean free paths."""
    layer = matter_of(even((48, 48, 24), extinction), albedo)
    grid = compute_radiance_grid([layer], lights(DARK, irradiance=np.pi), cell_voxels=cell_voxels)
    expected = albedo / 8 * h_function(albedo) ** 2
    assert seen_from_above(grid, extinction, albedo, 24) == pytest.approx(expected, rel=error)


@pytest.mark.parametrize("largest", [0.3, 40.0])
def test_energy_is_never_gained(largest: float) -> None:
    sky = np.array([[0.5, 0.4, 0.3], [0.3, 0.2, 0.1], [0.1, 0.1, 0.0]])
    grid = compute_radiance_grid([matter_of(noise((15, 14, 13), largest), 0.95)], lights(sky), cell_voxels=1)
    assert (grid.mean_radiance <= sky.sum(axis=0)).all()
    assert (grid.mean_radiance > 0).all()
    outside = grid.mean_radiance[[0, -1]].mean(axis=(1, 2))
    assert (outside < sky[0] + 0.5 * sky[1]).all()


@pytest.mark.parametrize("axes", [(0, 1), (0, 2), (1, 2)])
def test_quarter_turns_turn_the_light(axes: tuple[int, int]) -> None:
    """The 24 directions, and the sweeps along x, y and z, are alike."""
    extinctions = noise((18, 18, 18), 2.0)
    found = [
        compute_radiance_grid([matter_of(matter, 0.8)], lights(), cell_voxels=1).mean_radiance
        for matter in (extinctions, np.rot90(extinctions, axes=axes))
    ]
    np.testing.assert_allclose(np.rot90(found[0], axes=axes), found[1], atol=2e-3)
    assert np.abs(np.rot90(found[0], axes=axes) - found[0]).max() > 0.05


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_no_light_leaks_through_a_wall_of_one_opaque_cell(axis: int) -> None:
    """A box with walls that are one cell thick is dark inside."""
    extinctions = np.zeros((16, 16, 16), np.float32)
    extinctions[2:-2, 2:-2, 2:-2] = 40.0
    extinctions[4:-4, 4:-4, 4:-4] = 0.0
    key = np.roll([0.1, 0.2, 0.97], axis)
    sources = lights(key=tuple(key / np.linalg.norm(key)), irradiance=4 * np.pi)
    grid = compute_radiance_grid([matter_of(extinctions, 0.0)], sources, cell_voxels=2)
    assert grid.mean_radiance.shape == (10, 10, 10, 3)
    assert grid.mean_radiance[3:-3, 3:-3, 3:-3].max() < 1e-3
    assert grid.mean_radiance[0].min() > 0.5


def half_space(depth: int) -> Matter:
    """Return opaque labels below the height 15, so many cells deep."""
    extinctions = np.zeros((30, 30, 30), np.float32)
    extinctions[15 - depth : 15] = 40.0
    matter = matter_of(extinctions, 0.0)
    return matter._replace(volume=replace(matter.volume, is_labels=True))


def inclined(degrees: float) -> LightSources:
    """Return a key light so far from the height's axis."""
    key = np.sin(np.radians(degrees)), 0.0, np.cos(np.radians(degrees))
    return lights(DARK, key=key, radius=2.0, irradiance=1.0)


@pytest.mark.parametrize("degrees", [0, 30, 50, 70])
def test_light_that_grazes_a_surface_reaches_it(degrees: float) -> None:
    """The middle of a surface cell gets the light that the way to it leaves, though rays pass beside opaque cells."""
    grid = compute_radiance_grid([half_space(9)], inclined(degrees), cell_voxels=1)
    # Half of the cell, at its capped depth.
    assert grid.key[15, 15, 16] > 0.7 * np.exp(-0.75 / np.cos(np.radians(degrees)))
    assert grid.key[16, 15, 16] > 0.9


@pytest.mark.parametrize("degrees", [0, 30, 45, 60])
def test_walls_stop_inclined_light(degrees: float) -> None:
    """A wall of two cells stops all of it, and a wall of one cell nearly all."""
    for depth, most in ((1, 0.15), (2, 1e-6)):
        grid = compute_radiance_grid([half_space(depth)], inclined(degrees), cell_voxels=1)
        assert grid.key[12 - depth : 16 - depth, 15, 14:18].max() < most


@pytest.mark.parametrize("radius", [0.01, 5.0, 14.0])
def test_edge_of_a_shadow_is_as_wide_as_the_key_light(radius: float) -> None:
    """The share of a disc above an edge is a closed form."""
    extinctions = np.zeros((50, 19, 50), np.float32)
    extinctions[44, :, 25:] = 40.0
    screen = matter_of(extinctions, 0.0)
    screen = screen._replace(volume=replace(screen.volume, is_labels=True))  # nothing is interpolated at its edge
    grid = compute_radiance_grid([screen], lights(DARK, radius=radius, irradiance=1.0), cell_voxels=1)
    below = 20
    places = np.arange(50) + 0.5 - 25
    across = np.clip(-places / (below * np.tan(np.radians(radius))), -1, 1)
    expected = 0.5 + (np.arcsin(across) + across * np.sqrt(1 - across * across)) / np.pi
    found = grid.key[1 + 44 - below, 10, 1:-1]
    is_near = (np.abs(places) < 15) & (places != 0)  # the screen ends at the border
    assert np.abs(found - expected)[is_near].max() < 0.1
    assert found[0] == 1
    assert found[36] < 1e-5


def test_layers_add_up() -> None:
    """Extinctions add up, and albedos times extinctions, also of a volume that is turned and has wider voxels."""
    first, second = noise((16, 16, 16), 1.0), even((8, 8, 8), 0.5)
    turned = np.array([[0, -2.0, 0, 14.5], [2.0, 0, 0, 0.5], [0, 0, 2.0, 0.5], [0, 0, 0, 1]])
    both = compute_radiance_grid([matter_of(first, 1.0), matter_of(second, 0.5, turned, 2.0)], lights(), cell_voxels=1)
    sums = first + 1.0
    single = compute_radiance_grid([matter_of(first), matter_of(even((16, 16, 16), 1.0), 0.5)], lights(), cell_voxels=1)
    np.testing.assert_allclose(both.mean_radiance, single.mean_radiance, atol=1e-5)
    darker = compute_radiance_grid([matter_of(sums, 0.75)], lights(), cell_voxels=1)
    assert np.abs(darker.mean_radiance - single.mean_radiance).max() > 0.02


def test_one_layer_shadows_another() -> None:
    lower = matter_of(even((12, 12, 4), 0.2), 0.5)
    upper = matter_of(
        even((12, 12, 4), 40.0), 0.0, np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 20.0], [0, 0, 0, 1]])
    )
    alone = compute_radiance_grid([lower], lights(DARK, irradiance=1.0), cell_voxels=1)
    shadowed = compute_radiance_grid([lower, upper], lights(DARK, irradiance=1.0), cell_voxels=1)
    assert column(alone)[2] > 0.05
    assert column(shadowed)[2] < 1e-6


def test_clipped_matter_lets_light_through() -> None:
    def are_removed(boxes: Float64) -> Bools:
        return np.asarray((boxes[:, :, 2] > 0).all(axis=1))

    layer = matter_of(even((8, 8, 8), 40.0), 0.0)
    whole = compute_radiance_grid([layer], lights(DARK, irradiance=1.0), cell_voxels=1)
    cut = compute_radiance_grid([layer._replace(are_removed=are_removed)], lights(DARK, irradiance=1.0), cell_voxels=1)
    assert whole.key[5, 4, 4] < 1e-6
    assert cut.key[5, 4, 4] == 1
    assert cut.key[3, 4, 4] < 1e-6


def test_cells_that_clipping_cuts_keep_a_share_of_their_matter() -> None:
    """A plane that is square to an axis, and one that cuts cells from corner to corner."""
    for normal, kept in (([0.0, 0.0, 1.0], 0.25), ([1.0, 1.0, 1.0], 60 / 64)):

        def are_removed(boxes: Float64, normal: list[float] = normal) -> Bools:
            return np.asarray((boxes @ np.array(normal) > 0.5 * sum(normal) ** 2).all(axis=1))

        layer = matter_of(even((8, 8, 8), 1.0), 0.0)._replace(are_removed=are_removed)
        depths = compute_radiance_grid([layer], lights(), cell_voxels=2).matter.cells[3]
        assert depths[3, 3, 3] == pytest.approx(2 * kept)
        assert depths[1, 1, 1] == 2
        assert depths[4, 4, 4] == 0


@pytest.mark.parametrize("dtype", [np.uint8, np.int8, np.uint16, np.int16, np.int32, np.float64])
def test_types_of_voxels(dtype: type[np.generic]) -> None:
    voxels = np.arange(64).reshape(4, 4, 4)
    transfer = TransferFunction(np.array([0.0, 64.0]), np.ones((2, 3)), np.array([0.0, 2.0]), 1.0)
    grids = [
        compute_radiance_grid(
            [Matter(make_volume(voxels.astype(each), np.eye(4), "v"), transfer)], lights(DARK, irradiance=1.0)
        )
        for each in (dtype, np.float32)
    ]
    np.testing.assert_array_equal(grids[0].mean_radiance, grids[1].mean_radiance)


def test_voxels_without_data_are_empty() -> None:
    """Beside them, the scalar is that of the nearest voxel."""
    extinctions = even((6, 6, 6), 0.5)
    extinctions[:, :, 3:] = np.nan
    volume = make_volume(extinctions, np.eye(4), "absent", num_absent=108)
    layer = matter_of(even((1, 1, 1), 1.0), 0.0)._replace(volume=volume)
    grid = compute_radiance_grid([layer], lights(DARK, irradiance=1.0), cell_voxels=1)
    np.testing.assert_allclose(grid.key[1, 3, 4:], 1, rtol=1e-3)
    np.testing.assert_allclose(grid.key[1, 3, 1:4], np.exp(-0.5 * 5.5), rtol=0.05)


def test_volume_of_one_voxel() -> None:
    grid = compute_radiance_grid([matter_of(even((1, 1, 1), 2.0), 0.5)], lights(), cell_voxels=1)
    assert grid.mean_radiance.shape == (3, 3, 3, 3)
    np.testing.assert_array_equal(grid.origin, [-1.5, -1.5, -1.5])
    assert 0.3 < grid.mean_radiance[1, 1, 1, 0] < 0.9


def test_cells_are_wider_where_there_would_be_too_many() -> None:
    grid = compute_radiance_grid([matter_of(even((60, 5, 5), 0.1))], lights(), cell_voxels=1, max_cells=32)
    assert grid.cell == 2
    assert grid.mean_radiance.shape == (5, 5, 32, 3)


def test_grid_covers_only_visible_matter() -> None:
    """Cells lie on the lattice of the volume's corner, and stay there where the visible matter grows."""
    layer, grids = matter_of(even((60, 9, 9), 0.1)), []
    for first in (20.0, 17.3):
        reach = np.array([[first, 2.0, 2.0], [30.0, 6.5, 6.5]])
        grids.append(compute_radiance_grid([layer._replace(reach=reach)], lights(), max_cells=32))
    assert [grid.cell for grid in grids] == [1, 1]
    np.testing.assert_array_equal(grids[0].origin, [18.5, 0.5, 0.5])
    np.testing.assert_array_equal(grids[1].origin, [15.5, 0.5, 0.5])
    assert grids[0].mean_radiance.shape == (7, 7, 13, 3)
    depths = [grid.matter.cells[3] for grid in grids]
    np.testing.assert_array_equal(depths[0][3, 3, 1:12], depths[1][3, 3, 4:15])


def test_invisible_layers_widen_no_cells() -> None:
    """A layer that is far away, and of a finer spacing."""
    seen, nowhere = matter_of(noise((9, 9, 9), 2.0)), np.empty((0, 3))
    far = matter_of(even((4, 4, 4), 1.0), affine=np.diag([0.1, 0.1, 0.1, 1.0]) + 1e6 * np.eye(4, k=3))
    alone = compute_radiance_grid([seen], lights(irradiance=1.0))
    for other in (far._replace(weight=0.0), far._replace(reach=nowhere)):
        for layers in ([seen, other], [other, seen]):
            grid = compute_radiance_grid(layers, lights(irradiance=1.0))
            np.testing.assert_array_equal(grid.mean_radiance, alone.mean_radiance)
    grid = compute_radiance_grid([far._replace(reach=nowhere)], lights(irradiance=1.0))
    assert grid.mean_radiance.shape == (3, 3, 3, 3)
    assert not grid.matter.cells.any()


@pytest.mark.parametrize("max_cells", [4, 32, 128])
def test_cells_are_few_and_hardly_wider_than_needed(max_cells: int) -> None:
    """Volumes of any size and distance, in one grid."""
    random = np.random.default_rng(1)
    for _ in range(200):
        sides, spacing = 10.0 ** random.uniform(0, 6, 3), 10.0 ** random.uniform(-8, 8)
        low = random.uniform(-1e4, 1e4, 3) * spacing
        reach = np.array([low, low + sides * spacing])
        layer = matter_of(even((2, 2, 2), 1.0), affine=np.diag([spacing] * 3 + [1.0]))._replace(reach=reach)
        origin, cell, shape = place_grid([layer], 1.0, max_cells)
        assert max(shape) <= max_cells
        assert cell <= max(spacing, sides.max() * spacing / (max_cells - 2)) * (1 + 3 / 16 + 1 / (max_cells - 3))
        ends = origin + cell * np.array(shape)
        assert (origin + cell * 0.99 <= reach[0]).all()
        assert (ends - cell * 0.99 >= reach[1]).all()


def test_scattering_multiplies_albedos() -> None:
    """Half of the scattering is half of the albedo, and none is the light of black matter."""
    field = noise((13, 9, 11), 4.0)
    for factor, same in ((0.5, 0.4), (0.0, 0.0)):
        sources = lights(irradiance=2.0)._replace(scattering=factor)
        found = compute_radiance_grid([matter_of(field, 0.8)], sources, cell_voxels=1)
        expected = compute_radiance_grid([matter_of(field, same)], lights(irradiance=2.0), cell_voxels=1)
        np.testing.assert_allclose(found.mean_radiance, expected.mean_radiance, atol=0.01)


def test_flux_gives_the_irradiance_of_surfaces() -> None:
    """Above and below an opaque, black plane: pi of the sky, and nothing."""
    grid = compute_radiance_grid([matter_of(even((40, 40, 4), 40.0), 0.0)], lights(), cell_voxels=1, with_flux=True)
    assert grid.flux is not None
    light, flux = grid.mean_radiance[-1, 21, 21, 0], grid.flux[-1, 21, 21, :, 0]
    assert np.pi * (light + 2 * flux[2]) == pytest.approx(np.pi, rel=0.02)
    assert np.pi * (light - 2 * flux[2]) == pytest.approx(0, abs=0.06)
    np.testing.assert_allclose(flux[:2], 0, atol=0.01)


@pytest.mark.parametrize("num_threads", [2, 5])
def test_bytes_do_not_depend_on_threads(num_threads: int) -> None:
    layer = matter_of(noise((40, 35, 30), 2.0), (0.9, 0.5, 0.2))
    sky = np.array([[0.5, 0.4, 0.3], [0.3, 0.2, 0.1], [0.1, 0.1, 0.0]])
    sources = lights(sky, key=(0.6, 0.48, 0.64), radius=14.0, irradiance=1.0)
    one, other = (
        compute_radiance_grid([layer], sources, cell_voxels=1, with_flux=True, num_threads=num)
        for num in (1, num_threads)
    )
    for first, second in zip([*one[:-1], *one.matter], [*other[:-1], *other.matter], strict=True):
        np.testing.assert_array_equal(first, second)
    assert one.num_rounds > 3


@pytest.mark.parametrize("strength", [1e-30, 1e30])
def test_light_is_proportional_to_its_strength(strength: float) -> None:
    layer = matter_of(noise((9, 9, 9), 2.0), 0.9)
    one, other = (
        compute_radiance_grid([layer], lights(EVEN * factor, irradiance=factor), cell_voxels=1)
        for factor in (1.0, strength)
    )
    np.testing.assert_allclose(other.mean_radiance / strength, one.mean_radiance, rtol=1e-5)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 1e31])
def test_strengths_that_are_no_light_are_refused(wrong: float) -> None:
    layer = matter_of(even((1, 1, 1), 1.0))
    with pytest.raises(InputError, match="strength"):
        compute_radiance_grid([layer], lights(np.where(EVEN > 0, wrong, 0.0)))
    with pytest.raises(InputError, match="strength"):
        compute_radiance_grid([layer], lights(irradiance=20 * wrong))
    with pytest.raises(InputError, match="strength"):
        compute_radiance_grid([layer], lights(irradiance=-1.0))


def test_darkness_is_dark() -> None:
    grid = compute_radiance_grid([matter_of(even((4, 4, 4), 1.0))], lights(DARK))
    assert not grid.mean_radiance.any()


def test_memory_is_stated_and_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    layer, shape = matter_of(noise((46, 38, 30), 2.0), 0.9), (48, 40, 32)
    sources = lights(radius=14.0, irradiance=1.0)
    tracemalloc.start()
    grid = compute_radiance_grid([layer], sources, cell_voxels=1, with_flux=True)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert grid.mean_radiance.shape[2::-1] == shape
    assert 0.6 * solve_bytes(shape) < peak < solve_bytes(shape)
    monkeypatch.setattr("renderer.lighting.radiance_grid.free_bytes", lambda: solve_bytes(shape) - 1)
    with pytest.raises(InputError, match="memory"):
        compute_radiance_grid([layer], sources, cell_voxels=1)

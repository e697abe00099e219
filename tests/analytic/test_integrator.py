"""The ray integral against closed forms, an independent Riemann sum, its order of convergence and its symmetries."""

from __future__ import annotations

import gzip
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from renderer.camera import Float64, View
from renderer.camera_paths import make_view
from renderer.integrator import converged_image, integrate, world_rays
from renderer.scene import CameraSpec, ShadingSpec, TurntablePath, Vector
from renderer.volume import Volume

# float64 sums over a few hundred cells.
EXACT = 1e-13


@dataclass(frozen=True)
class Transfer:
    values: Float64
    colors: Float64
    extinctions: Float64


def transfer(*points: tuple[float, tuple[float, float, float], float]) -> Transfer:
    values, colors, extinctions = zip(*points, strict=True)
    return Transfer(np.array(values, float), np.array(colors, float), np.array(extinctions, float))


def volume(values: npt.ArrayLike, world_from_index: Float64 | None = None) -> Volume:
    voxels = np.array(values, float)
    voxels.flags.writeable = False  # as in every Volume; the kernels are compiled for that
    return Volume(voxels, np.eye(4) if world_from_index is None else world_from_index, "test", "")


def oblique() -> Float64:
    """Anisotropic, rotated, sheared and shifted."""
    affine = np.eye(4)
    affine[:3, :3] = [[1.0, 0.3, 0.0], [-0.4, 0.7, 0.2], [0.1, 0.0, 2.5]]
    affine[:3, 3] = [3.0, -1.0, 0.5]
    return affine


def look(target: Vector, distance: float, size: tuple[int, int] = (24, 16), **camera: object) -> View:
    path = camera.pop("path", TurntablePath(1, 37.0, 21.0))
    return make_view(CameraSpec(path, **camera), 0, target, distance, size)  # type: ignore[arg-type]


def ray_lengths(of: Volume, view: View) -> Float64:
    """World length of each pixel's ray inside the volume, by the six half-spaces in world coordinates."""
    origins, directions, starts = world_rays(view, np.arange(view.size[0] * view.size[1]))
    enter, leave = starts.copy(), np.full(starts.shape, np.inf)
    index_from_world = np.linalg.inv(of.world_from_index)
    for axis in range(3):
        at = origins @ index_from_world[axis, :3] + index_from_world[axis, 3]
        speed = directions @ index_from_world[axis, :3]
        near, far = np.sort([(-0.5 - at) / speed, (of.shape_xyz[axis] - 0.5 - at) / speed], axis=0)
        enter, leave = np.maximum(enter, near), np.minimum(leave, far)
    return np.maximum(leave - enter, 0.0).reshape(view.size[::-1])


def riemann(of: Volume, tf: Transfer, view: View, num_steps: int, shading: ShadingSpec | None = None) -> Float64:
    """The same integral by nothing but the definition: `num_steps` midpoints per ray, field and gradient from numpy."""
    values = of.values.astype(float)
    gradients = [np.gradient(values, axis=2 - axis) for axis in range(3)]
    index_from_world = np.linalg.inv(of.world_from_index)
    origins, directions, starts = world_rays(view, np.arange(view.size[0] * view.size[1]))
    origins, directions = (
        origins @ index_from_world[:3, :3].T + index_from_world[:3, 3],
        directions @ index_from_world[:3, :3].T,
    )
    image = np.zeros((len(starts), 4))
    shape = np.array(of.shape_xyz)
    for i, (origin, direction, start) in enumerate(zip(origins, directions, starts, strict=True)):
        near, far = np.sort([(-0.5 - origin) / direction, (shape - 0.5 - origin) / direction], axis=0)
        enter, leave = max(start, near.max()), far.min()
        if not enter < leave:
            continue
        ds = (leave - enter) / num_steps
        index = np.clip(origin + (enter + (np.arange(num_steps) + 0.5) * ds)[:, None] * direction, 0, shape - 1)
        field = interpolate(values, index)
        color = np.stack([np.interp(field, tf.values, tf.colors[:, k]) for k in range(3)], axis=1)
        if shading is not None:
            gradient = np.stack([interpolate(g, index) for g in gradients], axis=1) @ index_from_world[:3, :3]
            cosine = (
                -gradient @ (np.array(shading.light) / np.linalg.norm(shading.light)) / np.linalg.norm(gradient, axis=1)
            )
            color *= (shading.ambient + shading.diffuse * np.maximum(0.0, cosine))[:, None]
        depth = np.interp(field, tf.values, tf.extinctions) * ds
        before = np.cumsum(depth) - depth
        image[i, :3] = (np.exp(-before) * -np.expm1(-depth)) @ color
        image[i, 3] = -np.expm1(-depth.sum())
    return image.reshape(view.size[1], view.size[0], 4)


def interpolate(values: Float64, index: Float64) -> Float64:
    """Trilinear interpolation at [n, 3] points (x, y, z)."""
    low = np.minimum(np.floor(index).astype(int), np.array(values.shape[::-1]) - 2)
    total = np.zeros(len(index))
    for corner in np.ndindex(2, 2, 2):
        x, y, z = (low + corner).T
        total += np.prod(np.where(corner, index - low, 1 - (index - low)), axis=1) * values[z, y, x]
    return total


COLORFUL = transfer((-0.5, (1, 0, 0.5), 0.2), (0.3, (0, 1, 0.2), 0.9), (0.8, (0.3, 0.2, 1), 0.0), (1.5, (1, 1, 0), 1.3))


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("distance", [12.0, 1.0])
def test_homogeneous_medium_obeys_beer_and_lambert(projection: str, distance: float) -> None:
    """At distance 1 the eye, or the eye plane, is inside the volume, which is oblique, sheared and anisotropic."""
    slab = volume(np.full((4, 5, 6), 7.0), oblique())
    color, tau = (0.2, 0.7, 1.0), 0.3
    view = look(tuple(slab.centre), distance, projection=projection, near=0.25)
    alpha = -np.expm1(-tau * ray_lengths(slab, view))
    image = integrate(slab, transfer((0.0, color, tau)), view, step_voxels=1.0)
    np.testing.assert_allclose(image[..., 3], alpha, atol=EXACT)
    np.testing.assert_allclose(image[..., :3], alpha[..., None] * color, atol=EXACT)
    assert np.count_nonzero(alpha) > 0


def along_z(values: list[float], tf: Transfer, step_voxels: float = 1.0, spacing: float = 1.0) -> Float64:
    """One ray along -z, from the last of a column of voxels to the first."""
    column = volume(np.reshape(values, (-1, 1, 1)), np.diag([1.0, 1.0, spacing, 1.0]))
    view = look((0.0, 0.0, 0.0), 100.0, (1, 1), projection="orthographic", path=TurntablePath(1, 0.0, 90.0))
    return integrate(column, tf, view, step_voxels=step_voxels)[0, 0]


def test_linear_ramp_of_extinction() -> None:
    """Values 0 to 4, tau = value / 10: 0 and 0.4 over the outer half voxels, int_0^4 s / 10 ds = 0.8 between."""
    image = along_z([0, 1, 2, 3, 4], transfer((0, (1, 0.5, 0), 0), (10, (1, 0.5, 0), 1)))
    alpha = -np.expm1(-(0.8 + 0.4 / 2))
    np.testing.assert_allclose(image, [alpha, alpha / 2, 0, alpha], atol=EXACT)


def test_linear_ramp_of_color() -> None:
    """Constant tau, colour falling from 1 to 0 over a cell of length 2: the integral of (1 - s / 2) tau exp(-tau s)."""
    tau, length = 0.7, 2.0
    image = along_z([0, 1], transfer((0, (0, 0, 0), tau), (1, (1, 1, 1), tau)), spacing=length)
    depth = tau * length
    cell = 1.0 - (-np.expm1(-depth)) / depth
    expected = -np.expm1(-depth / 2) + np.exp(-depth / 2) * cell
    # Quadrature of the eighth order on steps of 0.7 in optical depth.
    np.testing.assert_allclose(image[:3], expected, atol=1e-10)
    assert image[3] == pytest.approx(-np.expm1(-2 * depth), abs=EXACT)


def test_step_lies_exactly_where_the_field_crosses_it() -> None:
    """Opaque from 0.25 up on a column 1, 0: half a voxel and three quarters of the cell."""
    step = transfer((0.25, (1, 1, 1), 0.0), (0.25, (1, 1, 1), 2.0))
    assert along_z([0, 1], step)[3] == pytest.approx(-np.expm1(-2 * 1.25), abs=EXACT)


@pytest.mark.parametrize(
    ("azimuth", "elevation", "axis"), [(0, 0, 1), (180, 0, 1), (90, 0, 2), (0, 90, 0), (0, -90, 0)]
)
def test_rays_along_rows_of_voxel_centres_see_their_sums(azimuth: float, elevation: float, axis: int) -> None:
    """Extinction a tenth of the value: trapezoids and the two outer half voxels add up to the plain sum of a row."""
    cube = volume(np.random.default_rng(12).integers(0, 9, (5, 5, 5)))
    fov = 2 * np.degrees(np.arctan(2.5 / 50.0))  # one pixel per voxel
    path = TurntablePath(1, azimuth, elevation)
    view = look(tuple(cube.centre), 50.0, (5, 5), projection="orthographic", field_of_view=fov, path=path)
    image = integrate(cube, transfer((0, (1, 1, 1), 0), (10, (1, 1, 1), 1)), view, step_voxels=1.0)
    # Which row lands where is another test's matter.
    expected = -np.expm1(-0.1 * cube.values.sum(axis=axis))
    np.testing.assert_allclose(np.sort(image[..., 3], axis=None), np.sort(expected, axis=None), atol=1e-12)


@pytest.mark.parametrize(("value", "alpha"), [(0.25, -np.expm1(-2.0)), (np.nextafter(0.25, 0), 0.0)])
def test_at_a_step_the_value_belongs_to_the_upper_side(value: float, alpha: float) -> None:
    step = transfer((0.25, (1, 1, 1), 0.0), (0.25, (1, 1, 1), 2.0))
    assert along_z([value], step)[3] == pytest.approx(alpha, abs=EXACT)


def test_a_shell_much_thinner_than_any_step_is_not_missed() -> None:
    """A hat of 1e7 extinction and half-width 1e-7 in a value that rises by 3 per voxel: a depth of 1/3, twice."""
    hat = transfer((0.5 - 1e-7, (1, 1, 1), 0.0), (0.5, (1, 1, 1), 1e7), (0.5 + 1e-7, (1, 1, 1), 0.0))
    # 0.5 has lost 7 of its 16 digits within the hat.
    assert along_z([0, 3, 0], hat)[3] == pytest.approx(-np.expm1(-2 / 3), abs=1e-8)


def test_nothing_is_seen_behind_what_is_opaque() -> None:
    wall = transfer((0, (0, 1, 0), 1.0), (1, (1, 0, 0), 40.0))
    np.testing.assert_allclose(along_z([0, 0, 1, 1], wall), [1, 0, 0, 1], atol=1e-12)


def test_faint_media_keep_all_their_digits() -> None:
    image = along_z([1, 1, 1], transfer((1, (1, 0.5, 0), 1e-14)))
    # The length of 3 is a difference of places 100 away, which are rounded to 1.4e-14.
    np.testing.assert_allclose(image, [3e-14, 1.5e-14, 0, 3e-14], rtol=1e-13)


@pytest.mark.parametrize("distance", [9.0, 1.3])
@pytest.mark.parametrize("shading", [None, ShadingSpec(0.2, 0.8, (1.0, 2.0, 3.0))])
def test_the_integral_is_the_limit_of_the_riemann_sum(shading: ShadingSpec | None, distance: float) -> None:
    noise = volume(np.random.default_rng(3).uniform(-1, 2, (4, 5, 6)), oblique())
    view = look(tuple(noise.centre), distance, (6, 5), field_of_view=50.0)
    tolerance = 1e-8
    image, report = converged_image(noise, COLORFUL, view, tolerance=tolerance, shading=shading)
    errors = [np.abs(riemann(noise, COLORFUL, view, n, shading) - image).max() for n in (500, 8_000)]
    # Midpoints are of second order where the colour is continuous: 256 is due, 200 to 430 and 1.2e-7 were seen.
    assert errors[1] < errors[0] / 100
    assert errors[1] < 2e-7
    assert report.change[-1] < tolerance


def test_the_error_falls_with_the_eighth_power_of_the_step() -> None:
    """One cell of length 8, so that a voxel is an optical depth of up to 0.96; 8.1 and 7.7 were seen."""
    field = volume(np.random.default_rng(7).uniform(0, 1, (2, 2, 2)), np.diag([8.0, 8.0, 8.0, 1.0]))
    ramp = transfer((0, (0, 1, 0.5), 0.01), (1, (1, 0, 0.2), 0.12))
    view = look(tuple(field.centre), 60.0, (8, 8), field_of_view=10.0)
    reference = integrate(field, ramp, view, step_voxels=1 / 16)
    errors = [np.abs(integrate(field, ramp, view, step_voxels=step) - reference).max() for step in (1.0, 0.5, 0.25)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert orders.min() > 7


def test_resampling_units_changes_nothing() -> None:
    """Ten times the spacing, a tenth of the extinction, ten times the distance."""
    values = np.random.default_rng(4).uniform(-1, 2, (3, 4, 5))
    small, large = volume(values), volume(values, np.diag([10.0, 10.0, 10.0, 1.0]))
    thin = replace(COLORFUL, extinctions=COLORFUL.extinctions / 10)
    images = [
        integrate(of, tf, look(tuple(of.centre), distance), step_voxels=1.0)
        for of, tf, distance in ((small, COLORFUL, 15.0), (large, thin, 150.0))
    ]
    np.testing.assert_allclose(images[0], images[1], atol=1e-12)


def test_how_the_voxels_are_stored_changes_nothing() -> None:
    """The same field with its axes permuted and one reversed, its affine adapted, shading included."""
    values = np.random.default_rng(6).uniform(-1, 2, (3, 4, 5))
    stored = volume(values, oblique())
    # New index (i, j, k) holds the voxel that was (x, y, z) = (j, k, 2 - i).
    old_from_new = np.array([[0, 1, 0, 0], [0, 0, 1, 0], [-1, 0, 0, 2], [0, 0, 0, 1]], float)
    other = volume(np.ascontiguousarray(values[::-1].transpose(1, 2, 0)), oblique() @ old_from_new)
    view = look(tuple(stored.centre), 14.0)
    images = [integrate(of, COLORFUL, view, step_voxels=1.0, shading=ShadingSpec()) for of in (stored, other)]
    np.testing.assert_allclose(images[0], images[1], atol=1e-10)


def test_turning_the_world_with_the_camera_changes_nothing() -> None:
    values = np.random.default_rng(8).uniform(-1, 2, (3, 4, 5))
    images = []
    for azimuth in (0.0, 50.0):
        c, s = np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth))
        turn = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        turned = volume(values, turn @ oblique())
        light = tuple(turn[:3, :3] @ [1.0, -1.0, 1.0])
        view = look(tuple(turned.centre), 14.0, path=TurntablePath(1, 20.0 + azimuth, 15.0))
        images.append(integrate(turned, COLORFUL, view, step_voxels=1.0, shading=ShadingSpec(light=light)))
    np.testing.assert_allclose(images[0], images[1], atol=1e-10)


def test_light_on_a_plane_is_lamberts_cosine() -> None:
    """A ramp along z has the gradient +z, so that n = -z; two equal voxels in a row have none, which is `ambient`."""
    white = transfer((0, (1, 1, 1), 0.5))
    for values, light, factor in (
        ([0, 1, 2], (0.0, 3.0, -4.0), 0.25 + 0.5 * 0.8),
        ([0, 1, 2], (0.0, 3.0, 4.0), 0.25),
        ([1, 1, 1], (0.0, 0.0, 1.0), 0.25),
    ):
        column = volume(np.reshape(np.array(values, float), (3, 1, 1)))
        view = look((0.0, 0.0, 1.0), 100.0, (1, 1), projection="orthographic", path=TurntablePath(1, 0.0, 90.0))
        image = integrate(column, white, view, step_voxels=1.0, shading=ShadingSpec(0.25, 0.5, light))
        assert image[0, 0, 0] == pytest.approx(factor * -np.expm1(-1.5), abs=EXACT)


def test_half_precision_voxels_are_taken_as_they_are() -> None:
    values = np.random.default_rng(10).uniform(-1, 2, (2, 2, 2)).astype(np.float16)
    view = look((0.5, 0.5, 0.5), 9.0, (3, 3))
    half = integrate(Volume(values, np.eye(4), "half", ""), COLORFUL, view, step_voxels=1.0)
    np.testing.assert_allclose(half, integrate(volume(values), COLORFUL, view, step_voxels=1.0), atol=EXACT)


def test_the_image_is_the_same_bytes_every_time(monkeypatch: pytest.MonkeyPatch) -> None:
    noise = volume(np.random.default_rng(9).uniform(-1, 2, (5, 5, 5)))
    view = look(tuple(noise.centre), 20.0)
    image = integrate(noise, COLORFUL, view, step_voxels=1.0)
    monkeypatch.setattr("renderer.integrator._RAYS_PER_TASK", 7)
    assert integrate(noise, COLORFUL, view, step_voxels=1.0).tobytes() == image.tobytes()


def test_row_0_is_the_top_and_column_0_the_left() -> None:
    """Seen from -y with +z up, the voxel of largest x and z is at the top right."""
    values = np.zeros((3, 3, 3))
    values[2, 1, 2] = 1.0
    view = look((1.0, 1.0, 1.0), 20.0, (9, 9), path=TurntablePath(1))
    image = integrate(volume(values), transfer((0, (1, 1, 1), 0), (1, (1, 1, 1), 5)), view, step_voxels=1.0)
    row, column = np.unravel_index(image[..., 3].argmax(), (9, 9))
    assert row < 4 < column


@pytest.mark.real_data
@pytest.mark.parametrize(("name", "shape"), [("engine", (128, 256, 256)), ("bonsai", (256, 256, 256))])
def test_scans_converge(data_dir: Path, name: str, shape: tuple[int, int, int]) -> None:
    voxels = np.frombuffer(gzip.decompress((data_dir / f"{name}.raw.gz").read_bytes()), np.uint8).reshape(shape)
    scan = Volume(voxels, np.eye(4), name, "")
    tf = transfer((0, (0, 0, 0), 0), (60, (0.3, 0.4, 0.8), 0), (90, (0.4, 0.5, 0.9), 0.01), (255, (1, 0.9, 0.7), 0.8))
    view = look(tuple(scan.centre), 700.0, (64, 64))
    image, report = converged_image(scan, tf, view, tolerance=1e-6)
    assert report.change[0] < 1e-6
    # Three rays side by side through the thick of it: 100 000 midpoints of less than 0.005 voxels each.
    middle = replace(view, size=(3, 1))
    expected, _ = converged_image(scan, tf, middle, tolerance=1e-6)
    np.testing.assert_allclose(riemann(scan, tf, middle, 100_000), expected, atol=1e-5)
    assert image[..., 3].max() > 0.9

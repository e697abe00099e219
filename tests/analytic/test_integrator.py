"""The ray integral against closed forms, an independent Riemann sum, its order of convergence and its symmetries."""

from __future__ import annotations

from dataclasses import replace

import mpmath
import numpy as np
import pytest
from brickwork import transfer_of
from ray_integrals import COLORFUL, EXACT, along_z, converged_image, integrate, look, oblique, ray_spans, volume

from renderer.scene import ShadingSpec, TurntablePath
from renderer.transfer import TransferFunction
from renderer.volume import Float64, Volume, make_volume


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("distance", [20.0, 1.0])
@pytest.mark.parametrize("shading", [None, ShadingSpec(0.3, 0.6, (-1.0, 0.5, 2.0))])
def test_linear_field_in_an_oblique_volume(projection: str, distance: float, shading: ShadingSpec | None) -> None:
    """Extinction linear in the value, the value linear in the index: a sum of integrals of one index, clamped, each.

    Colour and gradient are constant, so that there is one light factor. At distance 1 the eye, or its plane, is inside.
    """
    shape, slopes = np.array([6, 5, 4]), np.array([0.5, 0.2, -0.3])
    z, y, x = np.mgrid[:4, :5, :6]
    field = volume(1.0 + x * slopes[0] + y * slopes[1] + z * slopes[2], oblique())
    view = look(tuple(field.centre), distance, projection=projection, near=0.25)
    span = ray_spans(field, view)

    def integral_of_clamped(index: Float64) -> Float64:
        inside = np.clip(index, 0, shape - 1)
        return inside**2 / 2 + (shape - 1) * np.maximum(index - (shape - 1), 0)

    at_end = span.index_at_start + span.length[:, None] * span.index_per_length
    of_index = (integral_of_clamped(at_end) - integral_of_clamped(span.index_at_start)) / span.index_per_length
    depth = 0.1 * (span.length + of_index @ slopes)
    factor, color = 1.0, np.array([0.2, 0.7, 1.0])
    if shading is not None:
        gradient = slopes @ np.linalg.inv(oblique()[:3, :3])
        cosine = -gradient @ shading.light / np.linalg.norm(gradient) / np.linalg.norm(shading.light)
        assert cosine > 0.1
        factor = shading.ambient + shading.diffuse * cosine
    alpha = -np.expm1(-depth).reshape(view.size[::-1])
    ramp = transfer_of((-10.0, tuple(color), 0.0), (0.0, tuple(color), 0.0), (10.0, tuple(color), 1.0))
    image = integrate(field, ramp, view, step_voxels=1.0, shading=shading)
    # The closed form divides differences of squares by speeds that may be small: 4e-14 was seen.
    np.testing.assert_allclose(image[..., 3], alpha, atol=1e-12)
    np.testing.assert_allclose(image[..., :3], alpha[..., None] * color * factor, atol=1e-12)
    assert 0.3 < alpha.max() < 0.95


WHITE = (1, 1, 1)
STEP = transfer_of((0.25, WHITE, 0.0), (0.25, WHITE, 2.0))
HAT = transfer_of((0.5 - 1e-7, WHITE, 0.0), (0.5, WHITE, 1e7), (0.5 + 1e-7, WHITE, 0.0))


@pytest.mark.parametrize(
    ("values", "transfer", "depth", "precision"),
    [
        ([0, 1], STEP, 2 * 1.25, EXACT),  # where the field crosses it: half a voxel and three quarters of the cell
        ([0.25], STEP, 2.0, EXACT),  # the value belongs to the upper side
        ([np.nextafter(0.25, 0)], STEP, 0.0, EXACT),
        # Much thinner than any step, half as wide as 1e-7 and met twice; 0.5 has lost 7 of its 16 digits there.
        ([0, 3, 0], HAT, 2 / 3, 1e-8),
    ],
)
def test_steps_and_thin_shells(values: list[float], transfer: TransferFunction, depth: float, precision: float) -> None:
    assert along_z(values, transfer)[3] == pytest.approx(-np.expm1(-depth), abs=precision)


def test_nothing_is_seen_behind_what_is_opaque() -> None:
    wall = transfer_of((0, (0, 1, 0), 1.0), (1, (1, 0, 0), 40.0))
    np.testing.assert_allclose(along_z([0, 0, 1, 1], wall), [1, 0, 0, 1], atol=1e-12)


def test_opacities_are_right_to_the_last_place() -> None:
    """Of one voxel; the exponential has an error below one unit at any depth."""
    view = look((0.0, 0.0, 1.0), 100.0, (1, 1), projection="orthographic", path=TurntablePath(1, 0.0, 90.0))
    for depth in 10.0 ** np.random.default_rng(2).uniform(-300.0, 1.5, 300):
        image = integrate(
            volume(np.zeros((1, 1, 1))), transfer_of((0.0, (1.0, 1.0, 1.0), depth)), view, step_voxels=1.0
        )
        exact = float(-mpmath.expm1(-mpmath.mpf(depth)))
        assert abs(image[0, 0, 3] - exact) <= np.spacing(exact), depth


def test_faint_media_keep_all_their_digits() -> None:
    image = along_z([1, 1, 1], transfer_of((1, (1, 0.5, 0), 1e-14)))
    # The length of 3 is a difference of places 100 away, which are rounded to 1.4e-14.
    np.testing.assert_allclose(image, [3e-14, 1.5e-14, 0, 3e-14], rtol=1e-13)


@pytest.mark.parametrize("shape", [(9, 4, 14), (1, 5, 8), (13, 1, 1), (1, 1, 1)])
@pytest.mark.parametrize("dtype", ["uint8", "float32", "float64"])
def test_skipped_macrocells_are_transparent(shape: tuple[int, int, int], dtype: str) -> None:
    """A fog so faint that it changes no digit, but prevents all skipping, gives the same image."""
    rng = np.random.default_rng(11)
    values = np.where(rng.uniform(size=shape) < 0.03, 100, 10).astype(dtype)
    values.flat[rng.integers(values.size)] = 100
    values.flags.writeable = False
    sparse = make_volume(values, oblique(), "test")
    shell = transfer_of(
        (10, (1, 0, 0), 0), (60, (1, 0, 0), 0), (60, (0, 1, 0.5), 3), (70, (0, 0, 1), 0), (100, (1, 1, 1), 0)
    )
    fog = replace(shell, extinctions=np.maximum(shell.extinctions, 1e-200))
    largest = 0.0
    for distance, projection in ((25.0, "perspective"), (25.0, "orthographic"), (1.5, "perspective")):
        view = look(tuple(sparse.centre), distance, (20, 20), projection=projection, field_of_view=50.0)
        images = [integrate(sparse, tf, view, step_voxels=1.0) for tf in (shell, fog)]
        np.testing.assert_allclose(images[0], images[1], atol=1e-15)
        largest = max(largest, images[0][..., 3].max())
    assert (largest > 0) == (values.size > 1)  # of a shell between 60 and 100 a lone voxel has nothing


def test_threads_and_tasks_change_no_byte(monkeypatch: pytest.MonkeyPatch) -> None:
    """The image depends neither on the number of threads nor on how rays are grouped into tasks."""
    noise = volume(np.random.default_rng(9).uniform(-1, 2, (9, 9, 9)) ** 3)
    view = look(tuple(noise.centre), 30.0)
    image, _ = converged_image(noise, COLORFUL, view, tolerance=1e-6, num_threads=1)
    monkeypatch.setattr("renderer.truth.integrator._RAYS_PER_TASK", 7)
    for num_threads in (1, 2, 5):
        again, _ = converged_image(noise, COLORFUL, view, tolerance=1e-6, num_threads=num_threads)
        assert again.tobytes() == image.tobytes()


@pytest.mark.parametrize("dtype", [np.uint8, np.int32, np.float16, np.float32])
def test_no_pass_over_the_values_comes_before_the_first_ray(dtype: type, monkeypatch: pytest.MonkeyPatch) -> None:
    """They may lie in a large file, of which a few rays need little."""
    block = make_volume(np.full((3, 3, 3), 1, dtype), np.eye(4), "block")
    view = look(tuple(block.centre), 9.0, (4, 4))
    expected = integrate(volume(block.values.astype(float)), COLORFUL, view, step_voxels=1.0)
    monkeypatch.delattr(Volume, "value_range")
    image = integrate(block, COLORFUL, view, step_voxels=1.0)
    assert image[..., 3].max() > 0
    np.testing.assert_allclose(image, expected, atol=EXACT)

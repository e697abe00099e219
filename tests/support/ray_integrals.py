"""Fields and views for tests of the ray integral, and sums to compare it with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from brickwork import transfer_of

from renderer.scene import CameraSpec, ShadingSpec, TurntablePath, Vector
from renderer.transfer import TransferFunction
from renderer.truth import Convergence, Progress, RayIntegrator, TrueLayer, ignore, pixel_centres, rays_through
from renderer.view import View, make_view
from renderer.volume import Float64, Volume, make_volume

# The largest error that rounding of float64 causes in sums over a few hundred cells.
EXACT = 1e-13


def volume(values: npt.ArrayLike, world_from_index: Float64 | None = None) -> Volume:
    voxels = np.array(values, float)
    voxels.flags.writeable = False  # as in every Volume; the kernels are compiled for that
    return make_volume(voxels, np.eye(4) if world_from_index is None else world_from_index, "test")


def oblique() -> Float64:
    """Return an affine that is anisotropic, rotated, sheared and shifted."""
    affine = np.eye(4)
    affine[:3, :3] = [[1.0, 0.3, 0.0], [-0.4, 0.7, 0.2], [0.1, 0.0, 2.5]]
    affine[:3, 3] = [3.0, -1.0, 0.5]
    return affine


def look(target: Vector, distance: float, size: tuple[int, int] = (24, 16), **camera: object) -> View:
    path = camera.pop("path", TurntablePath(1, 37.0, 21.0))
    return make_view(CameraSpec(path, **camera), 0, target, distance, size)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Span:
    """The part of each pixel's ray that is inside a volume.

    index_at_start: the point where the ray enters, in index coordinates, [pixels, 3]. index_per_length: its direction
    in index coordinates, per length in the world, [pixels, 3]. length: the length in the world, [pixels].
    """

    index_at_start: Float64
    index_per_length: Float64
    length: Float64


def integrate(
    of: Volume,
    tf: TransferFunction,
    view: View,
    *,
    step_voxels: float,
    shading: ShadingSpec | None = None,
    num_threads: int = 2,
    on_progress: Progress = ignore,
) -> Float64:
    """The image [h, w, 4] of rays through the centres of pixels, premultiplied RGBA."""
    integrator = RayIntegrator([TrueLayer(of, tf, shading)], num_threads=num_threads)
    image = integrator.integrate(view, pixel_centres(view.size), [step_voxels], on_progress)
    return image.reshape(view.size[1], view.size[0], 4)


def converged_image(
    of: Volume, tf: TransferFunction, view: View, tolerance: float, shading: ShadingSpec | None = None, **options: Any
) -> tuple[Float64, Convergence]:
    """Return the converged ray integral of each pixel, [h, w, 4], and its convergence.

    options: `num_threads`, and the options of RayIntegrator.converge, such as `on_progress`.
    """
    integrator = RayIntegrator([TrueLayer(of, tf, shading)], num_threads=options.pop("num_threads", 2))
    pixels, convergence = integrator.converge(view, pixel_centres(view.size), tolerance, **options)
    return pixels.reshape(view.size[1], view.size[0], 4), convergence


def ray_spans(of: Volume, view: View) -> Span:
    origins, directions, starts = rays_through(np.zeros(3), view, pixel_centres(view.size))
    enter, leave = starts.copy(), np.full(starts.shape, np.inf)
    index_from_world = np.linalg.inv(of.world_from_index)
    at = origins @ index_from_world[:3, :3].T + index_from_world[:3, 3]
    speed = directions @ index_from_world[:3, :3].T
    for axis in range(3):
        near, far = np.sort(
            [(-0.5 - at[:, axis]) / speed[:, axis], (of.shape_xyz[axis] - 0.5 - at[:, axis]) / speed[:, axis]], axis=0
        )
        enter, leave = np.maximum(enter, near), np.minimum(leave, far)
    return Span(at + enter[:, None] * speed, speed, np.maximum(leave - enter, 0.0))


def riemann(
    of: Volume, tf: TransferFunction, view: View, num_steps: int, shading: ShadingSpec | None = None
) -> Float64:
    """Return the ray integral of each pixel as a plain sum over `num_steps` midpoints a ray, in numpy: [h, w, 4]."""
    values = of.values.astype(float)
    gradients = [np.gradient(values, axis=2 - axis) for axis in range(3)]
    index_from_world = np.linalg.inv(of.world_from_index)
    origins, directions, starts = rays_through(np.zeros(3), view, pixel_centres(view.size))
    viewers = -directions
    origins, directions = (
        origins @ index_from_world[:3, :3].T + index_from_world[:3, 3],
        directions @ index_from_world[:3, :3].T,
    )
    image = np.zeros((len(starts), 4))
    shape = np.array(of.shape_xyz)
    for i, (origin, direction, start, viewer) in enumerate(zip(origins, directions, starts, viewers, strict=True)):
        near, far = np.sort([(-0.5 - origin) / direction, (shape - 0.5 - origin) / direction], axis=0)
        enter, leave = max(start, near.max()), far.min()
        if not enter < leave:
            continue
        ds = (leave - enter) / num_steps
        index = np.clip(origin + (enter + (np.arange(num_steps) + 0.5) * ds)[:, None] * direction, 0, shape - 1)
        field = interpolate(values, index)
        color = np.stack([np.interp(field, tf.values, tf.colors[:, k]) for k in range(3)], axis=1)
        depth = np.interp(field, tf.values, tf.extinctions) * ds
        if shading is not None:
            gradient = np.stack([interpolate(g, index) for g in gradients], axis=1) @ index_from_world[:3, :3]
            color = shade(shading, color, gradient, viewer)
            if shading.gradient_opacity:
                depth *= np.interp(np.linalg.norm(gradient, axis=1), *np.transpose(shading.gradient_opacity))
        before = np.cumsum(depth) - depth
        image[i, :3] = (np.exp(-before) * -np.expm1(-depth)) @ color
        image[i, 3] = -np.expm1(-depth.sum())
    return image.reshape(view.size[1], view.size[0], 4)


def shade(shading: ShadingSpec, color: Float64, gradient: Float64, viewer: Float64) -> Float64:
    """Return colours [n, 3] in the light of a shading, from the definitions of its terms."""
    light = viewer if isinstance(shading.light, str) else np.array(shading.light) / np.linalg.norm(shading.light)
    halfway = (light + viewer) / np.linalg.norm(light + viewer)
    normal = -gradient / np.linalg.norm(gradient, axis=1)[:, None]
    of_light, of_halfway = normal @ light, normal @ halfway
    if shading.two_sided:
        of_light, of_halfway = np.abs(of_light), np.abs(of_halfway)
    highlight = shading.specular * np.maximum(0.0, of_halfway) ** shading.shininess * (of_light > 0)
    lit = color * (shading.ambient + shading.diffuse * np.maximum(0.0, of_light))[:, None] + highlight[:, None]
    return np.asarray(lit * (1.0 - shading.silhouette * (1.0 - np.abs(normal @ viewer)) ** 3)[:, None])


def interpolate(values: Float64, index: Float64) -> Float64:
    """Return values [z, y, x], interpolated trilinearly at points (x, y, z), index: [n, 3]."""
    low = np.minimum(np.floor(index).astype(int), np.array(values.shape[::-1]) - 2)
    total = np.zeros(len(index))
    for corner in np.ndindex(2, 2, 2):
        x, y, z = (low + corner).T
        total += np.prod(np.where(corner, index - low, 1 - (index - low)), axis=1) * values[z, y, x]
    return total


COLORFUL = transfer_of(
    (-0.5, (1, 0, 0.5), 0.2), (0.3, (0, 1, 0.2), 0.9), (0.8, (0.3, 0.2, 1), 0.0), (1.5, (1, 1, 0), 1.3)
)


def along_z(values: list[float], tf: TransferFunction, step_voxels: float = 1.0, spacing: float = 1.0) -> Float64:
    """Return the RGBA of a ray along -z through a column of voxels, from the last value to the first."""
    column = volume(np.reshape(values, (-1, 1, 1)), np.diag([1.0, 1.0, spacing, 1.0]))
    view = look((0.0, 0.0, 0.0), 100.0, (1, 1), projection="orthographic", path=TurntablePath(1, 0.0, 90.0))
    return integrate(column, tf, view, step_voxels=step_voxels)[0, 0]

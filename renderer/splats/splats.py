"""Turn the cells of a cut into splats that a rasteriser can draw from any view.

A cell becomes an ellipsoid: a Gaussian of `sigma` cells along each of the cell's three edges. From any direction, the
ray integrals of that Gaussian are its footprint, a weight in optical depth. The footprint's integral over the plane
perpendicular to the ray is `tau * cell volume`, the *optical area* below. A pixel's alpha is `1 - exp(-tau w)`. The
paper's rule for doubling a cell, `1 - a_2 = (1 - a_1)^2`, doubles optical depths (Laur, Hanrahan 1991, section 3).

Lengths are in model units: relative to the volume's centre, and divided by half its diagonal, both in float64. So
neither a volume's size nor its place in the world costs precision in float32.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
import numpy.typing as npt

from renderer.errors import RenderError
from renderer.kernels import kernels
from renderer.pyramid import Cut
from renderer.scene import SplatSpec
from renderer.volume import Float32, Float64, Int32, Int64

# The radius at which the Gaussian footprint ends, in standard deviations. About 0.2 % of the default Gaussian lies
# outside.
GAUSSIAN_CUTOFF = 3.2
# The largest number of samples along a pixel's side.
_MAX_SAMPLES_ACROSS = 4
# The factor by which footprints may be widened. Where it is 1.03 to 1.06, one more sample along a pixel's side gains
# 0.02 to 0.3 dB; where it is 1.2, 1 to 1.3 dB.
_MAX_WIDENING = 1.1
# The tolerance from which on a pixel has one sample. Smaller cells gain more there, for the same time.
_MAX_SAMPLED_TOLERANCE = 0.3


@dataclass(frozen=True)
class GaussianFootprint:
    """A Gaussian footprint: the weights with which a splat is spread over pixels, without ripple in a grid of splats.

    The weight is `exp(-decay q) (c0 + c1 q + c2 q^2) - rim`, with q the squared distance from the centre in standard
    deviations, up to `cutoff`, where the weight is 0. A step at the cutoff, however small, would be visible where the
    rims of a row of splats cross a pixel's centre together.

    Plain Gaussians on a regular grid ripple: along an axis by `4 exp(-2 pi^2 sigma^2)`, 3 % at 0.5 cells and 11 % at
    0.425. Wide Gaussians blur: an engine at tolerance 0 has 35.4 dB with 0.5 cells, and 36.2 dB with this footprint at
    0.425, the default, which ripples by 0.6 %; at 0.40 it has 36.5 dB and ripples by 2.8 %. Here, a Gaussian of
    variance `s^2` loses its spectrum at the two lowest frequencies of the grid, `exp(-2 pi^2 s^2 f^2) (1 - f^2) (1 -
    f^2 / 2)` with f per cell. Its variance is then `s^2 + 3 / (4 pi^2)`, and in space, with `a = 1 / (4 pi^2 s^2)` and
    `u = r^2 / s^2`, the factor on the Gaussian `exp(-u / 2)` is `1 + 3/2 a (u - 2) + 1/2 a^2 (u^2 - 8 u + 8)`, which is
    nowhere negative for s > 0.26.

    decay, coefficients, rim: the constants of the weight: `decay`, (c0, c1, c2) and `rim`.
    cutoff: the radius of the footprint, in standard deviations.
    min_sigma_px: the smallest standard deviation, in pixels, to which narrower footprints are widened. Sampled at
        pixels, the sum of the weights of a footprint of 0.5 pixels varies with its position by at most 3.9 %.
    """

    name: ClassVar[Literal["gaussian"]] = "gaussian"
    # The names of the fields of this class that shaders get as uniforms.
    uniforms: ClassVar = ("cutoff", "decay", "coefficients", "rim", "min_sigma_px")

    decay: float
    coefficients: tuple[float, float, float]
    rim: float
    cutoff: float = GAUSSIAN_CUTOFF
    min_sigma_px: float = 0.5

    @classmethod
    def from_sigma(cls, sigma: float) -> GaussianFootprint:
        """Return the footprint for cells that are `1 / sigma` standard deviations wide; its integral is 1."""
        s2 = sigma**2 - 3 / (4 * math.pi**2)
        a, ratio = 1 / (4 * math.pi**2 * s2), sigma**2 / s2
        decay = ratio / 2
        shape = (1 - 3 * a + 4 * a**2, (1.5 * a - 4 * a**2) * ratio, 0.5 * a**2 * ratio**2)
        # The integral of exp(-decay q) q^k over the disc is pi k! / decay^(k + 1) times `partial[k]`, a share below 1
        # because of the cutoff.
        end = decay * GAUSSIAN_CUTOFF**2
        partial = [1 - math.exp(-end) * sum(end**j / math.factorial(j) for j in range(k + 1)) for k in range(3)]
        moments = [math.pi * math.factorial(k) / decay ** (k + 1) * partial[k] for k in range(3)]
        rim = math.exp(-end) * sum(c * GAUSSIAN_CUTOFF ** (2 * k) for k, c in enumerate(shape))
        integral = sum(c * moment for c, moment in zip(shape, moments, strict=True))
        integral -= rim * math.pi * GAUSSIAN_CUTOFF**2
        return cls(decay, (shape[0] / integral, shape[1] / integral, shape[2] / integral), rim / integral)


@dataclass(frozen=True)
class GouraudFootprint:
    """A footprint as in the paper: triangles around a centre, with linear weights (Laur and Hanrahan 1991, section 4).

    vertices: float64 [v, 2], the positions of vertices, in standard deviations; vertex 0 is the centre.
    weights: float64 [v], the weight at each vertex. Weights are linear in the triangles, with an integral of 1.
    triangles: int32 [t, 3], the indices of the vertices of each triangle.
    min_sigma_px: the smallest standard deviation, in pixels, to which narrower footprints are widened. It is larger
        than for Gaussians, because the edges between triangles alias.

    On the image the vertices lie at `centre + root @ vertex`, in pixels with row 0 at the top; `root` is the lower
    triangular root (Cholesky) of the footprint's covariance.
    """

    name: ClassVar[Literal["gouraud"]] = "gouraud"
    # The names of the fields of this class that shaders get as uniforms.
    uniforms: ClassVar = ("min_sigma_px",)

    vertices: Float64
    weights: Float64
    triangles: Int32
    min_sigma_px: float = 0.85

    @classmethod
    def from_spec(cls, spec: SplatSpec) -> GouraudFootprint:
        """Return the paper's footprint for a scene's settings.

        The footprint is scaled so that its integral is 1, and its standard deviation along an axis is 1.
        """
        angle = 2 * math.pi * np.arange(spec.angular) / spec.angular
        circle = np.column_stack([np.cos(angle), np.sin(angle)])
        radii = np.arange(1, spec.radial + 1) / spec.radial
        vertices = np.concatenate([np.zeros((1, 2)), *(radius * circle for radius in radii)])
        places = np.concatenate([[0.0], np.repeat(radii, spec.angular)])
        weights = np.interp(places, *np.array(spec.profile, np.float64).T)
        triangles = _triangulate_disc(spec.angular, spec.radial)
        mass, second_moment = _moments(vertices, weights, triangles)
        scale = math.sqrt(mass / second_moment)
        return cls(vertices * scale, weights / (mass * scale**2), triangles)

    @property
    def cutoff(self) -> float:
        """Return the outer radius of the footprint's mesh, in standard deviations."""
        return float(np.hypot(*self.vertices.T).max())


@dataclass(frozen=True)
class SplatBatch:
    """A batch of splats, in the order of their cut.

    vertices: float32 [n, 8], in the layout of the device: the centre [3] in model units and world axes; optical areas
        [4], (tau c V, tau V) in model units squared, the integral of the footprint; and the index of the shape.
    axes: float64 [num_shapes, 3, 3], whose columns are the Gaussian's standard deviation along each edge of the cell,
        as vectors in model units and world axes. The covariance is `axes @ axes.T`.
    origin: float64 [3], the world position of the model's origin, the volume's centre.
    model_unit: the world length of a model unit: half of the volume's diagonal.
    footprint: the Gaussian or Gouraud footprint. samples_across: the number of samples along a pixel's side; a pixel is
        the mean of its samples.
    """

    vertices: Float32
    axes: Float64
    origin: Float64
    model_unit: float
    footprint: GaussianFootprint | GouraudFootprint
    samples_across: int = 1

    def __post_init__(self) -> None:
        """Raise RenderError for splats that are not finite: such splats would vanish, or spoil half of the image."""
        if len(self.vertices) and not (np.isfinite(self.vertices.min()) and np.isfinite(self.vertices.max())):
            bad = np.flatnonzero(~np.isfinite(self.vertices).all(axis=1))
            raise RenderError(
                "splats that are not finite",
                got=f"{len(bad)} of {len(self.vertices)} splats, the first is number {bad[0]}: "
                f"{self.vertices[bad[0]].tolist()}",
                expected="finite centres and optical areas",
                hint="this is a fault of hsplat; please report it with the scene file",
            )

    def __len__(self) -> int:
        return len(self.vertices)

    @property
    def centers(self) -> Float32:
        """Return the centres of the splats, float32 [n, 3], as a view of the vertices."""
        return self.vertices[:, :3]


def samples_across_at(tolerance: float, cell_px: float, spec: SplatSpec) -> int:
    """Return the number of samples along a pixel's side at a tolerance.

    There are as many as show the footprints of the finest cells without widening them; decision 064 in docs/decisions
    has the measurements. cell_px: the width of the finest cells, in pixels.
    """
    if tolerance >= _MAX_SAMPLED_TOLERANCE:
        return 1
    widening = make_footprint(spec).min_sigma_px / max(spec.sigma * cell_px, 1e-9)
    return max(1, math.ceil(min(widening / _MAX_WIDENING, _MAX_SAMPLES_ACROSS)))


def make_splats(cut: Cut, spec: SplatSpec, *, samples_across: int = 1) -> SplatBatch:
    """Return a splat for each cell of the cut. Raises RenderError for splats that are not finite.

    samples_across: as of SplatBatch.
    """
    volume = cut.volume
    edges = volume.world_from_index[:3, :3]
    shape = np.array(volume.shape_xyz)
    length = volume.half_diagonal
    # Depths are for the finest spacing: a cell of n voxels has the optical area depth / spacing * n * voxel volume.
    area_unit = volume.voxel_volume / volume.finest_spacing / length**2
    codes = _shape_codes(cut)
    used = np.flatnonzero(np.bincount(codes))
    number_of_code = np.zeros(1 + int(codes.max(initial=0)), np.uint8)
    number_of_code[used] = np.arange(len(used))
    extents_of_shape = _extents_of_codes(used, shape)
    num_voxels = np.prod(extents_of_shape, axis=1, dtype=np.float64)
    if not spec.opacity_correction:  # without correction, a cell of any size has the opacity of a voxel
        num_voxels /= np.cbrt(num_voxels)
    shifts, areas = (extents_of_shape - shape) / 2, num_voxels * area_unit
    vertices = np.empty((len(cut), 8), np.float32)
    kernels().place_splats(
        levels=cut.levels, cells=cut.cells, depths=cut.depths, shapes=number_of_code[codes], shift_of_shape=shifts,
        area_of_shape=areas, model_from_index=edges / length, vertices=vertices,
    )  # fmt: skip
    axes = edges / length * (spec.sigma * extents_of_shape)[:, None, :]
    return SplatBatch(vertices, axes, volume.centre, length, make_footprint(spec), samples_across)


def _shape_codes(cut: Cut) -> npt.NDArray[np.uint16]:
    """Return `8 level + bits` for each cell, which is the same for cells of one shape: uint16 [n].

    The bits say along which of x, y and z the volume's border cuts the cell.
    """
    codes = cut.levels.astype(np.uint16) * np.uint16(8)
    for axis, num in enumerate(cut.volume.shape_xyz):
        last = np.array([(num - 1) >> level if num & ((1 << level) - 1) else -1 for level in range(64)])
        codes |= (cut.cells[:, axis] == last[cut.levels]).astype(np.uint16) << np.uint16(axis)
    return np.asarray(codes, np.uint16)


def _extents_of_codes(codes: Int64, shape: Int64) -> Int64:
    """Return the numbers of voxels along x, y, z of cells of some shapes: int64 [m, 3].

    codes: [m], the codes of the shapes, as in `_shape_codes`. shape: [3], the number of voxels of the volume.
    """
    sides = 1 << (codes[:, None] >> 3)
    is_cut = (codes[:, None] >> np.arange(3)) & 1 == 1
    return np.where(is_cut, shape % sides, sides)


def make_footprint(spec: SplatSpec) -> GaussianFootprint | GouraudFootprint:
    """Return the footprint for a scene's settings of splats."""
    return (
        GaussianFootprint.from_sigma(spec.sigma) if spec.footprint == "gaussian" else GouraudFootprint.from_spec(spec)
    )


def _triangulate_disc(angular: int, radial: int) -> Int32:
    """Return the triangles of a disc: a centre (vertex 0) and `radial` rings of `angular` vertices: int32 [n, 3]."""
    this = np.arange(angular)
    after = (this + 1) % angular
    triangles = [np.column_stack([np.zeros_like(this), 1 + this, 1 + after])]
    for ring in range(1, radial):
        inner, outer = 1 + (ring - 1) * angular, 1 + ring * angular
        triangles.append(np.column_stack([inner + this, outer + this, outer + after]))
        triangles.append(np.column_stack([inner + this, outer + after, inner + after]))
    return np.concatenate(triangles).astype(np.int32)


def _moments(vertices: Float64, weights: Float64, triangles: Int32) -> tuple[float, float]:
    """Return two integrals over a mesh with linear weights in its triangles: of the weight w, and of w (x^2 + y^2) / 2.

    The quadrature rule with the centroid and three more points is exact for the cubic integrand (Strang and Fix 1973).
    """
    corners, values = vertices[triangles], weights[triangles]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = 0.5 * np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    points = np.array([[1, 1, 1], [1.8, 0.6, 0.6], [0.6, 1.8, 0.6], [0.6, 0.6, 1.8]]) / 3
    shares = np.array([-27, 25, 25, 25]) / 48
    sampled = values @ points.T
    squares = 0.5 * np.sum((points @ corners) ** 2, axis=-1)
    return float(areas @ (sampled @ shares)), float(areas @ ((sampled * squares) @ shares))

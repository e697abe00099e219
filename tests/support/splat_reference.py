"""Rasterise splats in float64, one after the other: slow, and simple enough to check by eye.

The reference for `renderer.draw.splats.splat_rasterizer`. It shares its inputs and the limit of slopes (`SLOPE_LIMIT`)
with it, nothing else.
Lengths are world units; Gaussians are covariance matrices, as in the literature:

    Gaussian in view space -> its part beyond the near plane -> affine image about its centre -> widened to the pixels
                           -> weight at each pixel's centre -> alpha = 1 - exp(-optical depth) -> composited

M. Zwicker, H. Pfister, J. van Baar, M. Gross, "EWA Splatting", IEEE TVCG 8 (2002): the affine image;
N. L. Johnson, S. Kotz, N. Balakrishnan, "Continuous Univariate Distributions 1", chapter 13: the truncated normal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from renderer.splats import GaussianFootprint, GouraudFootprint, SplatBatch
from renderer.view import SLOPE_LIMIT, View
from renderer.volume import Bools, Float64, UInt32

# A splat whose centre lies more than this many standard deviations before the near plane is not drawn: the part beyond
# the plane is at most 3e-5 of its mass.
FARTHEST_CUT = 4.0


@dataclass(frozen=True)
class _Gaussian:
    """A Gaussian in the coordinates (right, up, away from the eye), in world units: mean [3], covariance [3, 3]."""

    mass: float
    mean: Float64
    covariance: Float64


@dataclass(frozen=True)
class _Ellipse:
    """A footprint on the image: centre (column, row) and covariance [2, 2], in pixels.

    unit_depth: the optical depth where the footprint's weight is 1.
    """

    center_px: Float64
    covariance_px: Float64
    unit_depth: float


def rasterize_reference(batch: SplatBatch, order: UInt32, view: View) -> Float64:
    """Return the picture of splats: float64 [height, width, 4], premultiplied RGBA.

    order: the numbers of the splats to draw, back to front.
    """
    image = np.zeros((view.size[1], view.size[0], 4))
    for index in order:
        areas = batch.vertices[index, 3:7].astype(np.float64)
        gaussian = _beyond(view.near, _in_view(batch, index, view))
        if areas[3] == 0.0 or gaussian.mass == 0.0:
            continue
        ellipse = _projected(gaussian, areas[3] * batch.model_unit**2, batch.footprint.min_sigma_px, view)
        rows, columns = _window(ellipse, batch.footprint.cutoff, view.size)
        x_px, y_px = np.meshgrid(np.arange(columns.start, columns.stop) + 0.5, np.arange(rows.start, rows.stop) + 0.5)
        if isinstance(batch.footprint, GaussianFootprint):
            alpha = _gaussian_alpha(batch.footprint, ellipse, x_px, y_px)
        else:
            alpha = _gouraud_alpha(batch.footprint, ellipse, x_px, y_px)
        source = alpha[..., None] * np.append(areas[:3] / areas[3], 1.0)
        image[rows, columns] = source + (1 - alpha[..., None]) * image[rows, columns]
    return image


def _in_view(batch: SplatBatch, index: int, view: View) -> _Gaussian:
    """Return the Gaussian of a splat, of mass 1, before the near plane cuts it."""
    rotation = np.diag([1.0, 1.0, -1.0]) @ view.axes
    from_target = (batch.origin - view.target) + batch.model_unit * batch.centers[index].astype(np.float64)
    axes_world = batch.model_unit * batch.axes[int(batch.vertices[index, 7])]
    covariance_world = axes_world @ axes_world.T
    mean = rotation @ from_target + (0.0, 0.0, view.distance)
    return _Gaussian(1.0, mean, rotation @ covariance_world @ rotation.T)


def _beyond(near: float, gaussian: _Gaussian) -> _Gaussian:
    """Return the Gaussian with the moments of the part of a Gaussian that lies at depths beyond `near`.

    Depth has a truncated normal distribution. Right and up follow depth by linear regression; their residuals do not
    change.
    """
    mean, covariance = gaussian.mean, gaussian.covariance
    sigma = math.sqrt(covariance[2, 2])
    a = (near - mean[2]) / sigma
    mass = 0.5 * math.erfc(a / math.sqrt(2))
    if a > FARTHEST_CUT:
        return _Gaussian(0.0, mean, covariance)
    hazard = math.exp(-0.5 * a**2) / math.sqrt(2 * math.pi) / mass
    variance_kept = 1 + a * hazard - hazard**2
    regression = covariance[:, 2] / covariance[2, 2]
    return _Gaussian(
        gaussian.mass * mass,
        mean + regression * sigma * hazard,
        covariance - (1 - variance_kept) * covariance[2, 2] * np.outer(regression, regression),
    )


def _projected(gaussian: _Gaussian, optical_area: float, min_sigma_px: float, view: View) -> _Ellipse:
    """Return the affine image of a Gaussian. optical_area: the integral of its optical depth across the rays."""
    size = np.array(view.size)
    right, up, depth = gaussian.mean
    if view.projection == "perspective":
        px_per_unit = view.scale_px / depth
        limit = SLOPE_LIMIT * size / 2 / view.scale_px
        slopes = np.clip([right / depth, up / depth], -limit, limit)
        # The derivatives of (column, row) by (right, up, away). A pixel on a plane that faces the ray is smaller by the
        # factor `slant`.
        jacobian = px_per_unit * np.array([[1.0, 0.0, -slopes[0]], [0.0, -1.0, slopes[1]]])
        slant = math.sqrt(1 + slopes @ slopes)
    else:
        px_per_unit, slant = view.scale_px, 1.0
        jacobian = px_per_unit * np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    variances, directions = np.linalg.eigh(jacobian @ gaussian.covariance @ jacobian.T)
    variances = np.maximum(variances, min_sigma_px**2)
    return _Ellipse(
        size / 2 + px_per_unit * np.array([right, -up]),
        directions @ np.diag(variances) @ directions.T,
        gaussian.mass * optical_area * px_per_unit**2 * slant / math.sqrt(variances[0] * variances[1]),
    )


def _window(ellipse: _Ellipse, cutoff: float, size: tuple[int, int]) -> tuple[slice, slice]:
    """Return the rows and the columns of the image that hold all pixels within `cutoff` standard deviations."""
    reach = cutoff * np.sqrt(np.diag(ellipse.covariance_px))
    low = np.clip(np.floor(ellipse.center_px - reach), 0, size).astype(int)
    high = np.clip(np.ceil(ellipse.center_px + reach), 0, size).astype(int)
    return slice(low[1], high[1]), slice(low[0], high[0])


def _gaussian_alpha(footprint: GaussianFootprint, ellipse: _Ellipse, x_px: Float64, y_px: Float64) -> Float64:
    """Return alpha from the footprint's weight at each pixel, float64 [rows, columns]."""
    offsets = np.stack([x_px - ellipse.center_px[0], y_px - ellipse.center_px[1]], axis=-1)
    q = np.einsum("...i,ij,...j", offsets, np.linalg.inv(ellipse.covariance_px), offsets)
    weight = np.exp(-footprint.decay * q) * np.polynomial.polynomial.polyval(q, footprint.coefficients)
    weight = np.maximum(weight - footprint.rim, 0.0)
    return np.where(q <= footprint.cutoff**2, -np.expm1(-ellipse.unit_depth * weight), 0.0)


def _gouraud_alpha(footprint: GouraudFootprint, ellipse: _Ellipse, x_px: Float64, y_px: Float64) -> Float64:
    """Return alpha at each pixel, float64 [rows, columns]: exact at vertices, and linear in each triangle."""
    vertices = ellipse.center_px + footprint.vertices @ np.linalg.cholesky(ellipse.covariance_px).T
    vertex_alpha = -np.expm1(-ellipse.unit_depth * footprint.weights)
    alpha = np.zeros_like(x_px)
    for triangle in footprint.triangles:
        inside, shares = _rasterized_triangle(vertices[triangle], x_px, y_px)
        alpha[inside] = (shares @ vertex_alpha[triangle])[inside]
    return alpha


def _rasterized_triangle(corners: Float64, x_px: Float64, y_px: Float64) -> tuple[Bools, Float64]:
    """Return which points a triangle holds, and the weights of its corners in linear interpolation, [..., 3].

    corners: [3, 2]. A point on an edge belongs to the triangle below the edge or to the right of it (top-left rule), so
    that every point where triangles meet belongs to exactly one.
    """
    if _side(corners[0], corners[1], *corners[2]) < 0:
        inside, shares = _rasterized_triangle(corners[::-1], x_px, y_px)
        return inside, shares[..., ::-1]
    inside, sides = np.ones(x_px.shape, bool), []
    for corner in range(3):
        start, end = corners[(corner + 1) % 3], corners[(corner + 2) % 3]
        side = _side(start, end, x_px, y_px)
        is_top_or_left = end[1] < start[1] or (end[1] == start[1] and end[0] > start[0])
        inside &= (side >= 0) if is_top_or_left else (side > 0)
        sides.append(side)
    shares = np.stack(sides, axis=-1)
    return inside, shares / np.sum(shares, axis=-1, keepdims=True)


def _side(start: Float64, end: Float64, x: Float64, y: Float64) -> Float64:
    """Return twice the signed area of the triangle (start, end, point).

    It is positive on the right of the edge, with y downwards. Exchanging start and end changes only the sign, so that
    two triangles at an edge agree on which side a point lies.
    """
    if tuple(start) > tuple(end):
        return -_side(end, start, x, y)
    return np.asarray((end[0] - start[0]) * (y - start[1]) - (end[1] - start[1]) * (x - start[0]))

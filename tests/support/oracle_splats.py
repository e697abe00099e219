"""The picture of a list of cells, from the definitions, with a bound on what rounding may change: see `oracle`.

    cell -> Gaussian in the world -> what lies beyond the near plane -> affine image about its centre
         -> widened to the pixels -> optical depth at each pixel -> alpha -> over

M. Zwicker, H. Pfister, J. van Baar, M. Gross, "EWA Splatting", IEEE TVCG 8 (2002): the affine image.
N. L. Johnson, S. Kotz, N. Balakrishnan, "Continuous Univariate Distributions 1", chapter 13: the truncated normal.

The renderer works in float32, with averages in float16 if the scene asks. Instead of one tolerance for all scenes,
each splat carries what that may do to it: how far its centre may be off in pixels, its size and its depth in parts of
themselves. At every pixel this gives the least and the largest alpha, which also covers pixels next to the rim of a
footprint, and the differences are composited along with the picture. So a scene seen through a field of view of a
hundredth of a degree has a wider bound than one seen as a whole, and both have one that follows from their numbers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from oracle import FLOAT32, Cells, DisagreementError, Field
from scipy.special import erfc, erfcx

from renderer.scene import Scene, SplatSpec
from renderer.splats import GaussianFootprint, GouraudFootprint
from renderer.splats.splats import GAUSSIAN_CUTOFF
from renderer.view import SLOPE_LIMIT, View

Float64 = npt.NDArray[np.float64]
Order = tuple[float, npt.NDArray[np.int64]]  # a share of the picture, and the cells back to front

# Rounding of a coordinate on its way through a matrix of float32, in units of the last place of its largest part.
ULPS = 6 * FLOAT32

# Sizes and depths of splats, and opacities: a few operations each, and the device's exponential, which GL leaves to it.
# Seen on llvmpipe: 1.4e-6 for alpha.
RELATIVE = 1e-5

# The same where the near plane cuts a splat: its moments are differences of larger numbers (see the parity tests).
RELATIVE_CUT = 3e-4

# The near plane leaves nothing of a splat that lies so many standard deviations before it: 3e-5 of its mass.
FARTHEST_CUT = 4.0

# The device places the vertices of triangles on a grid of this many pixels: llvmpipe's; GL guarantees 1/16.
SUBPIXEL = 1 / 256


@dataclass(frozen=True)
class Picture:
    """radiance: float64 [h, w, 4], premultiplied RGBA over nothing; the renderer's lies within `bound` of it."""

    radiance: Float64
    bound: Float64


@dataclass(frozen=True)
class _Footprints:
    """[n] each: centres [n, 2] in pixels (row 0 at the top), covariances [n, 2, 2], optical depth where the weight is 1
    and the cell has a depth of 1; how far the centre may be off in pixels, and size and depth in parts of themselves;
    by how many standard deviations the near plane lies beyond the centre, and how far off that may be; rounding of what
    the device interpolates."""

    center_px: Float64
    covariance_px: Float64
    unit_depth: Float64
    shift_px: Float64
    relative: Float64
    cut_at: Float64
    cut_slack: Float64
    rounding: Float64

    def describe(self, i: int) -> str:
        """One splat in words."""
        return (
            f"centre {self.center_px[i]} px, covariance {self.covariance_px[i].tolist()} px^2, depth "
            f"{self.unit_depth[i]:.3g}, near plane at {self.cut_at[i]:.3g} standard deviations"
        )


@dataclass(frozen=True)
class _Profile:
    """A footprint's weight by radius: in standard deviations for a Gaussian, that of the polygon for the paper's.

    decay, coefficients, rim: of a Gaussian.
    radii, weights: of rings, between which *alpha* is linear. corners: of a ring.
    """

    cutoff: float
    min_sigma_px: float
    decay: float = 0.0
    coefficients: tuple[float, ...] = ()
    rim: float = 0.0
    radii: Float64 = field(default_factory=lambda: np.empty(0))
    weights: Float64 = field(default_factory=lambda: np.empty(0))
    corners: int = 0


@dataclass(frozen=True)
class _Layer:
    """What one splat does to the pixels of a window: alpha [h, w], the least and the largest that it may be, its colour
    (RGBA), and how far off each channel of that may be; rounding: of what the device interpolates."""

    window: tuple[slice, slice]
    low: Float64
    alpha: Float64
    high: Float64
    color: Float64
    color_slack: Float64
    rounding: float


def make_picture(voxels: Field, cells: Cells, scene: Scene, view: View, orders: Sequence[Order]) -> Picture:
    """Composite the cells in every order, and mix the pictures; cells that no order has are verified to leave nothing.

    orders: which share of the picture has which order, int64 [k].
    """
    profile = _profile(scene.splat)
    splats = _footprints(voxels, cells, scene.splat, view, profile)
    x_px, y_px = np.meshgrid(np.arange(view.size[0]) + 0.5, np.arange(view.size[1]) + 0.5)
    layers = [_layer(splats, i, profile, cells, x_px, y_px) for i in range(len(cells.depths))]
    for i in np.setdiff1d(np.arange(len(layers)), orders[0][1]):
        layer = layers[i]
        if layer is not None and layer.low.max() > 0:
            raise DisagreementError(
                f"cell {i} is left out, and has an alpha of {layer.low.max():.3g}: {splats.describe(i)}"
            )
    mixed = [(share, _composite([layers[i] for i in order], x_px.shape)) for share, order in orders]
    radiance = np.sum([share * picture.radiance for share, picture in mixed], axis=0)
    bound = np.sum([share * picture.bound for share, picture in mixed], axis=0)
    return Picture(radiance, bound + 2 * (len(orders) - 1) * FLOAT32 * radiance)  # products and sums in float32


def _layer(splats: _Footprints, i: int, profile: _Profile, cells: Cells, x_px: Float64, y_px: Float64) -> _Layer | None:
    """What a cell leaves on the image, None for nothing."""
    if cells.high[i] == 0 or splats.unit_depth[i] == 0 or splats.cut_at[i] - splats.cut_slack[i] > FARTHEST_CUT:
        return None
    window = _window(splats, i, profile, (x_px.shape[1], x_px.shape[0]))
    if window is None:
        return None
    low, alpha, high = _alphas(splats, i, profile, cells, x_px[window], y_px[window])
    if splats.cut_at[i] + splats.cut_slack[i] > FARTHEST_CUT:  # it may be gone
        low = np.zeros_like(low)
    color_slack = np.append(np.full(3, cells.color_slack[i]), 0.0)
    return _Layer(window, low, alpha, high, np.append(cells.colors[i], 1.0), color_slack, float(splats.rounding[i]))


def _composite(layers: Sequence[_Layer | None], shape: tuple[int, ...]) -> Picture:
    """One over the other, and what rounding may have changed."""
    image, bound = np.zeros((*shape, 4)), np.zeros((*shape, 4))
    for layer in layers:
        if layer is None:
            continue
        behind, of_behind = image[layer.window], bound[layer.window]
        alpha, high = layer.alpha[..., None], layer.high[..., None]
        off = np.maximum(layer.high - layer.alpha, layer.alpha - layer.low)[..., None]
        bound[layer.window] = (
            layer.rounding
            + off * (np.abs(layer.color - behind) + of_behind)
            + (1 - alpha) * of_behind
            + high * layer.color_slack
            + 3 * FLOAT32 * (high * layer.color + np.abs(behind))
        )
        image[layer.window] = alpha * layer.color + (1 - alpha) * behind
    return Picture(image, bound)


def centers(voxels: Field, cells: Cells) -> Float64:
    """float64 [n, 3]: of the cells, in the world."""
    world_from_index = voxels.volume.world_from_index
    return np.asarray((cells.first + (cells.extent - 1) / 2) @ world_from_index[:3, :3].T + world_from_index[:3, 3])


def _footprints(voxels: Field, cells: Cells, spec: SplatSpec, view: View, profile: _Profile) -> _Footprints:
    """Every cell's Gaussian, cut by the near plane, on the image."""
    edges = voxels.volume.world_from_index[:3, :3]
    to_away = np.diag([1.0, 1.0, -1.0]) @ np.column_stack([view.axes, view.view_from_world(np.zeros(3))])
    mean = centers(voxels, cells) @ to_away[:, :3].T + to_away[:, 3]
    axes = to_away[:, :3] @ (edges * (spec.sigma * cells.extent)[:, None, :])
    covariance = axes @ axes.transpose(0, 2, 1)

    # In float32 positions are relative to the volume's centre and to half its diagonal.
    middle = voxels.volume.centre
    length = 0.5 * float(np.linalg.norm(edges * np.array(voxels.volume.shape_xyz)))
    eye = np.abs(to_away[:, :3] @ middle + to_away[:, 3])
    off = ULPS * (length + eye)

    sigma = np.sqrt(covariance[:, 2, 2])
    a = (view.near - mean[:, 2]) / sigma
    is_cut = a > -5
    mass, hazard = 0.5 * erfc(a / math.sqrt(2)), _hazard(a)
    regression = covariance[:, :, 2] / covariance[:, 2, 2, None]
    mean = mean + regression * (sigma * hazard)[:, None]
    lost = np.clip(hazard * (hazard - a), 0, 1) * covariance[:, 2, 2]
    covariance = covariance - lost[:, None, None] * regression[:, :, None] * regression[:, None, :]

    perspective = view.projection == "perspective"
    depth = np.where(mass > 0, mean[:, 2], 1.0) if perspective else np.ones(len(mean))
    px_per_unit = view.scale_px / depth
    slopes = _slopes(mean, depth, view)
    jacobian = _jacobian(px_per_unit, slopes)
    variances, directions = np.linalg.eigh(jacobian @ covariance @ jacobian.transpose(0, 2, 1))
    variances = np.maximum(variances, profile.min_sigma_px**2)
    offset_px = mean[:, :2] * px_per_unit[:, None] * [1, -1]

    relative_depth = (off[2] + ULPS * sigma * (1 + np.abs(a)) * is_cut) / depth if perspective else 0.0
    # Where the plane cuts a splat is a difference of two depths from the volume's centre.
    near_beyond_middle = abs(view.near - float(to_away[2, :3] @ middle + to_away[2, 3]))
    cut_slack = ULPS * ((length + near_beyond_middle) / sigma + np.abs(a))
    relative_cut = RELATIVE_CUT + (1 + np.abs(a)) * cut_slack
    relative = relative_depth + np.where(is_cut, relative_cut, RELATIVE)
    size, away_px = np.array(view.size), np.linalg.norm(offset_px, axis=1)
    sigma_px = np.sqrt(variances[:, 1])
    shift_px = (
        px_per_unit * math.hypot(off[0], off[1])
        + away_px * relative_depth
        + 4 * FLOAT32 * (away_px + size.max())
        + np.where(is_cut, relative_cut, ULPS) * sigma_px
    )
    return _Footprints(
        size / 2 + offset_px,
        (directions * variances[:, None, :]) @ directions.transpose(0, 2, 1),
        mass
        * _areas(edges, cells, spec)
        * px_per_unit**2
        * np.sqrt(1 + np.sum(slopes**2, axis=1))
        / np.sqrt(np.prod(variances, axis=1)),
        shift_px,
        np.minimum(relative, 1.0),
        a,
        cut_slack,
        _rounding(profile, np.sqrt(variances[:, 0]), view),
    )


def _areas(edges: Float64, cells: Cells, spec: SplatSpec) -> Float64:
    """[n]: the optical area of a cell with a depth of 1."""
    spacing = float(np.linalg.norm(edges, axis=0).min())
    num_voxels = np.prod(cells.extent, axis=1, dtype=np.float64)
    thickness = num_voxels if spec.opacity_correction else num_voxels ** (2 / 3)
    return np.asarray(spacing**2 * abs(np.linalg.det(edges / spacing)) * thickness)


def _slopes(mean: Float64, depth: Float64, view: View) -> Float64:
    """[n, 2]: of the rays through the centres, [n, 3] in the view, as far beside the picture as they count."""
    if view.projection != "perspective":
        return np.zeros((len(mean), 2))
    limit = SLOPE_LIMIT * np.array(view.size) / 2 / view.scale_px
    return np.clip(mean[:, :2] / depth[:, None], -limit, limit)


def _jacobian(px_per_unit: Float64, slopes: Float64) -> Float64:
    """[n, 2, 3]: pixels, rows downwards, by lengths in the view."""
    jacobian = np.zeros((len(slopes), 2, 3))
    jacobian[:, 0, 0], jacobian[:, 1, 1] = 1, -1
    jacobian[:, 0, 2], jacobian[:, 1, 2] = -slopes[:, 0], slopes[:, 1]
    return jacobian * px_per_unit[:, None, None]


def _rounding(profile: _Profile, narrow_px: Float64, view: View) -> Float64:
    """The device evaluates a triangle's plane from a corner of the image: ulps of its steepest slope, a whole alpha
    from ring to ring, times the image's size."""
    if not profile.corners:
        return np.zeros_like(narrow_px)
    ring_px = narrow_px * profile.cutoff / (len(profile.radii) - 1) * math.cos(math.pi / profile.corners)
    return 2 * FLOAT32 * sum(view.size) / ring_px


def _hazard(a: Float64) -> Float64:
    """Density over the rest of the normal distribution, at a."""
    with np.errstate(over="ignore"):
        return np.asarray(math.sqrt(2 / math.pi) / np.maximum(erfcx(a / math.sqrt(2)), 1e-300))


def _window(splats: _Footprints, i: int, profile: _Profile, size: tuple[int, int]) -> tuple[slice, slice] | None:
    """Rows and columns that the footprint may reach."""
    reach = profile.cutoff * np.sqrt(np.diag(splats.covariance_px[i])) * (1 + splats.relative[i]) + splats.shift_px[i]
    low = np.clip(np.floor(splats.center_px[i] - reach) - 1, 0, size).astype(int)
    high = np.clip(np.ceil(splats.center_px[i] + reach) + 1, 0, size).astype(int)
    return (slice(low[1], high[1]), slice(low[0], high[0])) if (low < high).all() else None


def _alphas(
    splats: _Footprints, i: int, profile: _Profile, cells: Cells, x_px: Float64, y_px: Float64
) -> tuple[Float64, Float64, Float64]:
    """Least, exact and largest alpha at some pixels."""
    root = np.linalg.cholesky(splats.covariance_px[i])
    dx, dy = x_px - splats.center_px[i, 0], y_px - splats.center_px[i, 1]
    u = dx / root[0, 0]
    v = (dy - root[1, 0] * u) / root[1, 1]
    radius = np.hypot(u, v)
    shift, relative, unit_depth = splats.shift_px[i], splats.relative[i], splats.unit_depth[i]
    narrow = math.sqrt(np.linalg.eigvalsh(splats.covariance_px[i])[0])
    if profile.corners:
        # The hardware's triangles: linear in the distance from the centre along the sides of the polygon.
        angle = 2 * math.pi / profile.corners
        within = np.mod(np.arctan2(v, u), angle) - angle / 2
        radius = radius * np.cos(within) / math.cos(angle / 2)
        shift += SUBPIXEL
    slack = shift / narrow / math.cos(math.pi / profile.corners if profile.corners else 0.0) + relative * radius
    low, depth, high = (unit_depth * value[i] for value in (cells.low, cells.depths, cells.high))
    low, high = low * (1 - 2 * relative), high * (1 + 2 * relative)
    near, far = np.maximum(radius - slack, 0), radius + slack
    at_ends = [(_alpha(profile, low, r), _alpha(profile, high, r)) for r in (near, radius, far)]
    # A profile need not fall all the way: its turns are at the rings.
    beyond = np.zeros_like(radius)
    for ring in profile.radii:
        is_near = (near <= ring) & (ring <= far)
        r = np.where(is_near, ring, radius)
        at_ends.append((_alpha(profile, low, r), _alpha(profile, high, r)))
        # A pixel given to the triangle next to its own has the plane of that one, continued.
        beyond[is_near] = slack[is_near] * _steepest(profile, high)
    least, most = zip(*at_ends, strict=True)
    return np.maximum(np.min(least, axis=0) - beyond, 0), _alpha(profile, depth, radius), np.max(most, axis=0) + beyond


def _steepest(profile: _Profile, depth: float) -> float:
    """The largest slope of alpha from ring to ring."""
    return float(np.abs(np.diff(-np.expm1(-depth * profile.weights)) / np.diff(profile.radii)).max())


def _alpha(profile: _Profile, depth: float, radius: Float64) -> Float64:
    if profile.corners:
        alpha = np.interp(radius, profile.radii, -np.expm1(-depth * profile.weights))
    else:
        q = radius**2
        weight = np.exp(-profile.decay * q) * np.polynomial.polynomial.polyval(q, profile.coefficients) - profile.rim
        alpha = -np.expm1(-depth * np.maximum(weight, 0))  # which rounding leaves below 0 at the rim itself
    return np.where(radius <= profile.cutoff, alpha, 0.0)


def _profile(spec: SplatSpec) -> _Profile:
    """The footprint of a scene, normalised by quadrature: its integral over the plane is 1."""
    if spec.footprint == "gaussian":
        s2 = spec.sigma**2 - 3 / (4 * math.pi**2)  # see GaussianFootprint
        a, ratio = 1 / (4 * math.pi**2 * s2), spec.sigma**2 / s2
        # 1 + 3/2 a (u - 2) + 1/2 a^2 (u^2 - 8 u + 8) with u = r^2 / s^2 = ratio q
        factor = np.array([1 - 3 * a + 4 * a**2, (1.5 * a - 4 * a**2) * ratio, 0.5 * a**2 * ratio**2])
        nodes, shares = np.polynomial.legendre.leggauss(64)
        q = GAUSSIAN_CUTOFF**2 * (nodes + 1) / 2
        values = np.exp(-0.5 * ratio * q) * np.polynomial.polynomial.polyval(q, factor)
        # What it has at its end is taken from all of it.
        end = GAUSSIAN_CUTOFF**2
        rim = math.exp(-0.5 * ratio * end) * float(np.polynomial.polynomial.polyval(end, factor))
        integral = math.pi * end / 2 * float(shares @ (values - rim))  # dA = pi dq
        narrowest = GaussianFootprint.min_sigma_px
        return _Profile(GAUSSIAN_CUTOFF, narrowest, 0.5 * ratio, tuple(factor / integral), rim / integral)
    rings = np.arange(spec.radial + 1) / spec.radial
    weights = np.interp(rings, *np.array(spec.profile, np.float64).T)
    # Over a regular polygon of circumradius 1, dA = 2 area s ds and r^2 has the mean moment / area at s = 1.
    angle = 2 * math.pi / spec.angular
    area = spec.angular / 2 * math.sin(angle)
    moment = area / 2 * (1 - 2 / 3 * math.sin(angle / 2) ** 2)
    mass, second = 0.0, 0.0
    for s0, s1, w0, w1 in zip(rings[:-1], rings[1:], weights[:-1], weights[1:], strict=True):
        nodes, shares = np.polynomial.legendre.leggauss(4)  # exact: polynomials of degree 4
        s = s0 + (s1 - s0) * (nodes + 1) / 2
        w = w0 + (w1 - w0) * (nodes + 1) / 2
        mass += area * float(shares @ (2 * s * w)) * (s1 - s0) / 2
        second += moment / 2 * float(shares @ (4 * s**3 * w)) * (s1 - s0) / 2
    scale = math.sqrt(mass / second)
    return _Profile(
        scale,
        GouraudFootprint.min_sigma_px,
        radii=rings * scale,
        weights=weights / (mass * scale**2),
        corners=spec.angular,
    )

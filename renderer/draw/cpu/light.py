"""Light and extinction that depend on the view or on the length of the gradient, compiled: a sample in each lane.

Light by Lambert's law from a fixed direction is `renderer.draw.cpu.sample.light_factor`, which costs less.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from renderer.bricks import BrickBatch, texel_gradients
from renderer.compiled import (
    bits_to_float32,
    broadcast,
    float32_to_bits,
    fma,
    inline,
    load_rows,
    num_lanes,
    to_float32,
    to_int32,
    where,
)
from renderer.draw.cpu.sample import exp_factors, lerp
from renderer.transfer import toward_light
from renderer.volume import Float32, Int32

_Number3 = tuple[np.float32, np.float32, np.float32]

_0: np.float32 = np.float32(0.0)
_1: np.float32 = np.float32(1.0)
_2: np.float32 = np.float32(2.0)
_HALF: np.float32 = np.float32(0.5)
# Gradients this small, of which the largest are about 1, count as 0: the inverse of others is finite.
_FLAT = np.float32(2.0**-120)
_LN_2 = np.float32(math.log(2))
# The bits of the root of 1/2, from which on mantissas are counted, and the length of a mantissa.
_ROOT_OF_HALF, _MANTISSA = np.int32(0x3F3504F3), np.int32(23)


class Light(NamedTuple):
    """A light of which all samples of a picture share these parameters.

    is_camera: it comes from the viewer, and not from `toward`, a unit vector. is_two_sided, ambient, diffuse, specular,
        shininess: as in ShadingSpec.
    world_from_index: the rows of a matrix of directions; a common factor does not matter.
    factors: float32 [3 n], a gradient's length in texels, the factor on extinction there, and its slope up to the next.
    corners: as in LightField; [0] where all light arrives. grid_shape: x, y, z.
    cells_per_texel: of bricks of voxels. first_cell: the grid's place, in cells, of the volume's centre.
    """

    is_camera: bool
    is_two_sided: bool
    toward: _Number3
    ambient: np.float32
    diffuse: np.float32
    specular: np.float32
    shininess: np.float32
    world_from_index: tuple[_Number3, _Number3, _Number3]
    factors: Float32
    corners: Int32
    grid_shape: tuple[int, int, int]
    cells_per_texel: float
    first_cell: tuple[float, float, float]
    occlusion_strength: np.float32
    shadow_strength: np.float32


def make_light(batch: BrickBatch) -> Light | None:
    """Return the light of a batch; None where it has none, or one by Lambert's law alone."""
    shading = batch.shading
    if shading is None or shading.is_plain:
        return None
    field, centre = batch.bricks.light_field, batch.bricks.volume.centre_index
    nums = field.occlusion.shape if field.occlusion.size else field.shadow.shape
    u, v, w = ((centre + 0.5) / field.cell_size + 0.5).tolist()
    is_camera = shading.light == "camera"
    world_from_index = batch.bricks.volume.world_from_index[:3, :3]
    x, y, z = (_number3(row) for row in world_from_index / np.abs(world_from_index).max())
    return Light(
        is_camera,
        shading.two_sided,
        _number3(np.zeros(3) if is_camera else toward_light(shading)),
        np.float32(shading.ambient),
        np.float32(shading.diffuse),
        np.float32(shading.specular),
        np.float32(shading.shininess),
        (x, y, z),
        _factors(batch),
        field.corners,
        (nums[2], nums[1], nums[0]),
        1.0 / field.cell_size,
        (u, v, w),
        np.float32(field.occlusion_strength),
        np.float32(field.shadow_strength),
    )


def _number3(numbers: Any) -> _Number3:
    x, y, z = np.asarray(numbers, np.float32)
    return x, y, z


def _factors(batch: BrickBatch) -> Float32:
    """Return Light.factors."""
    points = np.array((batch.shading and batch.shading.gradient_opacity) or (), np.float64).reshape(-1, 2)
    gradients, factors = texel_gradients(batch.bricks, points[:, 0]), points[:, 1]
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        slopes = (np.append(np.diff(factors) / np.diff(gradients), 0.0)[: len(points)]).astype(np.float32)
    slopes[~np.isfinite(slopes)] = 0.0  # so steep that it is a step
    return np.column_stack([gradients.astype(np.float32), factors.astype(np.float32), slopes]).reshape(-1)


@inline
def aim(light: Light, direction: Any) -> Any:
    """Return the directions to the light and halfway to the viewer, unit vectors (x, y, z) in the world.

    direction: (x, y, z) of rays, in index space, of any length. Halfway between opposite directions is 0.
    """
    x, y, z = light.world_from_index
    x, y, z = -_dot(direction, x), -_dot(direction, y), -_dot(direction, z)
    length = np.sqrt(_dot((x, y, z), (x, y, z)))
    x, y, z = x / length, y / length, z / length
    if light.is_camera:
        return (x, y, z), (x, y, z)
    toward_x, toward_y, toward_z = light.toward
    half_x, half_y, half_z = x + toward_x, y + toward_y, z + toward_z
    length = np.sqrt(_dot((half_x, half_y, half_z), (half_x, half_y, half_z)))
    scale = where(length > _0, _1 / length, _0)
    zero = x * _0
    return (zero + toward_x, zero + toward_y, zero + toward_z), (half_x * scale, half_y * scale, half_z * scale)


@inline
def _dot(one: Any, other: Any) -> Any:
    return fma(one[0], other[0], fma(one[1], other[1], one[2] * other[2]))


@inline
def place_brick(light: Light, corner: Any) -> Any:
    """Return where in the grid of the light field the texel 0 of a brick of voxels is, (x, y, z) in cells.

    corner: its place in voxels, from the volume's centre.
    """
    u, v, w = light.first_cell
    scale = light.cells_per_texel
    return (
        np.float32(u + scale * corner[0]),
        np.float32(v + scale * corner[1]),
        np.float32(w + scale * corner[2]),
    )


@inline
def arriving_shares(light: Light, texel: Any, origin: Any) -> Any:
    """Return the shares of the ambient and of the diffuse light that arrive at samples.

    texel: where samples are in a brick, (x, y, z). origin: as `place_brick` returns it.
    """
    ambient, diffuse = texel[0] * _0 + _1, texel[0] * _0 + _1
    if light.corners.size > 0:
        scale, (num_x, num_y, num_z) = np.float32(light.cells_per_texel), light.grid_shape
        u = _clamp_to_grid(fma(texel[0], scale, origin[0]), num_x)
        v = _clamp_to_grid(fma(texel[1], scale, origin[1]), num_y)
        w = _clamp_to_grid(fma(texel[2], scale, origin[2]), num_z)
        i, j, k = to_int32(u), to_int32(v), to_int32(w)
        at = (k * np.int32(num_y) + j) * np.int32(num_x) + i
        shares = u - to_float32(i), v - to_float32(j), w - to_float32(k)
        num_numbers = 2 * ((light.occlusion_strength > _0) + (light.shadow_strength > _0))
        near, far, next_near, next_far = load_rows(light.corners, at * np.int32(num_numbers), 4)
        if light.occlusion_strength > _0:
            ambient = fma(light.occlusion_strength, _interpolate_bytes(near, far, shares) - _1, _1)
            near, far = next_near, next_far
        if light.shadow_strength > _0:
            diffuse = fma(light.shadow_strength, _interpolate_bytes(near, far, shares) - _1, _1)
    return ambient, diffuse


@inline
def _interpolate_bytes(near: Any, far: Any, shares: Any) -> Any:
    """Interpolate between eight bytes, of which two int32 have four each, in steps of 1 / 255."""
    u, v, w = shares
    near = lerp(v, lerp(u, _byte(near, 0), _byte(near, 8)), lerp(u, _byte(near, 16), _byte(near, 24)))
    far = lerp(v, lerp(u, _byte(far, 0), _byte(far, 8)), lerp(u, _byte(far, 16), _byte(far, 24)))
    return lerp(w, near, far) * np.float32(1 / 255)


@inline
def _byte(four: Any, shift: int) -> Any:
    return to_float32((four >> np.int32(shift)) & np.int32(255))


@inline
def _clamp_to_grid(place: Any, num: int) -> Any:
    return min(max(_HALF, place), np.float32(num) - np.float32(1.5))


@inline
def illuminate(sample: Any, gradient: Any, ways: Any, arriving: Any, light: Light) -> Any:
    """Return (tau, r, g, b) of samples in the light.

    gradient: (x, y, z), as in texels. ways: as `aim` returns them. arriving: as `arriving_shares` does.
    """
    (tau, r, g, b), (x, y, z) = sample, gradient
    largest = max(abs(x), abs(y))
    largest = max(largest, abs(z))
    is_steep = largest > _FLAT
    scale = where(is_steep, _1 / largest, _0)  # squares neither overflow nor vanish
    x, y, z = x * scale, y * scale, z * scale
    length = np.sqrt(_dot((x, y, z), (x, y, z)))
    scale = where(is_steep, -_1 / length, _0)
    to_light, to_halfway = _dot((x, y, z), ways[0]) * scale, _dot((x, y, z), ways[1]) * scale
    if light.is_two_sided:
        to_light, to_halfway = abs(to_light), abs(to_halfway)
    lit = fma(max(_0, to_light), light.diffuse * arriving[1], light.ambient * arriving[0])
    r, g, b = r * lit, g * lit, b * lit
    if light.specular > _0:
        shine = power(max(_0, to_halfway), light.shininess) * light.specular * arriving[1]
        shine = where(to_light > _0, shine, _0)
        r, g, b = r + shine, g + shine, b + shine
    if light.factors.size > 0:
        tau *= _factor_at(largest * length, light.factors)
    return tau, r, g, b


@inline
def _factor_at(magnitude: Any, factors: Float32) -> Any:
    """Return the factor on extinction at gradients of this length."""
    factor = broadcast(factors[1], num_lanes())
    for k in range(0, factors.size, 3):
        beyond = fma(magnitude - factors[k], factors[k + 2], factors[k + 1])
        factor = where(magnitude >= factors[k], beyond, factor)
    return factor


@inline
def power(x: Any, exponent: np.float32) -> Any:
    """Return x^exponent of x from 0 to 1, and 0 of 0; the relative error is below 1e-5 where the result is above 1e-4.

    It is exp(exponent ln x), with x = 2^e m and m from sqrt(1/2) to sqrt(2), and the series of artanh for ln m.
    """
    bits = float32_to_bits(x)
    e = (bits - _ROOT_OF_HALF) >> _MANTISSA
    m = bits_to_float32(bits - (e << _MANTISSA))
    ratio = (m - _1) / (m + _1)
    square = ratio * ratio
    series = fma(square, fma(square, fma(square, _2 / np.float32(7), _2 / np.float32(5)), _2 / np.float32(3)), _2)
    logarithm = fma(to_float32(e), _LN_2, ratio * series)
    one, other = exp_factors(max(_0, -logarithm * exponent))
    return where(x > _0, one * other, _0)

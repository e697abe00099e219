"""The light on a point of a ray, by its definition: Lambert's law, highlights, and factors on extinction.

All functions are inlined, as in `renderer.truth.kernel`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from renderer.compiled import inline
from renderer.transfer import LightField
from renderer.truth.cubic import Cubic, Vector, value_at
from renderer.volume import Float32, Float64

# The three components along a segment.
Gradient = tuple[Cubic, Cubic, Cubic]

# A sum of squares that is no smaller is accurate, and one that is no larger than its inverse, too.
_LEAST_SQUARE = 2.0**-900


class Gloss(NamedTuple):
    """A set of what a light has beyond Lambert's: highlights, factors on extinction by gradients, a light field.

    is_camera: the light comes from the viewer. is_two_sided, specular, shininess: as in ShadingSpec.
    halfway: of a ray (`aim`), the unit vector halfway between the directions to the light and to the viewer; zeros
        where they are opposite. world_from_index: the rows of the matrix.
    factors: float64 [n, 3], a magnitude, times `Intervals.scale`, the factor there and its slope up to the next one.
    field: how much of the light arrives. begin, extent: of the segment of a ray in a cell, voxels (`locate`).
    """

    is_camera: bool
    is_two_sided: bool
    specular: float
    shininess: float
    halfway: Vector
    world_from_index: tuple[Vector, Vector, Vector]
    factors: Float64
    field: LightField
    begin: Vector
    extent: Vector


class LambertShading(NamedTuple):
    """A light: Lambert shading by the world gradient.

    enabled: if not, every factor is 1 and the rest is unused.
    light: unit vector to the light; of a ray (`aim`) where it depends on the view. world_from_index_gradient: the rows
        of the matrix. gloss: None for Lambert's law alone; numba compiles the two cases separately.
    """

    enabled: bool
    ambient: float
    diffuse: float
    light: Vector
    world_from_index_gradient: tuple[Vector, Vector, Vector]
    gloss: Gloss | None


@inline
def aim(shading: LambertShading, gloss: Gloss | None, direction: Vector) -> LambertShading:
    """Return the shading of a ray, of which `direction` is in index space and of length 1 in the world."""
    if gloss is None:
        return shading
    x, y, z = gloss.world_from_index
    viewer = -_dot(x, direction), -_dot(y, direction), -_dot(z, direction)
    light = viewer if gloss.is_camera else shading.light
    halfway = light[0] + viewer[0], light[1] + viewer[1], light[2] + viewer[2]
    length = math.sqrt(_dot(halfway, halfway))
    inverse = 1.0 / length if length > 0.0 else 0.0
    halfway = halfway[0] * inverse, halfway[1] * inverse, halfway[2] * inverse
    return LambertShading(
        shading.enabled,
        shading.ambient,
        shading.diffuse,
        light,
        shading.world_from_index_gradient,
        Gloss(
            gloss.is_camera,
            gloss.is_two_sided,
            gloss.specular,
            gloss.shininess,
            halfway,
            gloss.world_from_index,
            gloss.factors,
            gloss.field,
            gloss.begin,
            gloss.extent,
        ),
    )


@inline
def locate(shading: LambertShading, gloss: Gloss | None, begin: Vector, extent: Vector) -> LambertShading:
    """Return the shading of a segment of a ray, `begin + extent * t` in index space."""
    if gloss is None:
        return shading
    return LambertShading(
        shading.enabled,
        shading.ambient,
        shading.diffuse,
        shading.light,
        shading.world_from_index_gradient,
        Gloss(
            gloss.is_camera,
            gloss.is_two_sided,
            gloss.specular,
            gloss.shininess,
            gloss.halfway,
            gloss.world_from_index,
            gloss.factors,
            gloss.field,
            begin,
            extent,
        ),
    )


@inline
def _arriving(grid: Float32, strength: float, gloss: Gloss, t: float) -> float:
    """Return the share of the light that arrives at t along the segment, by one grid of the light field."""
    if grid.size == 0:
        return 1.0
    num_z, num_y, num_x = grid.shape
    (x, y, z), (dx, dy, dz) = gloss.begin, gloss.extent
    u, v, w = _in_grid(x + t * dx, num_x, gloss), _in_grid(y + t * dy, num_y, gloss), _in_grid(z + t * dz, num_z, gloss)
    i, j, k = int(u), int(v), int(w)
    a, b, c = u - i, v - j, w - k
    mean = 0.0
    for corner in range(8):
        p, q, r = corner & 1, corner >> 1 & 1, corner >> 2
        weight = (a if p else 1.0 - a) * (b if q else 1.0 - b) * (c if r else 1.0 - c)
        mean += weight * float(grid[k + r, j + q, i + p])
    return 1.0 - strength * (1.0 - mean)


@inline
def _in_grid(place: float, num: int, gloss: Gloss) -> float:
    """Return where a place in voxels is in the grid of the light field, which has `num` cells there."""
    return min(max((place + 0.5) / gloss.field.cell_size + 0.5, 0.5), num - 1.5)


@inline
def _dot(one: Vector, other: Vector) -> float:
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


@inline
def _light_factor(gradient: Gradient, t: float, shading: LambertShading) -> float:
    x, y, z = value_at(gradient[0], t), value_at(gradient[1], t), value_at(gradient[2], t)
    light, square = shading.light, x * x + y * y + z * z
    if not _LEAST_SQUARE < square < 1.0 / _LEAST_SQUARE:  # squares must neither overflow nor vanish
        largest = max(abs(x), abs(y), abs(z))
        if largest == 0.0:
            return shading.ambient
        x, y, z = x / largest, y / largest, z / largest
        square = x * x + y * y + z * z
    cosine = -(x * light[0] + y * light[1] + z * light[2]) / math.sqrt(square)
    return shading.ambient + shading.diffuse * max(0.0, cosine)


@inline
def lit_color(row: Float64, value: float, gradient: Gradient, t: float, shading: LambertShading) -> Vector:
    """Return the shaded colour of a value in the interval of `row`, at t along the segment."""
    lit = _light_factor(gradient, t, shading) if shading.enabled else 1.0
    offset = value - row[8]
    return (row[0] + row[4] * offset) * lit, (row[1] + row[5] * offset) * lit, (row[2] + row[6] * offset) * lit


@inline
def _factor_at(magnitude: float, factors: Float64) -> float:
    """Return the factor on extinction at a gradient's magnitude."""
    factor = factors[0, 1] if len(factors) > 0 else 1.0
    for k in range(len(factors)):
        if magnitude >= factors[k, 0]:
            factor = factors[k, 1] + factors[k, 2] * (magnitude - factors[k, 0])
    return factor


@inline
def illuminate(gradient: Gradient, t: float, shading: LambertShading, gloss: Gloss) -> Vector:
    """Return the factor on colour, the white light that is added, and the factor on extinction, at t."""
    normal = -value_at(gradient[0], t), -value_at(gradient[1], t), -value_at(gradient[2], t)
    square, largest = _dot(normal, normal), 1.0
    ambient = _arriving(gloss.field.occlusion, gloss.field.occlusion_strength, gloss, t)
    diffuse = _arriving(gloss.field.shadow, gloss.field.shadow_strength, gloss, t)
    if not _LEAST_SQUARE < square < 1.0 / _LEAST_SQUARE:
        largest = max(abs(normal[0]), abs(normal[1]), abs(normal[2]))
        if largest == 0.0:
            return shading.ambient * ambient, 0.0, _factor_at(0.0, gloss.factors)
        normal = normal[0] / largest, normal[1] / largest, normal[2] / largest
        square = _dot(normal, normal)
    length = math.sqrt(square)
    to_light, to_halfway = _dot(normal, shading.light) / length, _dot(normal, gloss.halfway) / length
    if gloss.is_two_sided:
        to_light, to_halfway = abs(to_light), abs(to_halfway)
    highlight = 0.0
    if to_light > 0.0 and to_halfway > 0.0:
        highlight = gloss.specular * to_halfway**gloss.shininess * diffuse
    lit = shading.ambient * ambient + shading.diffuse * diffuse * max(0.0, to_light)
    return lit, highlight, _factor_at(length * largest, gloss.factors)

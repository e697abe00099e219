"""Find the albedos of matter from its colours, so that opaque matter in even light shows its colour.

A *colour* of a scene is the reflectance of opaque matter, in sRGB. An *albedo* is the share of light that an
interaction scatters, in linear light. Thick matter scatters light many times, and shows far less than its albedo. Van
de Hulst 1980 ("Multiple Light Scattering", in the form of Kulla and Conty 2017) gives the colour A of a half-space with
isotropic scattering and albedo w, with s = sqrt(1 - w): A = (1 - 0.139 s) (1 - s) / (1 + 1.17 s). The fit is within
0.003 of the exact colour. Clear matter scatters light once, and shows its albedo. A voxel of the opacity a has the
albedo (1 - a) c + a w, with c its colour in linear light and w the albedo of thick matter.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from renderer.transfer.transfer_function import TransferFunction
from renderer.volume import Float64

# The opacities of a voxel at which control points are added, so that albedos follow the opacity between two points: a
# ramp to opacity 1 is opaque near its lower end, where rays end. With them, a cube of an orange as bright as its colour
# in even light is within 0.06 of it, by paths of light (sRGB from 0 to 1).
_ADDED_OPACITIES = (0.25, 0.5, 0.75, 0.9, 0.97)
# The linear light up to which sRGB is proportional to it.
_LEAST_POWER = 0.0031308
# The steps of Newton's method from 1 to the cube roots of numbers of at least the fourth root of _LEAST_POWER. Five are
# exact to the last digit or two.
_NEWTON_STEPS = 6
# The coefficients of van de Hulst's fit.
_OF_NUMERATOR = 0.139
_OF_DENOMINATOR = 1.17
# The coefficient of the light that matter absorbs on its way to surfaces in it. A half-space under an even sky, by its
# integral equation, has 1.59 at the albedo 0, 1.68 at 0.5 and 1.79 at 0.99.
_OF_SURFACE = 1.68


def albedos_of(transfer: TransferFunction, finest_spacing: float) -> TransferFunction:
    """Return a transfer function whose colours are the linear albedos of matter that has the given colours.

    finest_spacing: the length whose opacity tells thick matter from clear matter, the finest spacing of the volume.
    """
    transfer = _with_added_points(transfer, finest_spacing)
    colors = linear_of_srgb(transfer.colors)
    opacities = -np.expm1(-transfer.extinctions * finest_spacing)[:, None]
    return replace(transfer, colors=colors + opacities * (albedo_of_thick(colors) - colors))


def _with_added_points(transfer: TransferFunction, finest_spacing: float) -> TransferFunction:
    """Return the same transfer function with more control points, where the opacity of a voxel changes between two."""
    wanted = -np.log1p(-np.array(_ADDED_OPACITIES)) / finest_spacing
    rows = np.column_stack([transfer.values, transfer.colors, transfer.extinctions])
    found = [rows[:1]]
    for start, end in pairwise(rows):
        low, high = sorted((start[4], end[4]))
        inside = wanted[(wanted > low) & (wanted < high)] if start[0] < end[0] else wanted[:0]
        shares = np.sort((inside - start[4]) / (end[4] - start[4]))[:, None]
        between = (1 - shares) * start + shares * end
        is_new = (between[:, 0] > start[0]) & (between[:, 0] < end[0])  # there may be no number between two points
        found += [between[is_new], end[None]]
    values, colors, extinctions = np.split(np.concatenate(found), [1, 4], axis=1)
    return replace(transfer, values=values[:, 0].copy(), colors=colors, extinctions=extinctions[:, 0].copy())


def albedo_of_thick(colors: npt.ArrayLike) -> Float64:
    """Return the albedos of half-spaces that show the given linear colours, from 0 to 1, in even light."""
    shown = np.asarray(colors, np.float64)
    half = (1 + _OF_NUMERATOR + _OF_DENOMINATOR * shown) / 2
    root = (1 - shown) / (half + np.sqrt(half * half - _OF_NUMERATOR * (1 - shown)))
    return np.asarray(1 - root * root)


def color_of_thick(albedos: npt.ArrayLike) -> Float64:
    """Return the linear colours that half-spaces of the given albedos, from 0 to 1, show in even light."""
    root = np.sqrt(np.maximum(1 - np.asarray(albedos, np.float64), 0.0))
    return np.asarray((1 - _OF_NUMERATOR * root) * (1 - root) / (1 + _OF_DENOMINATOR * root))


def surface_reflectance(albedos: npt.ArrayLike) -> Float64:
    """Return the reflectances, in linear light, of surfaces in matter of the given albedos, from 0 to 1.

    A point of a ray is a surface with matter before it, which dims its light. With s = sqrt(1 - w), a half-space of
    surfaces of reflectance 1 in matter of the albedo w shows about 1 / (1 + 1.68 s), within 3 %. Divided by it, the
    colour of thick matter is shown by a half-space of surfaces, too. Kernels have the same formula.
    """
    root = np.sqrt(np.maximum(1 - np.asarray(albedos, np.float64), 0.0))
    return np.asarray(color_of_thick(albedos) * (1 + _OF_SURFACE * root))


def linear_of_srgb(colors: npt.ArrayLike) -> Float64:
    """Return colours in linear light. colors: sRGB, from 0 to 1."""
    encoded = np.asarray(colors, np.float64)
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def srgb_of_linear(colors: npt.ArrayLike) -> Float64:
    """Return colours in sRGB, with the same bytes on every machine. colors: linear light, from 0 to 1."""
    linear = np.asarray(colors, np.float64)
    # x^(5/12) is y^(5/3), with y the fourth root of x; powers of C libraries differ in their last digits.
    fourth_root = np.sqrt(np.sqrt(np.maximum(linear, _LEAST_POWER)))
    cube_root = np.ones_like(fourth_root)
    for _ in range(_NEWTON_STEPS):
        cube_root = (2.0 * cube_root + fourth_root / (cube_root * cube_root)) / 3.0
    return np.where(linear <= _LEAST_POWER, 12.92 * linear, 1.055 * fourth_root * cube_root * cube_root - 0.055)

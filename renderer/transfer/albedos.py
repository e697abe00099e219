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

import numpy as np
import numpy.typing as npt

from renderer.transfer.transfer_function import TransferFunction
from renderer.volume import Float64

# The coefficients of van de Hulst's fit.
_OF_NUMERATOR = 0.139
_OF_DENOMINATOR = 1.17


def albedos_of(transfer: TransferFunction, finest_spacing: float) -> TransferFunction:
    """Return a transfer function whose colours are the linear albedos of matter that has the given colours.

    Albedos are linear in the scalar between control points. finest_spacing: the length whose opacity tells thick matter
    from clear matter, the finest spacing of the volume.
    """
    colors = linear_of_srgb(transfer.colors)
    opacities = -np.expm1(-transfer.extinctions * finest_spacing)[:, None]
    return replace(transfer, colors=colors + opacities * (albedo_of_thick(colors) - colors))


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


def linear_of_srgb(colors: npt.ArrayLike) -> Float64:
    """Return colours in linear light. colors: sRGB, from 0 to 1."""
    encoded = np.asarray(colors, np.float64)
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)

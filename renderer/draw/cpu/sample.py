"""Voxels without data in compiled loops: what `renderer.draw.cpu.extremum` needs."""

from __future__ import annotations

from typing import Any

import numpy as np

from renderer.bricks import PADDED_BRICK_SIZE
from renderer.compiled import float32_to_bits, gather, inline, load_corners, to_int32
from renderer.volume import Float32

_ROW_STRIDE, _PLANE_STRIDE = PADDED_BRICK_SIZE, PADDED_BRICK_SIZE**2
_HALF: np.float32 = np.float32(0.5)


@inline
def are_present(texels: Float32, at: Any, shares: Any) -> Any:
    """Return whether the texels that are nearest to samples have data; `at` is the lowest of the eight around each."""
    u, v, w = shares
    u, v, w = to_int32(u + _HALF), to_int32(v + _HALF), to_int32(w + _HALF)
    nearest = at + u + v * np.int32(_ROW_STRIDE) + w * np.int32(_PLANE_STRIDE)
    return _has_data(gather(texels, nearest))


@inline
def are_all_present(texels: Float32, at: Any) -> Any:
    """Return whether all eight texels, the lowest of which is at `at`, have data."""
    a, b, c, d, e, f, g, h = load_corners(texels, at, _ROW_STRIDE, _PLANE_STRIDE)
    below = _has_data(a) & _has_data(b) & _has_data(c) & _has_data(d)
    return below & _has_data(e) & _has_data(f) & _has_data(g) & _has_data(h)


@inline
def _has_data(texel: Any) -> Any:
    return (float32_to_bits(texel) & np.int32(1)) == np.int32(0)

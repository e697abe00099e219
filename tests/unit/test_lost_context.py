"""What GL has to complain of after a frame is an error, and nothing that a frame does makes it complain."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
from splatting import in_order, look, place_splats

from renderer.errors import ContextLostError
from renderer.raster_gl import GLRasterizer

NO_CAPABILITY = 0xFFFF


def test_an_error_of_gl_is_one() -> None:
    splats = place_splats(np.zeros((1, 3)), 0.1)
    with GLRasterizer() as gl:
        gl.rasterize(splats, in_order(splats), look())
        with gl._context:
            ctypes.CDLL("libGL.so.1").glEnable(NO_CAPABILITY)
        with pytest.raises(ContextLostError) as raised:
            gl.rasterize(splats, in_order(splats), look())
        assert str(raised.value) == (
            f"{gl.renderer_name}: OpenGL failed to draw, or its context was lost\n  got: GL_INVALID_ENUM"
        )


def test_other_sizes_are_none() -> None:
    """A target of another size takes the place of the one that is bound."""
    splats = place_splats(np.zeros((1, 3)), 0.1)
    with GLRasterizer() as gl:
        for size in ((64, 48), (32, 48), (64, 48)):
            assert gl.rasterize(splats, in_order(splats), look(size=size)).any()

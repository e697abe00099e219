"""An error that GL reports after a frame is raised, and no frame causes one."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import moderngl
import numpy as np
import pytest
from splatting import in_order, look, place_splats

from renderer.draw import CellEdges, GLRasterizer
from renderer.errors import ContextLostError

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
    """Images of another size replace the target that is bound, without an error in GL."""
    splats = place_splats(np.zeros((1, 3)), 0.1)
    with GLRasterizer() as gl:
        for size in ((64, 48), (32, 48), (64, 48)):
            assert gl.rasterize(splats, in_order(splats), look(size=size)).any()


def refuse(*arguments: Any, **options: Any) -> None:
    raise moderngl.Error("cannot create it")


def draw_splats(gl: GLRasterizer) -> None:
    splats = place_splats(np.zeros((1, 3)), 0.1)
    gl.rasterize(splats, in_order(splats), look())


def draw_edges(gl: GLRasterizer) -> None:
    gl.rasterize_edges(CellEdges(np.zeros((1, 7), np.float32), 0.1, np.zeros(3), 1.0), look())


@pytest.mark.parametrize(
    ("picture", "step"),
    [
        (draw_splats, "buffer"),
        (draw_splats, "program"),
        (draw_edges, "vertex_array"),
    ],
)
def test_what_cannot_be_made_is_a_lost_context(
    picture: Callable[[GLRasterizer], object], step: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A lost context is reported by name, although it answers no query any more."""
    with GLRasterizer() as gl:
        name = gl.renderer_name
        monkeypatch.setattr(moderngl.Context, step, refuse)
        monkeypatch.setattr(moderngl.Context, "info", {})
        with pytest.raises(ContextLostError) as raised:
            picture(gl)
    assert str(raised.value) == f"{name}: OpenGL failed to draw, or its context was lost\n  got: cannot create it"


def test_a_picture_that_cannot_be_had_may_be_one(monkeypatch: pytest.MonkeyPatch) -> None:
    with GLRasterizer() as gl:
        monkeypatch.setattr(moderngl.Context, "framebuffer", refuse)
        with pytest.raises(ContextLostError, match="no room for a picture of this size, or its context was lost\n"):
            draw_splats(gl)


def test_a_context_that_is_lost_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(moderngl.Context, "buffer", refuse)
    with pytest.raises(ContextLostError, match="its context was lost\n  got: cannot create it"):
        GLRasterizer()

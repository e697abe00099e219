"""Load shaders from their files, with the constants and vertex layouts that they share with Python."""

from __future__ import annotations

import re
from importlib.resources import files
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.bricks import DITHER
from renderer.draw import constants
from renderer.view import CLIPPED_SIGMAS, CULLED_SIGMAS

_CONSTANTS: dict[str, Any] = vars(constants) | {
    "CLIPPED_SIGMAS": CLIPPED_SIGMAS,
    "CULLED_SIGMAS": CULLED_SIGMAS,
    "DITHER": DITHER,
}

# The vertices of splats (SplatBatch.vertices) and of bricks (BrickView, and slots).
SPLAT_VERTEX = np.dtype([("center", "f4", 3), ("areas", "f4", 4), ("shape", "f4")])
BRICK_VERTEX = np.dtype(
    [("rectangle_px", "f4", 4), ("box_low", "f4", 3), ("box_high", "f4", 3), ("first_corner", "f4", 3),
     ("cells_per_voxel", "f4"), ("step_cells", "f4"), ("first_texel", "f4", 3)]
)  # fmt: skip
MESH_VERTEX = np.dtype([("mesh_vertex", "f4", 2), ("mesh_weight", "f4")])


def load_shader(*names: str) -> str:
    """Return one program stage from several files: the version, the constants that the files use, and the files."""
    text = "\n".join((files("renderer.draw.gl") / "shaders" / name).read_text("utf-8") for name in names)
    used = sorted(_CONSTANTS.keys() & re.findall(r"\w+", text))
    declarations = [_declaration(name, _CONSTANTS[name]) for name in used]
    return "\n".join(["#version 330 core", *declarations, text])


def vertex_content(buffer: Any, layout: npt.DTypeLike, step: str = "") -> tuple[Any, ...]:
    """Return a buffer with a vertex layout as moderngl takes it. step: "/i" for one element per instance."""
    fields: Any = np.dtype(layout).fields
    return buffer, " ".join(f"{field[0].itemsize // 4}f" for field in fields.values()) + step, *fields


def _declaration(name: str, value: float | tuple[float, ...]) -> str:
    """Return the declaration of a constant in GLSL: an int, a float or a vector."""
    if isinstance(value, tuple):
        return f"const vec{len(value)} {name} = vec{len(value)}{value};"
    return f"const {type(value).__name__} {name} = {value};"

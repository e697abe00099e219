"""Load shaders from their files, with the constants and vertex layouts that they share with Python."""

from __future__ import annotations

import re
from importlib.resources import files
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.draw import constants
from renderer.draw.overlay import LEVEL_COLORS
from renderer.view import CLIPPED_SIGMAS, CULLED_SIGMAS

# The uniform block of shapes holds 48 bytes for each; GL guarantees 16 KiB.
MAX_SHAPES = 256
# The sides of 3D textures are powers of two up to this.
MAX_ATLAS_SIDE = 2048
# Pieces of the transfer function in a row of their texture.
PIECES_IN_ROW = 1024
# Stands for infinity where float32 is needed.
LARGE_FLOAT32 = 1e30
# An end of a line that is nearer to the eye plane is not divided by its depth.
MIN_LINE_DEPTH = 1e-5

_CONSTANTS: dict[str, float | tuple[float, ...]] = {
    "CLIPPED_SIGMAS": CLIPPED_SIGMAS,
    "CULLED_SIGMAS": CULLED_SIGMAS,
    "LARGE_FLOAT32": LARGE_FLOAT32,
    "MAX_ATLAS_SIDE": MAX_ATLAS_SIDE,
    "MAX_SAMPLES": constants.MAX_SAMPLES,
    "MAX_SAMPLE_CELL": constants.MAX_SAMPLE_CELL,
    "MAX_SHAPES": MAX_SHAPES,
    "MIN_LINE_DEPTH": MIN_LINE_DEPTH,
    "MIN_SAMPLE_CELL": constants.MIN_SAMPLE_CELL,
    "NUM_LEVEL_COLORS": len(LEVEL_COLORS),
    "OPACITY_SERIES": constants.OPACITY_SERIES,
    "PIECES_IN_ROW": PIECES_IN_ROW,
    "RECTANGLE_ROUNDING_PX": constants.RECTANGLE_ROUNDING_PX,
}

# The vertices of splats (SplatBatch.vertices), of edges (CellEdges.vertices) and of bricks.
SPLAT_VERTEX = np.dtype([("center", "f4", 3), ("areas", "f4", 4), ("shape", "f4")])
EDGE_VERTEX = np.dtype([("start", "f4", 3), ("end", "f4", 3), ("level", "f4")])
BRICK_VERTEX = np.dtype(
    [("rectangle_px", "f4", 4), ("box_low", "f4", 3), ("box_high", "f4", 3), ("first_corner", "f4", 3),
     ("first_texel", "f4", 3), ("steps", "f4", 2)]
)  # fmt: skip
MESH_VERTEX = np.dtype([("mesh_vertex", "f4", 2), ("mesh_weight", "f4")])


def load_shader(*names: str) -> str:
    """Return one program stage from several files: the version, the constants that the files use, and the files."""
    text = "\n".join((files("renderer.draw.gl") / "shaders" / name).read_text("utf-8") for name in names)
    words = set(re.findall(r"\w+", text))
    declarations = [_declaration(name, value) for name, value in _CONSTANTS.items() if name in words]
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

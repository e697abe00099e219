"""Load shaders from their files, with the constants and vertex layouts that they share with Python."""

from __future__ import annotations

import re
from importlib.resources import files
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.view import CLIPPED_SIGMAS, CULLED_SIGMAS

# The most shapes that the splats of a batch may have: a uniform block holds 48 bytes for each shape, and OpenGL
# guarantees it 16 KiB.
MAX_SHAPES = 256

# Constants that Python shares with shaders, by their names in shaders.
_CONSTANTS: dict[str, int | float | tuple[float, ...]] = {
    "CLIPPED_SIGMAS": CLIPPED_SIGMAS,
    "CULLED_SIGMAS": CULLED_SIGMAS,
    "MAX_SHAPES": MAX_SHAPES,
    # A finite float32 number that stands for infinity.
    "LARGE_FLOAT32": 1e30,
    # The coefficients a, b, c, d of 1 - exp(-x) below x = 1/2, where the difference would cancel: it is x (1 - x (a - x
    # (b - x (c - x d)))), the polynomial with 1 at 0 whose largest relative error is least (9e-8, by linear
    # programming).
    "OPACITY_SERIES": (0.49999463, 0.16656359, 0.04104245, 0.00680757),
}

# The layout in memory of the vertex of a splat (SplatBatch.vertices), with the names of the inputs of shaders.
SPLAT_VERTEX = np.dtype([("center", "f4", 3), ("areas", "f4", 4), ("shape", "f4")])
# The layout in memory of a vertex of the mesh of the Gouraud footprint, with the names of the inputs of shaders.
MESH_VERTEX = np.dtype([("mesh_vertex", "f4", 2), ("mesh_weight", "f4")])


def load_shader(*names: str) -> str:
    """Return the source of one stage of a shader program: the version, the constants in use, and the text of files.

    names: the names of the files.
    """
    text = "\n".join((files("renderer.draw.splats") / "shaders" / name).read_text("utf-8") for name in names)
    used = sorted(_CONSTANTS.keys() & re.findall(r"\w+", text))
    declarations = [_declaration(name, _CONSTANTS[name]) for name in used]
    return "\n".join(["#version 330 core", *declarations, text])


def vertex_content(buffer: Any, layout: npt.DTypeLike, step: str = "") -> tuple[Any, ...]:
    """Return a buffer with the layout of its vertices, as moderngl's `vertex_array` takes them.

    step: "/i" if each instance takes one element of the buffer, "" if each vertex does.
    """
    fields: Any = np.dtype(layout).fields
    return buffer, " ".join(f"{field[0].itemsize // 4}f" for field in fields.values()) + step, *fields


def _declaration(name: str, value: float | tuple[float, ...]) -> str:
    """Return the declaration of a constant in GLSL: an int, a float or a vector."""
    if isinstance(value, tuple):
        return f"const vec{len(value)} {name} = vec{len(value)}{value};"
    return f"const {type(value).__name__} {name} = {value};"

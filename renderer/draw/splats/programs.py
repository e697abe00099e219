"""Load shaders from their files, with the constants and vertex layouts that they share with Python."""

from __future__ import annotations

import re
from importlib.resources import files
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.view import CLIPPED_SIGMAS, CULLED_SIGMAS

# The most shapes of splats: the uniform block holds 48 bytes for each shape, and GL guarantees 16 KiB.
MAX_SHAPES = 256

# The constants that shaders use by these names.
_CONSTANTS: dict[str, int | float | tuple[float, ...]] = {
    "CLIPPED_SIGMAS": CLIPPED_SIGMAS,
    "CULLED_SIGMAS": CULLED_SIGMAS,
    "MAX_SHAPES": MAX_SHAPES,
    # A number that stands for infinity where float32 is needed.
    "LARGE_FLOAT32": 1e30,
    # The coefficients a, b, c, d of 1 - exp(-x) below x = 1/2, where the difference would cancel: it is x (1 - x (a - x
    # (b - x (c - x d)))), the polynomial with 1 at 0 whose largest relative error is least (9e-8, by linear
    # programming).
    "OPACITY_SERIES": (0.49999463, 0.16656359, 0.04104245, 0.00680757),
}

# The layout of the vertices of splats (SplatBatch.vertices), and of the mesh of a Gouraud footprint.
SPLAT_VERTEX = np.dtype([("center", "f4", 3), ("areas", "f4", 4), ("shape", "f4")])
MESH_VERTEX = np.dtype([("mesh_vertex", "f4", 2), ("mesh_weight", "f4")])


def load_shader(*names: str) -> str:
    """Return the text of one program stage: the version, the constants that its files use, and the files."""
    text = "\n".join((files("renderer.draw.splats") / "shaders" / name).read_text("utf-8") for name in names)
    used = sorted(_CONSTANTS.keys() & re.findall(r"\w+", text))
    declarations = [_declaration(name, _CONSTANTS[name]) for name in used]
    return "\n".join(["#version 330 core", *declarations, text])


def vertex_content(buffer: Any, layout: npt.DTypeLike, step: str = "") -> tuple[Any, ...]:
    """Return a buffer with its vertex layout, as moderngl takes them. step: "/i" if each instance takes one element."""
    fields: Any = np.dtype(layout).fields
    return buffer, " ".join(f"{field[0].itemsize // 4}f" for field in fields.values()) + step, *fields


def _declaration(name: str, value: float | tuple[float, ...]) -> str:
    """Return the declaration of a constant in GLSL: an int, a float or a vector."""
    if isinstance(value, tuple):
        return f"const vec{len(value)} {name} = vec{len(value)}{value};"
    return f"const {type(value).__name__} {name} = {value};"

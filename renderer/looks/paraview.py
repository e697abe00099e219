"""Import colormaps and presets of ParaView: a JSON list of objects with names.

ParaView stretches a preset over the data, so values from 0 or -1 to 1 are read as shares of the range. Few presets have
opacities; they are for ParaView's unit distance, about a voxel, and linear between points.
"""

from __future__ import annotations

from functools import partial
from itertools import islice
from typing import Any

from renderer.looks.color_spaces import COLOR_SPACES, in_color_space
from renderer.looks.curves import merge_curves
from renderer.looks.look import MAX_LOOK_POINTS, Look, Looks
from renderer.looks.look_file import LookFile

_INDEX_NOTE = "the value of each colour: label 0 has the first, label 1 the second"


def read(file: LookFile) -> Looks:
    """Return the presets in a file."""
    tree = file.json()
    presets = [preset for preset in (tree if isinstance(tree, list) else [tree]) if isinstance(preset, dict)]
    if not any("RGBPoints" in preset or "IndexedColors" in preset for preset in presets):
        raise file.error("no colormaps", expected="a list of objects with Name and RGBPoints")
    # Of several presets with one name, ParaView shows the first.
    return {str(preset.get("Name", "")): partial(_look, file, preset) for preset in reversed(presets)}


def _look(file: LookFile, preset: dict[str, Any]) -> Look:
    at, notes = str(preset.get("Name", "the preset")), list[str]()
    if "RGBPoints" not in preset:
        colors = file.groups(preset.get("IndexedColors"), f"{at}: IndexedColors", 3)
        ends = ((max(k - 0.5, 0), min(k + 0.5, len(colors) - 1)) for k in range(len(colors)))
        rows = ((at, value, *color) for pair, color in zip(ends, colors, strict=True) for value in pair)
        return Look(file.curve(rows, 3), left_out=(_INDEX_NOTE,))
    points = file.curve(((at, *row) for row in file.groups(preset["RGBPoints"], f"{at}: RGBPoints", 4)), 3)
    space = str(preset.get("ColorSpace", "RGB"))
    if space.lower() not in COLOR_SPACES:
        notes.append(f"interpolation in the colour space {space[:20]}")
    # One point more than allowed is enough to report the error; all points might take minutes.
    curve = list(islice(in_color_space(points, space.lower()), MAX_LOOK_POINTS + 1))
    if preset.get("Points"):
        opacities = file.groups(preset["Points"], f"{at}: Points", 4)
        curve = merge_curves(curve, file.curve(((at, *row[:2]) for row in opacities), 1))
        if any(row[2:] != [0.5, 0] for row in opacities):
            notes.append("midpoints and sharpness of opacities")
    first, last = points[0][0], points[-1][0]
    is_share = last == 1 and first in (0, -1)
    if is_share:
        curve = [((value - first) / (last - first), parts) for value, parts in curve]
    return Look(curve, is_share, None if is_share else (first, last), left_out=tuple(notes))

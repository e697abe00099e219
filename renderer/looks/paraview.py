"""Colormaps and presets of ParaView: a JSON list, each with a name.

Values are stretched over the data when a preset is chosen, so that those from 0 or -1 to 1 are taken as shares. Few
presets have opacities; they are for ParaView's unit distance, about a voxel, and linear between points.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from renderer.looks.color_spaces import in_color_space
from renderer.looks.curves import Curve, label_curve, merge_curves
from renderer.looks.look import Look, Looks
from renderer.looks.look_file import LookFile

_KNOWN_SPACES = ("rgb", "lab", "cielab", "hsv", "diverging", "step")


def read(file: LookFile) -> Looks:
    """Return the presets in a file."""
    tree = file.json()
    presets = [preset for preset in (tree if isinstance(tree, list) else [tree]) if isinstance(preset, dict)]
    if not any("RGBPoints" in preset or "IndexedColors" in preset for preset in presets):
        raise file.error("no colormaps", expected="a list of objects with Name and RGBPoints")
    # The first of several with a name is the one that ParaView shows.
    return {str(preset.get("Name", "")): partial(_look, file, preset) for preset in reversed(presets)}


def _look(file: LookFile, preset: dict[str, Any]) -> Look:
    at = str(preset.get("Name", "the preset"))
    if "RGBPoints" not in preset:
        numbers = file.numbers(preset.get("IndexedColors"), f"{at}: IndexedColors", 3)
        colors = [file.color(numbers[k : k + 3], at) for k in range(0, len(numbers), 3)]
        note = "which value each colour is for: label 0 has the first, label 1 the second"
        return Look(label_curve({float(k): color for k, color in enumerate(colors)}), left_out=(note,))
    numbers = file.numbers(preset["RGBPoints"], f"{at}: RGBPoints", 4)
    points = sorted((numbers[k], file.color(numbers[k + 1 : k + 4], at)) for k in range(0, len(numbers), 4))
    space, notes = str(preset.get("ColorSpace", "RGB")), list[str]()
    if space.lower() not in _KNOWN_SPACES:
        notes.append(f"interpolation in the colour space {space[:20]}")
    curve: Curve = in_color_space(points, space.lower())
    if preset.get("Points"):
        numbers = file.numbers(preset["Points"], f"{at}: Points", 4)
        opacities = [(numbers[k], (file.number(numbers[k + 1], at, 0, 1),)) for k in range(0, len(numbers), 4)]
        curve = merge_curves(curve, sorted(opacities))
        if any(numbers[k + 2] != 0.5 or numbers[k + 3] != 0 for k in range(0, len(numbers), 4)):
            notes.append("midpoints and sharpness of opacities")
    left_out = tuple(notes)
    first, last = points[0][0], points[-1][0]
    if last != 1 or first not in (0, -1):
        return Look(curve, span=(first, last), left_out=left_out)
    return Look([((v - first) / (last - first), parts) for v, parts in curve], is_share=True, left_out=left_out)

"""Import colormaps of niivue, JSON: lists R, G, B, A at the intensities I, from 0 to 255, and their range.

Opacities are for a length of a voxel along the ray.
"""

from __future__ import annotations

from typing import Any

from renderer.looks.color_tables import labels_look, table_look
from renderer.looks.label_tables import make_labels
from renderer.looks.look import Look
from renderer.looks.look_file import LookFile

# The alpha of labels in a file that states no alpha; the first label has 0.
_LABEL_ALPHA = 255
# The alpha of colours that are not of labels, in a file that states no alpha; the first colour has 0.
_ALPHA = 64


def read(file: LookFile) -> Look:
    """Return the colormap in a file."""
    tree = file.json()
    columns: list[list[Any]] = [file.member(tree, key, list, "the colormap") for key in "RGB"]
    num, has_labels = len(columns[0]), "labels" in tree
    steps = [k if has_labels else 255 * k / max(num - 1, 1) for k in range(num)]
    alphas = [0, *[_LABEL_ALPHA if has_labels else _ALPHA] * (num - 1)]
    columns = [tree.get("I", steps), *columns, tree.get("A", alphas)]
    if any(not isinstance(column, list) or len(column) != num for column in columns):
        raise file.error("not lists of one length", "R, G, B, A, I", expected="as many numbers in each")
    rows = [(f"colour {k}", *row) for k, row in enumerate(zip(*columns, strict=True))]
    if has_labels:
        return labels_look(make_labels(file, ((at, step, "", *rgba) for at, step, *rgba in rows), 255.0))
    return table_look(file, rows, tree.get("min", 0), tree.get("max", 0))

"""Colormaps of niivue, JSON: lists R, G, B, A at the intensities I, from 0 to 255, and their range.

Opacities are for a voxel along the ray.
"""

from __future__ import annotations

from typing import Any

from renderer.looks.look import Look
from renderer.looks.look_file import LookFile
from renderer.looks.tables import labels_look, table_look


def read(file: LookFile) -> Look:
    """Return the colormap in a file."""
    tree = file.json()
    columns: list[list[Any]] = [file.member(tree, key, list, "the colormap") for key in "RGB"]
    num = len(columns[0])
    has_labels = "labels" in tree
    steps = range(num) if has_labels else [255 * k / max(num - 1, 1) for k in range(num)]
    alphas = [0 if has_labels and k == 0 else 255 for k in range(num)]
    columns = [tree.get("I", [*steps]), *columns, tree.get("A", alphas)]
    if any(not isinstance(column, list) or len(column) != num or not column for column in columns):
        raise file.error("not lists of one length", "R, G, B, A, I", expected="as many numbers in each")
    rows = [*zip(*columns, strict=True)]
    if has_labels:
        return labels_look(file, [(row[0], row[1:4], 255.0, row[4], 255.0, "I") for row in rows])
    return table_look(file, rows, tree.get("min", 0), tree.get("max", 0))

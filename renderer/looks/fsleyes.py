"""Colormaps of FSLeyes, .cmap: rows of red, green and blue from 0 to 1, evenly over the data's range."""

from __future__ import annotations

from renderer.looks.curves import even_curve
from renderer.looks.look import Look
from renderer.looks.look_file import LookFile


def read(file: LookFile) -> Look:
    """Return the colormap in a file."""
    rows = [(line, text.split()) for line, text in file.lines()]
    for line, row in rows or [(1, [])]:
        if len(row) != 3:
            raise file.error("not a colour", line, got=" ".join(row), expected="red, green and blue from 0 to 1")
    return Look(even_curve([file.color(row, line) for line, row in rows]), is_share=True)
